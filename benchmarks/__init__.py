"""Speed beside the peers, in one run: `python benchmarks/throughput.py`."""
