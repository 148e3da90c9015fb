"""All configuration values of the project, as YAML. Their Python is in `core`."""
