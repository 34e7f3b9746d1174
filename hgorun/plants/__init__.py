"""The plants, one file each."""
