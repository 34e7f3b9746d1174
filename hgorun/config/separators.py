"""What stands between a key and its value where that is no colon with a space behind it."""

from __future__ import annotations

import re

_KEY = r"[A-Za-z_][A-Za-z0-9_.-]*"
_BEFORE = r"(?:^\s*(?:- +)?|\{(?:[^}]*,)?\s*)"
_TIGHT = re.compile(rf"{_BEFORE}({_KEY}) ?:(?=[^\s:/])([^,}}#]*)")
_EQUALS = re.compile(rf"{_BEFORE}({_KEY})\s*=(?!=)([^,}}#]*)")

_NEXT = re.compile(rf"\s{_KEY}(?::|\s*=(?!=))")


def without_space(text: str) -> str:
    """The remedy where a colon in a line has no space behind it, or ""."""
    found = _TIGHT.search(text)
    return f"a space belongs behind the colon, as in {_written(found)}" if found else ""


def misread(text: str) -> str:
    """The remedy where a text is a key and its value, without a space behind the colon or with ``=``; "" elsewhere."""
    found = _EQUALS.search(text)
    equals = f"a colon separates a name from its value, as in {_written(found)}" if found else ""
    return without_space(text) or equals


def _written(found: re.Match[str]) -> str:
    value = _NEXT.split(found[2], maxsplit=1)[0].strip()
    whole = not value.startswith(("{", "[", "'", '"'))
    return f"{found[1]}: {value[:40] if whole else f'{value[0]}...'}"
