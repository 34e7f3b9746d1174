"""Scores of estimates of recorded data as lines of a table of LaTeX."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from hgorun.tables.rows import Row
from hgorun.tables.scores import names_of_scores, score_of, score_text
from hgorun.tables.typeset import latex_number, latex_words, symbol

Column = tuple[str, str]  # the score, and what it is of


def columns_of_scores(rows: Sequence[Row], most: int) -> list[list[Column]]:
    """The columns of each block: at most so many side by side, those of a score in one where they fit."""
    blocks: list[list[Column]] = []
    for score, names in names_of_scores(rows).items():
        columns = [(score, name) for name in names]
        if blocks and len(blocks[-1]) + len(columns) <= most:
            blocks[-1] += columns
        else:
            blocks += [columns[i : i + most] for i in range(0, len(columns), most)]
    return blocks


def lines_of_scores(rows: Sequence[Row], block: Sequence[Column], width: int) -> Iterator[str]:
    """The lines of a block: scores, what each is of, and a line for each observer, the smallest error of a run bold."""
    padding = [""] * (width - len(block))
    above, rules, first = [""], [], 2
    for score, group in groupby(block, key=lambda column: column[0]):
        count = len(list(group))
        above.append(rf"\multicolumn{{{count}}}{{c}}{{{latex_words(score)}}}")
        rules.append(rf"\cmidrule(lr){{{first}-{first + count - 1}}}")
        first += count
    yield " & ".join([*above, *padding]) + r" \\"
    yield " ".join(rules)
    yield " & ".join(["", *(f"${symbol(name)}$" for _, name in block), *padding]) + r" \\"
    yield r"\midrule"
    for row in rows:
        if row.observer.assessed is None:
            continue
        cells = [_cell(row, column, [one for one in rows if one.run == row.run]) for column in block]
        yield " & ".join([latex_words(row.text), *cells, *padding]) + r" \\"


def _cell(row: Row, column: Column, beside: Sequence[Row]) -> str:
    value = score_of(row, *column)
    if value is None:
        return "--"
    shown = score_text(column[0], value)
    of_all = [one for one in (score_of(other, *column) for other in beside) if one is not None]
    best = column[0].endswith("_rmse") and len(of_all) > 1 and value == min(of_all) < max(of_all)
    return rf"$\mathbf{{{latex_number(shown)}}}$" if best else f"${latex_number(shown)}$"
