"""Statistics of ensembles as LaTeX."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence

from hgorun.ensemble.statistics.statistics import Statistics
from hgorun.result.metrics.base import unit_of
from hgorun.tables.axis_names import names_of_values, short_axis, unit_of_axis
from hgorun.tables.ensemble import Compared, best, said_of_numbers
from hgorun.tables.latex import NEEDS, latex_head, latex_unit
from hgorun.tables.rows import NEVER
from hgorun.tables.typeset import latex_number, latex_words, symbol
from hgorun.tables.uncertain import latex_uncertain

_PAGE = 3  # numbers with their uncertainty side by side on a page
_BOLD = "bold: the best mean, which differs from all others (paired tests, Holm-adjusted p < 0.05)"
_LINE = 70  # characters of a line below a table, which is not to be wider for what is said there


def latex(found: Sequence[Compared]) -> str:
    r"""A ``tabular`` for each ensemble, for a document that loads the package booktabs.

    Cells are mean ± half the 95 % interval; below stands of how many members, what is bold, and which times have no
    mean or one that is too small. The best mean of a column is bold only if it differs from that of every other
    observer (paired test, Holm-adjusted p < 0.05) and no other observer has fewer failures.
    """
    return "\n".join([NEEDS, *map(_tabular, found)])


def _tabular(one: Compared) -> str:
    states, observers = one.members.states, one.members.observers
    metrics = list(dict.fromkeys(metric for _, metric, _ in one.whole.summaries))
    at_once = max(_PAGE // max(len(states), 1), 1)
    blocks = [metrics[i : i + at_once] for i in range(0, len(metrics), at_once)] or [[]]
    width = len(blocks[0]) * len(states)
    places = _places(one)
    lines = [rf"\begin{{tabular}}{{l{'r' * width}}}", r"\toprule"]
    for block in blocks:
        padding = [""] * (width - len(block) * len(states))
        units = [unit_of(metric, state, one.members.units) for metric in block for state in states]
        lines += [*([r"\midrule"] if block is not blocks[0] else []), *latex_head(block, states, padding, units)]
        for part, place in zip(one.parts, places, strict=True):
            if place:
                lines.append(rf"\multicolumn{{{width + 1}}}{{l}}{{{place}}} \\")
            for label in observers:
                cells = [_cell(part, label, metric, state) for metric in block for state in states]
                lines.append(" & ".join([latex_words(label), *cells, *padding]) + r" \\")
    notes = [_members(one)] if observers else []
    notes += [
        f"{label}: {one.whole.failed(label)} of {one.whole.members} without numbers"
        for label in observers
        if one.whole.failed(label)
    ]
    bold = [_BOLD] if any(r"\mathbf" in line for line in lines) else []
    if notes:
        text = "; ".join(map(latex_words, notes)).replace("±", r"$\pm$")
        said = [
            line
            for words in (*bold, *said_of_numbers(one))
            for line in textwrap.wrap(words, _LINE, break_on_hyphens=False)
        ]
        below = [text, *map(latex_words, said)]
        lines += [r"\midrule", *(rf"\multicolumn{{{width + 1}}}{{l}}{{{line}}} \\" for line in below)]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _places(one: Compared) -> list[str]:
    """The values of each part on the axes by which the ensemble is divided, as mathematics where they are numbers."""
    names = {axis: names_of_values(part.at[axis] for part in one.points) for axis in one.by}
    return [
        ", ".join(
            _equation(short_axis(axis, one.by), names[axis][value], value, unit_of_axis(axis, one.members.units))
            for axis, value in part.at.items()
        )
        for part in one.parts
    ]


def _equation(name: str, text: str, value: object, unit: str) -> str:
    """A name and its value with its unit; the name may end with whose it is."""
    what, of, whose = name.partition(" of ")
    left = f"${symbol(what)}$" if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", what) else latex_words(what)
    left += latex_words(of + whose)
    if not isinstance(value, int | float):
        return f"{left} = {latex_words(text)}"
    return f"{left} $= {latex_number(text)}$" + (f" {latex_unit(unit)}" if unit else "")


def _members(one: Compared) -> str:
    """Of how many members a cell is, and what stands beside its mean."""
    counts = sorted({part.members for part in one.parts})
    each = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    honest = all(part.independent for part in one.parts)
    differ = [axis for axis in one.members.axes if axis not in one.by]
    over = f" ({', '.join(short_axis(axis, differ) for axis in differ)})" if differ else ""
    return f"mean {'± 95 % interval ' if honest else ''}of {each} member{'s' * (counts[-1] > 1)}{over}"


def _cell(part: Statistics, label: str, metric: str, state: str) -> str:
    summary = part.summaries[label, metric, state]
    if part.has_none(metric, state, label):
        return NEVER
    return latex_uncertain(summary.mean, summary.half, bold=best(part, metric, state) == label)
