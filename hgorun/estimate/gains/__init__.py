"""Gains that recorded data speak for."""
