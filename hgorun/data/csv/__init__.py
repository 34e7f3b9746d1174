"""Tables in text files: how each is written, and its rows, one by one or in bulk."""
