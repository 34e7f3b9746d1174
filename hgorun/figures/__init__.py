"""Figures of results: the default comparison, and those of the configuration's ``figures`` block.

Nothing is imported here: a check of names must not wait for what draws.
"""
