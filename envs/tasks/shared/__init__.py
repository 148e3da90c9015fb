"""What the tasks share: their base classes, data types, geometry, scenes and reward terms."""
