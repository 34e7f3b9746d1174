"""What an observer is given of its plant: the form, gains, first values."""
