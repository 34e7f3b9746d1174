"""Names of states, units and labels as they stand in figures and tables."""

from __future__ import annotations

import re
import textwrap

_GREEK = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi "
    "psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
).split()


def symbol(name: str, *, hat: bool = False) -> str:
    r"""A name as mathematics, for matplotlib and for LaTeX, without dollar signs.

    >>> symbol("x1"), symbol("s_in"), symbol("theta2", hat=True)
    ('x_{1}', 's_{\\mathrm{in}}', '\\hat{\\theta}_{2}')
    """
    found = re.fullmatch(r"([A-Za-z]+?)(\d*)((?:_[A-Za-z0-9]+)*)_*", name)
    if found is None:
        base, indices = name, []
    else:
        base, indices = found[1], [part for part in (found[2], *found[3].split("_")) if part]
    if len(base) == 1:
        letter = base
    elif base in _GREEK:
        letter = rf"\{base}"
    else:
        letter = rf"\mathrm{{{_escaped(base)}}}"
    if hat:
        letter = rf"\hat{{{letter}}}" if len(base) == 1 or base in _GREEK else rf"\widehat{{{letter}}}"
    below = ",".join(part if part.isdigit() or len(part) == 1 else rf"\mathrm{{{part}}}" for part in indices)
    return f"{letter}_{{{below}}}" if below else letter


def _escaped(text: str) -> str:
    return re.sub(r"([_$%#&{}])", r"\\\1", text)


def unit(text: str) -> str:
    """A unit in brackets with a space before it, powers raised; empty where there is none."""
    raised = re.sub(r"\^\{?([-+]?[0-9.]+)\}?", r"$^{\1}$", text)
    return f" [{raised}]" if text else ""


def words(text: str, *, most: int = 60) -> str:
    """Text that somebody wrote, safe for matplotlib: mathematics where it is, dollar signs where it is not.

    Parameters
    ----------
    text : str
    most : int
        Longer text is cut.
    """
    text = "".join(char if char.isprintable() else " " for char in text).strip()
    if text.count("$") >= 2 and len(text) <= 4 * most and _is_mathematics(text):
        return text
    text = text if len(text) <= most else text[: most - 1].rstrip() + "…"
    return text.replace("$", r"\$")


def _is_mathematics(text: str) -> bool:
    from matplotlib.mathtext import MathTextParser

    try:
        MathTextParser("path").parse(text)
    except ValueError:
        return False
    return True


def paragraph(text: str, width: float) -> str:
    """A title broken into lines for a figure so many inches wide."""
    shown = words(text, most=400)
    return shown if "$" in shown else textwrap.fill(shown, max(20, int(width * 13)))
