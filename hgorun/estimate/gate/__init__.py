"""Outliers: which samples an observer does not take, and how it goes on without them."""
