"""Sentences about formulas as Markdown: symbols in them are formulas, as those of equations are."""

from __future__ import annotations

import re

from site_letters import is_symbol
from site_symbols import KEPT, written
from site_tex import formula

_SCRIPT = r"_\w+|_\([^()]*\)|\^\([^()]*\)|\^-?\w+|\^(?=[\s',.;)]|$)"
_NAMED = re.compile(rf"(?<![\w'`\\^])(?<!\w\.)([A-Za-z]+\d*)((?:{_SCRIPT})*(?:'+(?!\w))?)(?!\w|\.\w|\^)")
_SIZES = re.compile(r"\b([nqmr](?:_\w+)?|\d) x ([nqmr](?:_\w+)?|\d)\b")
_WORD = re.compile(
    r"(?:a(?! ?[=<>+/,)-])|A(?= [A-Za-z]?[a-z]{2})|I|(?<=in )C|inf)\b"
)  # articles, a numeral, a language


def readable(text: str) -> str:
    """A text about formulas as Markdown; what stands between backquotes stays."""
    return "".join(part if i % 2 else _sentence(part) for i, part in enumerate(KEPT.split(text)))


def escaped(text: str) -> str:
    """A text in which nothing is an instruction to Markdown."""
    return re.sub(r"([*<>\[\]$~|\\]|(?<!\w)_|_(?!\w))", r"\\\1", text)


def _sentence(text: str) -> str:
    text = _SIZES.sub(r"\1 × \2", text)
    shown, at = [], 0
    for found in _NAMED.finditer(text):
        if is_symbol(found[1]) and (found[2] or not _WORD.match(text, found.start())):
            shown += [escaped(written(text[at : found.start()])), f"${formula(found[0])}$"]
            at = found.end()
    return "".join([*shown, escaped(written(text[at:]))])
