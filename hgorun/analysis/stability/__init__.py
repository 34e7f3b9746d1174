"""Limits of sampling period and delay."""
