"""Helpers that tests and benchmarks share: documented commands, a browser, statistics. Not part of the wheel."""
