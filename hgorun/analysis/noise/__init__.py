"""Noise in the estimates, predicted and measured."""
