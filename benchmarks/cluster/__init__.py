"""Collection, sweeps and evaluation on a Ray cluster: python -m benchmarks.cluster ROW --tries N."""
