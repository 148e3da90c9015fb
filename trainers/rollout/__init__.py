"""Batches of experience, evaluation, instruction ablations and videos."""
