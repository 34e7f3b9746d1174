"""The folder in which an ensemble is carried out: its manifest, and a file for every block."""
