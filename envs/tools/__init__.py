"""Programs that write pictures and reference tables of the options in conf/."""
