"""Names and text of a configuration as files of C, LaTeX and XML can hold them."""

from __future__ import annotations

import re


def identifier(label: str) -> str:
    """A label as a part of a name of C: letters, digits and underscores.

    >>> identifier("FHGO r=2")
    'FHGO_r_2'
    """
    return re.sub(r"\W", "_", label, flags=re.ASCII)


def shown(text: str) -> str:
    """Text without control characters and line ends."""
    return "".join(char if char.isprintable() else "?" for char in text)


def plain(text: str) -> str:
    """Text as a comment of C may hold it."""
    return shown(text).replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?")
