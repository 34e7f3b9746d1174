"""An ensemble as a collected file: what is in it, how it is laid out, read back, and told."""
