"""All configuration values of the project, as YAML, and the modules that read and check them."""
