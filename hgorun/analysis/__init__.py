"""Theory beside simulation: what is known of an observer's gains, sampling, delay, noise and excitation."""
