"""The header of a text file: names of columns and their units, on lines of their own or in comments."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from hgorun.config.data import Csv
from hgorun.data.csv.missing import missing_texts
from hgorun.data.csv.splitting import cells_of
from hgorun.data.csv.units_row import are_units, is_value, may_state_units, states_units, tells_processing
from hgorun.errors import ConfigError

_FEW = 8  # columns whose names a message writes


@dataclass(frozen=True)
class Line:
    """A line of the file, with its number."""

    number: int
    text: str


def header_of(
    rows: Sequence[tuple[Line, list[str]]],
    comments: Sequence[Line],
    separator: str,
    told: Csv,
    path: Path,
    clocks: Mapping[str, Collection[str | None]],
) -> tuple[list[str], list[str], Sequence[tuple[Line, list[str]]]]:
    """The names of the columns, their units, empty where these are not stated, and the rows of values.

    Parameters
    ----------
    rows : sequence of (Line, list of str)
        The first ones with their cells, from the line of names on, if there is one.
    comments : sequence of Line
        Above and between them.

    Raises
    ------
    ConfigError
        When there are no names, no values, or no units where they are told.
    """
    header, names = rows[0]
    body = rows[1:]
    units: list[str] = []
    if all(is_value(name) for name in names):
        above = _in_comment(comments, header.number, separator, len(names), told.comment, clocks)
        if above is None:
            message = (
                f"expected a line with the names of the columns, found numbers: {header.text[:60]}; write such a line "
                f"above them{_such_as(len(names), separator)}: columns are taken by their names, not by their places"
            )
            raise ConfigError(message, file=str(path), line=header.number)
        (names, units), body = above, rows
    elif told.units_row is None and body:
        between = [one for one in comments if header.number < one.number < body[0][0].number]
        of_units = [_bare(one, told.comment, separator) for one in between]
        units = next((row for row in of_units if len(row) == len(names) and are_units(row)), [])
    if told.units_row or (told.units_row is None and not units and _states_units(body, names, told, clocks)):
        units = list(body[0][1]) if body else []
        if any(unit.strip() != "1" and is_value(unit) for unit in units):
            message = f"data.csv.units_row: expected the units of the columns, found {body[0][0].text[:60]}"
            raise ConfigError(message, file=str(path), line=body[0][0].number)
        body = body[1:]
    if units and body and tells_processing(body[0][1]):
        body = body[1:]
    if not body:
        raise ConfigError("a header without values below it", file=str(path), line=header.number)
    return names, units, body


def _states_units(
    body: Sequence[tuple[Line, list[str]]],
    names: Sequence[str],
    told: Csv,
    clocks: Mapping[str, Collection[str | None]],
) -> bool:
    """Whether the first row below the names is one of units."""
    if not body or not may_state_units(body[0][1], names, missing_texts(told), clocks):
        return False
    return states_units(body[0][1], names, clocks)


def _in_comment(
    comments: Sequence[Line], line: int, separator: str, width: int, sign: str, clocks: Collection[str]
) -> tuple[list[str], list[str]] | None:
    """The names of the columns in the last comment above the numbers, and their units if it states these below them.

    Names may be units, too, as t and h are: of two such lines the upper one has the names, unless only the lower one
    has a column of time stamps. Where neither has one, other comments may stand below the names: the lowest line that
    has such a column has these.
    """
    rows = [_bare(one, sign, separator) for one in comments if one.number < line]
    may_be = [row if len(row) == width and not any(map(is_value, row)) else [] for row in rows]
    last, above = [*reversed(may_be[-2:]), [], []][:2]
    named = [bool({name.strip() for name in row} & {*clocks}) for row in may_be]
    if any(named) and not any(named[-2:] if last and above and are_units(last) else named[-1:] if last else ()):
        place = max(k for k, has in enumerate(named) if has)
        below = next((row for row in may_be[place + 1 :][:1] if row and are_units(row)), [])
        return may_be[place], below
    if not last:
        return None
    if not above or not are_units(last):
        return last, []
    return (last, []) if are_units(above) and named[-2:] == [False, True] else (above, last)


def _bare(comment: Line, sign: str, separator: str) -> list[str]:
    """The cells of a comment without its sign."""
    return cells_of(comment.text.lstrip().removeprefix(sign).strip(), separator)


def _such_as(columns: int, separator: str) -> str:
    """Names of that many columns, as an example; of a table that is too wide none."""
    if columns > _FEW or not separator.isprintable():
        return f", of {columns} names"
    return ", such as " + separator.join(["t", *(f"y{i}" for i in range(1, columns))])


def require_no_row_inside(
    inside: Sequence[Line], header: tuple[Line, Sequence[str]], separator: str, path: Path
) -> None:
    """Refuse a header whose quote takes in rows.

    Raises
    ------
    ConfigError
    """
    line, names = header
    if rows := [one.number for one in inside if _looks_like_a_row(one.text, separator, len(names))]:
        last = inside[-1].number
        message = f"a quote that opens in this header closes on line {last}, and line {rows[0]} in it looks like a row"
        raise ConfigError(message, file=str(path), line=line.number)


def _looks_like_a_row(line: str, separator: str, width: int) -> bool:
    """Whether a line has as many cells as the header, or one more, and a number or a date among them."""
    cells = cells_of(line, separator)
    return len(cells) in (width, width + 1) and any(map(is_value, cells))
