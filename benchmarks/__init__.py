"""Benchmarks: throughput beside peers (`python benchmarks/throughput.py`), language, gestures, experts, the page."""
