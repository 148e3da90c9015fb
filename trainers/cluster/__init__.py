"""Work on a Ray cluster: collection, sweeps, evaluation and recording. Ray is imported in `ray_session` alone."""
