"""Environments that a person directs."""
