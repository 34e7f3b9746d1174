"""Metrics of one or several results as a table of LaTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from itertools import product

from hgorun.result.metrics.base import all_metrics, unit_of
from hgorun.result.result import Result
from hgorun.result.run_names import run_names
from hgorun.tables.latex_scores import columns_of_scores, lines_of_scores
from hgorun.tables.layout import number
from hgorun.tables.rows import NEVER, Row, metrics_of, rows_of, states_of
from hgorun.tables.typeset import latex_number, latex_words, symbol

NEEDS = r"% needs \usepackage{booktabs}"
_PAGE = 6  # numbers side by side on a page
_UNRESOLVED = r"$\sim$: not resolved by the integration"


def latex(results: Sequence[Result], metrics: Sequence[str] | None = None) -> str:
    r"""A ``tabular`` for a document that loads the package booktabs.

    The best number of every column is bold, in every run, since runs may be measured otherwise: the smallest, for tv
    the nearest to 1. Scores of recorded data stand below the metrics, smallest errors bold. What does not fit side
    by side follows below each other; observers that are not ok are named at the end, as are units that differ among the
    runs, what is bold, and the mark of times that are not resolved.

    Parameters
    ----------
    results : sequence of Result
    metrics : sequence of str, optional
        Which, in this order; all by default.
    """
    rows, states = rows_of(results), states_of(results)
    stated = _stated(results)
    units = {name: next(iter(texts)) for name, texts in stated.items() if len(texts) == 1}
    known = metrics_of(rows)
    chosen = [metric for metric in (known if metrics is None else metrics) if metric in known]
    at_once = max(_PAGE // max(len(states), 1), 1)
    blocks = [chosen[i : i + at_once] for i in range(0, len(chosen), at_once)]
    scores = columns_of_scores(rows, _PAGE) if metrics is None else []
    blocks = blocks or ([] if scores else [[]])
    width = max([len(block) * len(states) for block in blocks] + [len(block) for block in scores])
    marked = set[str]()
    lines = [NEEDS, rf"\begin{{tabular}}{{l{'r' * width}}}", r"\toprule"]
    for block in blocks:
        padding = [""] * (width - len(block) * len(states))
        of_columns = [unit_of(metric, s, units) for metric in block for s in states]
        lines += [*([r"\midrule"] if block is not blocks[0] else []), *latex_head(block, states, padding, of_columns)]
        numbers = {
            (metric, s): [None if _undecided(row, metric, s) else row.value(metric, s) for row in rows]
            for metric in block
            for s in states
        }
        best = {
            (column, run): _best(column[0], [values[i] for i, row in enumerate(rows) if row.run == run])
            for column, values in numbers.items()
            for run in {row.run for row in rows}
        }
        marked |= {metric for ((metric, _), _), text in best.items() if text is not None}
        for row in rows:
            cells = [_cell(row, *column, best[column, row.run]) for column in numbers]
            lines.append(" & ".join([latex_words(row.text), *cells, *padding]) + r" \\")
    for columns in scores:
        of_scores = list(lines_of_scores(rows, columns, width))
        lines += [*([r"\midrule"] if blocks or columns is not scores[0] else []), *of_scores]
        marked |= {"rmse" for line in of_scores if r"\mathbf" in line}
    notes = [f"{row.text} {row.status}" for row in rows if row.observer.status != "ok"]
    for name, texts in stated.items():
        if len(texts) > 1:
            notes.append(f"{name} in {', '.join(f'{text} ({run})' for text, run in texts.items())}")
    notes = [latex_words(note) for note in notes]
    if any(row.unresolved(*column) for row in rows for column in product(chosen, states)):
        notes.append(_UNRESOLVED)
    if marked:
        notes.append(latex_words(_of_bold(marked, len(results))))
    if notes:
        lines += [r"\midrule", rf"\multicolumn{{{width + 1}}}{{l}}{{{'; '.join(notes)}}} \\"]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def _of_bold(metrics: Collection[str], runs: int) -> str:
    """What numbers of some metrics are in bold."""
    known = all_metrics(closed=True)
    near = {name: metric.ideal for name, metric in known.items() if name in metrics and metric.ideal}
    others = "".join(f", of {name} nearest to {ideal:g}" for name, ideal in near.items())
    return f"bold: smallest{' of each run' if runs > 1 else ''}{others}"


def _stated(results: Sequence[Result]) -> dict[str, dict[str, str]]:
    """For everything with a unit the units stated, and the first run that states each."""
    found: dict[str, dict[str, str]] = {}
    for run, result in zip(run_names(results), results, strict=True):
        for name, text in result.units.items():
            if text:
                found.setdefault(name, {}).setdefault(text, run)
    return found


def latex_head(
    metrics: Sequence[str], states: Sequence[str], padding: Sequence[str], units: Sequence[str] = ()
) -> list[str]:
    """The lines above the rows: metrics, below each of them the states, and the units if any; then empty columns."""
    n = len(states)
    if not metrics:
        return [r"\midrule"]
    above = [rf"\multicolumn{{{n}}}{{c}}{{{latex_words(metric)}}}" for metric in metrics]
    rules = [rf"\cmidrule(lr){{{2 + i * n}-{1 + (i + 1) * n}}}" for i in range(len(metrics))]
    below = [f"${symbol(state)}$" for _ in metrics for state in states]
    measured = [f"{{[}}{latex_unit(unit)}]" if unit else "" for unit in units]
    last = [" & ".join(["", *measured, *padding]) + r" \\"] if any(measured) else []
    return [
        " & ".join(["", *above, *padding]) + r" \\", " ".join(rules),
        " & ".join(["", *below, *padding]) + r" \\", *last, r"\midrule",
    ]  # fmt: skip


def latex_unit(unit: str) -> str:
    """A unit with its powers raised."""
    parts = re.split(r"\^\{?([-+]?[0-9.]+)\}?", unit)
    return "".join(f"$^{{{part}}}$" if i % 2 else latex_words(part) for i, part in enumerate(parts))


def _undecided(row: Row, metric: str, state: str) -> bool:
    """Of what no best one is told: times that do not come, or are not resolved."""
    return row.never(metric, state) or row.unresolved(metric, state)


def _cell(row: Row, metric: str, state: str, best: str | None) -> str:
    if row.never(metric, state):
        return NEVER
    if row.unresolved(metric, state):
        return rf"$\sim {latex_number(number(row.value(metric, state)))}$"
    return _latex_number(row.value(metric, state), best)


def _best(metric: str, values: Sequence[float | None]) -> str | None:
    """The best number as printed; None where nothing is compared."""
    finite = [value for value in values if value is not None and math.isfinite(value)]
    if not finite or len(set(map(number, values))) < 2:
        return None
    known = all_metrics(closed=True).get(metric)
    ideal = known.ideal if known else 0.0
    return number(min(finite, key=lambda v: abs(math.log(v / ideal)) if ideal and v > 0 else v))


def _latex_number(value: float | None, best: str | None) -> str:
    if value is None or math.isnan(value):
        return "--"
    if math.isinf(value):
        return r"$\infty$" if value > 0 else r"$-\infty$"
    shown = latex_number(number(value))
    return rf"$\mathbf{{{shown}}}$" if number(value) == best else f"${shown}$"
