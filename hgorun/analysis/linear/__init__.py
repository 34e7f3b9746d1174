"""Linear systems: the error dynamics, their transfer functions, what exponentials and sinusoids become."""
