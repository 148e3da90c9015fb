"""Programs that write pictures and reference tables of what conf/ offers."""
