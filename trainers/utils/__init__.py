"""Atomic file writes, optional imports and system information."""
