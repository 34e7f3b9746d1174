"""Kinds of measurement noise, one file each."""
