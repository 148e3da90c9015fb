"""Several runs together: sweeps, their jobs, and the records that finished runs leave."""
