"""Every value of the project, as YAML, and `conf.schema`, which turns YAML nodes into checked dataclasses."""
