"""Reports, figures and statistics of finished runs."""
