"""One training run: the loop, its metrics and checkpoints."""
