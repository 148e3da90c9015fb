"""Faults that runs must survive, each tried many times: python -m benchmarks.faults [row ...] [--tries N]."""
