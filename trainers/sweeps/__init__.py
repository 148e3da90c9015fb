"""Several runs: jobs, and the records that they leave."""
