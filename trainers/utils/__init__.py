"""Files that are written whole, and tensors that are read safely."""
