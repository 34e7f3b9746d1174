"""The conditions of single publications, with certificates."""
