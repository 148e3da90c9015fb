"""One training run: the training loop, its metrics and its checkpoints."""
