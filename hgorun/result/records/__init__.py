"""What a result consists of, as records: trajectories, observers, statuses, recorded samples, theory."""
