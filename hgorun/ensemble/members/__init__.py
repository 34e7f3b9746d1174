"""Which members an ensemble has: a base, axes and their values, and the text from which any process makes them."""
