"""Excitation of plants that are not uniformly observable."""
