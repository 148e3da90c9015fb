"""The configuration, as YAML. This file makes the folder a package, without which Hydra does not find `pkg://conf`."""
