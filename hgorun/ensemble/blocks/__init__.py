"""Blocks of members: how they are cut and carried out, side by side or alone, and how well."""
