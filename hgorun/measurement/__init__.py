"""What the observers are told, and when: sampling, delay, noise."""
