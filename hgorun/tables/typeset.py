"""Names of states, units and labels as they stand in figures and tables."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from bisect import bisect_left
from collections.abc import Mapping

# Letters that have a LaTeX command, as a regular expression.
GREEK = (
    "alpha|beta|gamma|delta|epsilon|zeta|eta|theta|iota|kappa|lambda|mu|nu|xi|pi|rho|sigma|tau|upsilon|phi|chi|psi"
    "|omega|varepsilon|Gamma|Delta|Theta|Lambda|Xi|Pi|Sigma|Upsilon|Phi|Psi|Omega"
)
TIMES = ("period", "delay", "jitter", "offset", "start", "end", "step", "output_step")
"""Keys, at the end of a path, whose values are times."""
_SPECIAL = {
    **{char: f"\\{char}" for char in "{}$&%#_"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
    **{"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}"},
    **{"[": "{[}", "*": "{*}"},  # they would be read as arguments of the \\ before them
}
_FORMULA = re.compile(r"(?<!\\)\$[^$]*\$")
_NUMBER = re.compile(r"(?<=\d) (?=\S{1,3}(?:[\s;,.:)]|$))")  # the space between a number and its unit
# Mathematics in a label that LaTeX is sure to understand.
_MATHEMATICS = re.compile(
    r"(\$(?:[A-Za-z0-9 =+\-.,<>()/]|[_^](?:[A-Za-z0-9]|\{[A-Za-z0-9]+\})(?![_^])"
    rf"|\\(?:{GREEK})(?![A-Za-z]))+\$)"
)


def time_unit(units: Mapping[str, str]) -> str:
    """The unit of time as it stands behind a number; nothing where there is none."""
    found = printable(units.get("time", ""))
    return "" if found in ("-", "1") else found


def is_word(name: str) -> bool:
    """Whether a name is set upright, being neither a letter nor a Greek one: a hat on it is mistaken for an accent."""
    return symbol(name).startswith(r"\mathrm")


def both(name: str) -> str:
    r"""A state and its estimate on one axis, as mathematics without dollar signs; a word stands for both.

    >>> both("x1"), both("speed")
    ('x_{1},\\ \\hat{x}_{1}', '\\mathrm{speed}')
    """
    return symbol(name) if is_word(name) else rf"{symbol(name)},\ {symbol(name, hat=True)}"


def estimate_of(name: str) -> str:
    r"""The estimate of a state as mathematics without dollar signs.

    >>> estimate_of("x1"), estimate_of("speed")
    ('\\hat{x}_{1}', '\\mathrm{speed}\\ \\mathrm{estimate}')
    """
    return rf"{symbol(name)}\ \mathrm{{estimate}}" if is_word(name) else symbol(name, hat=True)


def error_of(name: str) -> str:
    r"""The error of an estimate as mathematics without dollar signs.

    >>> error_of("x1"), error_of("speed")
    ('\\hat{x}_{1} - x_{1}', '\\mathrm{speed}\\ \\mathrm{error}')
    """
    return rf"{symbol(name)}\ \mathrm{{error}}" if is_word(name) else f"{symbol(name, hat=True)} - {symbol(name)}"


def symbol(name: str, *, hat: bool = False) -> str:
    r"""A name as mathematics, for matplotlib and for LaTeX, without dollar signs.

    >>> symbol("x1"), symbol("s_in"), symbol("theta2", hat=True), symbol("speed", hat=True)
    ('x_{1}', 's_{\\mathrm{in}}', '\\hat{\\theta}_{2}', '\\hat{\\mathrm{s}}\\mathrm{peed}')
    """
    found = re.fullmatch(r"([A-Za-z]+?)(\d*)((?:_[A-Za-z0-9]+)*)_*", name)
    if found is None:
        base, indices = re.sub("[^A-Za-z0-9_]", "?", name), []
    else:
        base, indices = found[1], [part for part in (found[2], *found[3].split("_")) if part]
    wide = len(base) > 1 and not re.fullmatch(f"{GREEK}|eps", base)
    letter = rf"\mathrm{{{_escaped(base)}}}" if wide else base
    if len(base) > 1 and not wide:
        letter = r"\varepsilon" if base == "eps" else rf"\{base}"
    if hat:  # over the first letter of a word: a wide one looks like a roof, one over its middle like a stain
        marked = re.fullmatch("(_*)(.)(.*)", base) if wide else None
        if marked is None:
            letter = rf"\hat{{{letter}}}"
        else:
            parts = [rf"\mathrm{{{_escaped(part)}}}" if part else "" for part in marked.groups()]
            letter = rf"{parts[0]}\hat{{{parts[1]}}}{parts[2]}"
    below = ",".join(part if part.isdigit() or len(part) == 1 else rf"\mathrm{{{part}}}" for part in indices)
    return f"{letter}_{{{below}}}" if below else letter


def _escaped(text: str) -> str:
    return re.sub(r"([_$%#&{}])", r"\\\1", text)


def unit(text: str) -> str:
    """A unit in brackets with a space before it, powers raised; empty where there is none."""
    shown = words(text)
    if "$" not in shown:
        shown = re.sub(r"\^\{?([-+]?[0-9.]+)\}?", r"$^{\1}$", shown)
    return f" [{shown}]" if shown else ""


def printable(text: str) -> str:
    """Text without control characters, which stand for spaces."""
    return "".join(char if char.isprintable() else " " for char in text)


def columns(text: str) -> int:
    """Columns that a text takes in a terminal, where some characters take two."""
    wide = sum(unicodedata.east_asian_width(char) in "WF" for char in text)
    return len(text) + wide - sum(unicodedata.combining(char) > 0 for char in text)


def shortened(text: str, limit: int) -> str:
    """A text without its middle, where labels differ least, when it takes more than ``limit`` columns."""
    while columns(text) > limit:
        keep = min((len(text) - 2) // 2, limit)
        text = f"{text[:keep].rstrip('…')}…{text[-keep:].lstrip('…')}"
    return text


def words(text: str, *, limit: int = 60) -> str:
    """Text that somebody wrote, safe for matplotlib: mathematics where it is, dollar signs where it is not.

    Parameters
    ----------
    text : str
    limit : int
        Longer text is cut.
    """
    text = printable(text).strip()
    if text.count("$") >= 2 and len(text) <= 4 * limit and _is_mathematics(text):
        return text
    return shortened(text, limit).replace("$", r"\$")


def _is_mathematics(text: str) -> bool:
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(text)
    except (ValueError, RecursionError):
        return False
    return True


def paragraph(text: str, width: float) -> str:
    """A title broken into lines about equally long, for a figure so many inches wide.

    Formulas stay whole, and so do numbers with their units.
    """
    shown = words(text, limit=400)
    formulas = iter(_FORMULA.findall(shown))
    held = _FORMULA.sub(lambda m: "\1" + "\2" * (_letters(m[0]) - 1), shown)  # as long as they are seen to be
    held = _NUMBER.sub("\3", held)
    most = max(20, int(width * 13))
    lines = textwrap.wrap(held, most, break_long_words="\1" not in held, break_on_hyphens=False)

    def fits(width: int) -> bool:
        narrower = _unbroken(held, width)
        return len(narrower) <= len(lines) and all(len(line) <= width for line in narrower)

    least = bisect_left(range(most), True, lo=1, key=fits) if len(lines) > 1 else most
    lines = _unbroken(held, least) if least < most else lines
    return re.sub("\1\2*", lambda _: next(formulas), "\n".join(lines)).replace("\3", " ")


def _unbroken(text: str, width: int) -> list[str]:
    """Lines of whole words; a longer one has a line of its own."""
    return textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False)


def _letters(formula: str) -> int:
    """How many characters of mathematics are seen, about."""
    bare = re.sub(r"\\(?:hat|bar|tilde|dot|math\w+)(?![A-Za-z])", "", formula.strip("$"))
    return max(1, len(re.sub(r"[{}_^ ]", "", re.sub(r"\\[A-Za-z]+|\\.", "x", bare))))


def latex_number(text: str) -> str:
    """A number as it is printed, its power of ten as mathematics."""
    return re.sub(r"e([-+])0*(\d+)", lambda m: rf" \times 10^{{{m[1].strip('+')}{m[2]}}}", text)


def latex_words(words: str) -> str:
    """Words with everything escaped that LaTeX would read as a command; simple mathematics is left."""
    parts = _MATHEMATICS.split(printable(words))
    return "".join(part if i % 2 else "".join(map(_latex_character, part)) for i, part in enumerate(parts))


def _latex_character(char: str) -> str:
    name = unicodedata.name(char, "").split()
    if name[:1] == ["GREEK"] and len(name) == 4:
        letter = name[3].replace("LAMDA", "LAMBDA")
        letter = letter.lower() if name[1] == "SMALL" else letter.capitalize()
        if re.fullmatch(GREEK, letter):
            return rf"$\{letter}$"
    return _SPECIAL.get(char, char)
