"""Logs of very many samples, carried out stretch by stretch."""
