"""Names of docstrings as LaTeX: Greek letters, accents, functions, indices, and which words are English."""

from __future__ import annotations

import re

_GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi "
    "omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
)
_LETTERS = {name: rf"\{name}" for name in _GREEK.split()} | {
    **{"lam": r"\lambda", "Lam": r"\Lambda", "Gam": r"\Gamma", "eps": r"\varepsilon", "epsilon": r"\varepsilon"},
    **{"inf": r"\infty", "lt": r"\tilde{\lambda}", "phi": r"\varphi"},
}
_FUNCTIONS = {name: rf"\{name}" for name in ("sin", "cos", "tanh", "exp", "log", "sup", "min", "max", "sum", "int")}
_FUNCTIONS |= {name: rf"\operatorname{{{name}}}" for name in ("sign", "diag", "sat", "dz", "fal", "fhan", "clip")}
_ACCENTS = ("hat", "bar")
_ACCENTED = tuple(rf"\{accent}" for accent in ("dot", "ddot", "tilde", *_ACCENTS))
_PART = re.compile(r"[A-Za-z]+|\d+|,")


def letter(word: str) -> str:
    """A name: a letter with its accent, a function, or letters that stand for one thing."""
    if word in _FUNCTIONS:
        return _FUNCTIONS[word]
    for accent in _ACCENTS:
        if word.endswith(accent) and (short := word.removesuffix(accent)) and (len(short) == 1 or short in _LETTERS):
            return rf"\{accent}{{{_LETTERS.get(short, short)}}}"
    if word in _LETTERS or len(word) == 1:
        return _LETTERS.get(word, word)
    if word == "dinf":
        return r"d_{\infty}"
    if word[0] == "d" and (len(word) == 2 or word[1:] in _LETTERS):
        return f"d{letter(word[1:])}"
    if len(word) == 2 and word[0].isupper():
        return f"{word[0]}_{{{word[1]}}}"
    return rf"\mathrm{{{word}}}"


def index(text: str) -> str:
    """Letters, numbers and words behind a low line."""
    return "".join(_short(part) if part.isalpha() else part for part in _PART.findall(text.replace("_", "")))


def _short(part: str) -> str:
    """An index of one or two letters is indices, a longer one a word."""
    if part in _LETTERS:
        return _LETTERS[part] + " "
    return rf"\mathrm{{{part}}}" if len(part) > 2 or part == "in" else part


def is_word(text: str) -> bool:
    """Whether a text starts with a word of English, and not with a symbol."""
    word = re.match(r"[a-z]{2,}(?=$|[\s,.;:])", text)
    return word is not None and letter(word[0]).startswith(r"\mathrm")


def is_symbol(word: str) -> bool:
    """Whether a word stands for a quantity: a letter, Greek or not, with a number or an accent."""
    name = word.rstrip("0123456789")
    accent = next((accent for accent in _ACCENTS if name.endswith(accent)), "")
    short = name.removesuffix(accent)
    return short in _LETTERS or (short in tuple("uxyzPQ") if accent else len(short) == 1)


def scripted(base: str, index: str, power: str) -> str:
    """A letter with its index and its power; an accent is that of the letter alone."""
    if (index or power) and base.startswith(_ACCENTED):
        base = f"{{{base}}}"
    return base + (f"_{{{index}}}" if index else "") + (f"^{{{power}}}" if power else "")
