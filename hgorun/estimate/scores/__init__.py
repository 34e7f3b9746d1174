"""What a run is compared with, and what is told of it: bands, scores, and why an observer is lost."""
