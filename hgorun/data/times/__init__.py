"""Dates and times as numbers: what a text or a number says, and what to write where it says nothing."""
