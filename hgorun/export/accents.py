"""Symbols of LaTeX with a dot or a bar over their letter."""

from __future__ import annotations


def dotted(symbol: str) -> str:
    r"""The time derivative of a symbol.

    >>> dotted(r"\hat{x}_{1}")
    '\\dot{\\hat{x}}_{1}'
    """
    letter, below = parted(symbol)
    return rf"\dot{{{letter}}}{below}"


def barred(symbol: str) -> str:
    r"""Another symbol.

    >>> barred(r"\hat{x}_{1}")
    '\\bar{\\hat{x}}_{1}'
    """
    letter, below = parted(symbol)
    return rf"\bar{{{letter}}}{below}"


def parted(symbol: str) -> tuple[str, str]:
    r"""A symbol without its indices, and these.

    >>> parted(r"\hat{x}_{1}"), parted("e")
    (('\\hat{x}', '_{1}'), ('e', ''))
    """
    depth = 0
    for i, char in enumerate(symbol):
        depth += (char == "{") - (char == "}")
        if char == "_" and not depth:
            return symbol[:i], symbol[i:]
    return symbol, ""
