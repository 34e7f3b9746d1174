"""Formulas of docstrings as readers of a page expect them: Greek letters, hats, powers and relations as characters."""

from __future__ import annotations

import re
from unicodedata import lookup

_SMALL = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lamda mu nu xi pi rho sigma tau upsilon phi chi psi omega"
)
_CAPITAL = "Gamma Delta Theta Lamda Xi Pi Sigma Upsilon Phi Psi Omega"  # the others are Latin letters to the eye
_GREEK = {name: lookup(f"GREEK SMALL LETTER {name}") for name in _SMALL.split()}
_GREEK |= {name: lookup(f"GREEK CAPITAL LETTER {name}") for name in _CAPITAL.split()}
_GREEK["Upsilon"] = "\N{GREEK UPSILON WITH HOOK SYMBOL}"
_OTHER_NAMES = {"lambda": "lamda", "lam": "lamda", "Lambda": "Lamda", "Lam": "Lamda", "Gam": "Gamma", "eps": "epsilon"}
_GREEK |= {short: _GREEK[name] for short, name in _OTHER_NAMES.items()}
_HAT = "\N{COMBINING CIRCUMFLEX ACCENT}"
_HATS = {f"{letter}hat": letter + _HAT for letter in "uxyz"}  # what and that are words
_HATS["lt"] = _GREEK["lamda"] + "\N{COMBINING TILDE}"  # a lambda that is made of others
_HATS |= {f"{name}hat": letter + _HAT for name, letter in _GREEK.items()}
_RAISED = str.maketrans("-0123456789T", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹ᵀ")
_RELATIONS = {">=": "≥", "<=": "≤", "!=": "≠", "+-": "±", "->": "→", "<-": "←"}

KEPT = re.compile(r"(``.+?``|`[^`]+`|(?:^|(?<=[.;] ))\w+(?=:))", re.DOTALL)  # code, and keys that a sentence is about
_WORD = re.compile(r"(?<!\w)[A-Za-z]\w*")
_LETTER = re.compile(r"([A-Za-z]+)(\d*)")
_BARE_HAT = re.compile(r"(?<=[Α-ωϒ])\^(?=[\s',.;)]|$)")
_POWER = re.compile(r"\^(-?(?:\d+|T))(?!\w|\.\d)")
_RELATION = re.compile("|".join(map(re.escape, _RELATIONS)))


def symbols(text: str) -> str:
    """A text with symbols; what stands between backquotes stays, and a word before a colon that begins a sentence.

    Such a word is a key of a configuration.
    """
    return "".join(part if i % 2 else written(part) for i, part in enumerate(KEPT.split(text)))


def written(text: str) -> str:
    """A text without code."""
    text = _BARE_HAT.sub(_HAT, _WORD.sub(lambda found: _name(found[0]), text))
    text = _POWER.sub(lambda found: found[1].translate(_RAISED), text)
    return _RELATION.sub(lambda found: _RELATIONS[found[0]], text)


def _name(word: str) -> str:
    """A letter with its indices; another word stays as it is."""
    first, *indices = word.split("_")
    if len(first) > 1 and _letter(first) == first:
        return word
    return "_".join(map(_letter, (first, *indices)))


def _letter(word: str) -> str:
    found = _LETTER.fullmatch(word)
    return (_GREEK | _HATS).get(found[1], found[1]) + found[2] if found else word
