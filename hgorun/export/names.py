"""Names of observers as other languages have them."""

from __future__ import annotations

import re


def identifier(label: str) -> str:
    """A label as a part of a name of C: letters, digits and underscores.

    >>> identifier("FHGO r=2")
    'FHGO_r_2'
    """
    return re.sub(r"\W", "_", label, flags=re.ASCII)
