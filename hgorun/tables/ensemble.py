"""Statistics of ensembles as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from hgorun.ensemble.collected.collected import Collected, levels, shown
from hgorun.ensemble.statistics.points import points
from hgorun.ensemble.statistics.statistics import Difference, Statistics, Summary, largest_errors, statistics
from hgorun.ensemble.statistics.unmoved import said_of_hf
from hgorun.result.metrics.base import all_metrics, unit_of
from hgorun.tables.axis_names import bracketed, names_of_points, short_axis, unit_of_axis
from hgorun.tables.layout import Name, apart, number, packed, wrapped
from hgorun.tables.rows import NEVER
from hgorun.tables.typeset import printable
from hgorun.tables.uncertain import mean_and_half, uncertain

NUMBERS = tuple(f.name for f in fields(Summary) if f.name not in ("n", "ci95"))
_INTERVALS = "±: 95 % interval of the mean, over members that are ok or inaccurate; sem: its standard error; "
_QUANTILES = "q05 to q95: quantiles over all members, in which a lost estimate counts as infinite"
_NOTE, _POOLED_NOTE = _INTERVALS + _QUANTILES, "mean: over members that are ok or inaccurate; " + _QUANTILES
NEVER_SAID = (
    "settling: never, where noise lifts the error above that part of its peak again and again, or it is still above at "
    "the end of the run, in at least half of the members"
)
_TOO_SMALL = "they count with the end of the run, or the last time that noise lifts them, so the mean is too small"
_MOST_OF_PAIR = 30  # columns of a label beside another one
_NAN = math.nan
_NOTHING = Summary(n=0, mean=_NAN, sem=_NAN, ci95=(_NAN, _NAN), median=_NAN, q05=_NAN, q25=_NAN, q75=_NAN, q95=_NAN)
_PAIRS = "paired differences of means with their 95 % intervals; *: p < 0.05 after Holm"


@dataclass(frozen=True)
class Compared:
    """An ensemble with what is said of it: of all its members, and of those at each point of some axes.

    Attributes
    ----------
    members : Collected
    whole : Statistics
    by : tuple of str
        Axes by which it is divided.
    points : tuple of Statistics
        Nothing where it is not divided.
    file : str or None
        Where it is stored.
    """

    members: Collected
    whole: Statistics
    by: tuple[str, ...] = ()
    points: tuple[Statistics, ...] = ()
    file: str | None = None

    @property
    def parts(self) -> tuple[Statistics, ...]:
        """What is tabulated: the points, or the whole."""
        return self.points or (self.whole,)


def compared(members: Collected, by: Sequence[str], metrics: Sequence[str] = (), file: str | None = None) -> Compared:
    """The statistics of an ensemble.

    Parameters
    ----------
    members : Collected
    by : sequence of str
        Axes by which it is divided; none: all members together.
    metrics : sequence of str
        Which; all by default, in the order of tables.
    """
    known = [name for name in all_metrics(closed=True) if name in members.metrics]
    names = tuple(metrics) or (*known, *(name for name in members.metrics if name not in known))
    divided = points(members, by) if by else ()
    parts = tuple(statistics(part, names, at) for at, part in divided)
    return Compared(members, statistics(members, names), tuple(by), parts, file)


def text(found: Sequence[Compared], *, pairs: bool = True) -> str:
    """Aligned tables, as wide as the terminal.

    Parameters
    ----------
    pairs : bool
        Whether differences between observers are told.
    """
    lines: list[str] = []
    for one in found:
        first, *others = summary(one)
        lines += [
            *([""] if lines else []),
            *wrapped(first),
            *(line for other in others for line in wrapped(other, "  ")),
        ]
        if not one.members.observers:
            lines += ["", "no observers"]
            continue
        lines += _by_point(one) if one.by else _whole(one, pairs=pairs)
        lines += [line for words in said_of_errors(one.members) for line in ("", *wrapped(words))]
    return "\n".join(lines)


def summary(one: Compared) -> list[str]:
    """What an ensemble is: its name and title, its members and axes, then who has lost members; a sentence each."""
    members = one.members
    count = f"{len(members)} members"
    if members.planned > len(members):
        count += f" of {members.planned}"
    axes = [
        f"{axis} {_span(levels(values))} {unit_of_axis(axis, members.units)}".rstrip()
        for axis, values in members.axes.items()
    ]
    lines = [": ".join(printable(part) for part in (members.name, members.title) if part), "; ".join([count, *axes])]
    for label, statuses in members.counts.items():
        others = ", ".join(f"{n} {status}" for status, n in statuses.items() if status != "ok")
        if others:
            lines.append(f"{printable(label)}: {others}")
    return [*lines, *filter(None, [caution(one)])]


def caution(one: Compared) -> str:
    """Why there are no intervals, and how to get some; nothing where members are independent draws."""
    pooled = list(dict.fromkeys(axis for part in one.parts for axis in part.pooled))
    shared = list(dict.fromkeys(axis for part in one.parts for axis in part.shared))
    if pooled:
        names = ", ".join(short_axis(axis, list(one.members.axes)) for axis in pooled)
        why = f"pooled over all values of {names}, which were chosen and not drawn"
    elif shared:
        names = ", ".join(short_axis(axis, list(one.members.axes)) for axis in shared)
        why = f"members share draws of {names}, so they are not independent"
    else:
        return ""
    advice = "compare --by AXIS has a row for each value of an axis, --at AXIS=VALUE only its members"
    return f"{why}: means without intervals, differences without p; {advice}"


def _span(values: Sequence[Any]) -> str:
    """The values of an axis in few words."""
    if len(values) <= 4:
        return ", ".join(map(shown, values))
    if all(isinstance(value, str) for value in values):
        return f"{shown(values[0])}, ... ({len(values)} values)"
    return f"{shown(values[0])} to {shown(values[-1])} ({len(values)} values)"


def _whole(one: Compared, *, pairs: bool) -> list[str]:
    lines: list[str] = []
    part = one.whole
    for metric in dict.fromkeys(metric for _, metric, _ in part.summaries):
        keys = [key for key in part.summaries if key[1] == metric]
        own = [known_of(part, *key) for key in keys]
        both = [mean_and_half_of(part, *key) for key in keys]
        columns = [["mean", *(mean for mean, _ in both)]]
        if part.independent:
            columns += [["±", *(half for _, half in both)], ["sem", *(_cell(s.sem) for s in own)]]
        for name in ("q05", "q25", "median", "q75", "q95"):
            columns.append([name, *(_cell(getattr(s, name)) for s in own)])
        names = [Name(f"{label} ", state) for label, _, state in keys]
        for block in packed(names, [[column] for column in columns], title=metric + _unit_of(metric, one)):
            lines += ["", *block]
    lines += [line for words in said_of_numbers(one) for line in ("", *wrapped(printable(words)))]
    lines += ["", *wrapped(_NOTE if part.independent else _POOLED_NOTE)]
    if part.differences and pairs:
        columns_of: dict[tuple[str, str], list[str]] = {}
        rows = [_named(*key, one) for key in dict.fromkeys((d.metric, d.state) for d in part.differences)]
        observers = one.members.observers
        short = dict(zip(observers, apart([Name(label) for label in observers], _MOST_OF_PAIR), strict=True))
        for d in part.differences:
            decided = part.has_none(d.metric, d.state, d.a, d.b)
            columns_of.setdefault((d.a, d.b), []).append("- " if decided else _difference(d))
        for block in packed(rows, [[[f"{short[a]} - {short[b]}", *cells]] for (a, b), cells in columns_of.items()]):
            lines += ["", *block]
        lines += ["", *wrapped(_PAIRS if part.independent else "differences of means")]
    return lines


def known_of(part: Statistics, label: str, metric: str, state: str) -> Summary:
    """What is tabulated of a metric: nothing of a time that has none in at least half of the members."""
    return _NOTHING if part.has_none(metric, state, label) else part.summaries[label, metric, state]


def mean_and_half_of(part: Statistics, label: str, metric: str, state: str) -> tuple[str, str]:
    """A mean and half its interval, as tables have them."""
    known = known_of(part, label, metric, state)
    mean, half = mean_and_half(known.mean, known.half)
    return NEVER if part.has_none(metric, state, label) else mean, half


def _named(metric: str, state: str, one: Compared) -> Name:
    """A metric of a state, with its unit where that is known."""
    return Name(f"{metric} ", state, bracketed(unit_of(metric, state, one.members.units)))


def _unit_of(metric: str, one: Compared) -> str:
    """The unit of a metric, where it is known and that of all states."""
    found = {unit_of(metric, state, one.members.units) for state in one.members.states}
    return bracketed(found.pop()) if len(found) == 1 else ""


def said_of_numbers(one: Compared) -> list[str]:
    """What ``never`` means, which other times have means that are too small, and why hf is 0; of what there is."""
    most: dict[tuple[str, str, str], tuple[int, int]] = {}
    for part in one.parts:
        for key, count in part.cut.items():
            most[key] = max(most.get(key, (0, 0)), (count, part.members))
    ordered = {key: most[key] for key in one.whole.summaries if key in most}
    who = [f"{m} of {label} {state}: {n} of {size}" for (label, m, state), (n, size) in ordered.items()]
    said = [NEVER_SAID] if any(part.never for part in one.parts) else []
    if who:
        where = ", in the row with most of them" if one.points else ""
        said.append(f"{', '.join(who)} members never settle{where}; {_TOO_SMALL}")
    said.append(said_of_hf(one.members, {metric for _, metric, _ in one.whole.summaries}))
    return list(filter(None, said))


def said_of_errors(members: Collected) -> list[str]:
    """The integration error of those that were checked, or of all; nothing where none is known."""
    count, largest = largest_errors(members)
    errors = ", ".join(f"{printable(label)} {error:.1e}" for label, error in largest.items())
    if count < 2:
        return [f"integration error of the member checked: {errors}"] if count else []
    who = "of all members" if count == len(members) else f"of the {count} members checked"
    return [f"integration error, the largest {who}: {errors}"]


def _cell(value: float) -> str:
    return "-" if math.isnan(value) else number(value)


def _difference(d: Difference) -> str:
    if math.isnan(d.mean):
        return "-"
    return uncertain(d.mean, d.half) + ("*" if d.significant else " ")


def _by_point(one: Compared) -> list[str]:
    lines: list[str] = []
    above, rows = names_of_points([part.at for part in one.points], one.by, one.members.units)
    lines += ["", *wrapped(f"rows: {above}")] if above else []
    observers = one.members.observers
    for metric, state in dict.fromkeys((metric, state) for _, metric, state in one.whole.summaries):
        columns = [[label, *(_mean_at(part, label, metric, state) for part in one.points)] for label in observers]
        for block in packed(rows, [[column] for column in columns], title=_named(metric, state, one).whole):
            lines += ["", *block]
    lines += [line for words in said_of_numbers(one) for line in ("", *wrapped(printable(words)))]
    what = "mean ± 95 % interval" if any(part.independent for part in one.parts) else "mean"
    return [*lines, "", *wrapped(f"{what}; in brackets the number of members without numbers")]


def _mean_at(part: Statistics, label: str, metric: str, state: str) -> str:
    summary, failed = part.summaries[label, metric, state], part.failed(label)
    mean = "-" if math.isnan(summary.mean) else uncertain(summary.mean, summary.half)
    if part.has_none(metric, state, label):
        mean = NEVER
    return f"{mean} ({failed})" if failed else mean


def distance(value: float, ideal: float) -> float:
    """How far a metric is from its best value: a ratio's logarithm, or the value itself where zero is best."""
    return abs(math.log(value / ideal)) if ideal and value > 0 else value


def best(part: Statistics, metric: str, state: str) -> str | None:
    """The observer with the best mean, if it is significantly better than all others and fails no more often."""
    own = {label: s.mean for (label, m, s_), s in part.summaries.items() if (m, s_) == (metric, state)}
    finite = {label: mean for label, mean in own.items() if math.isfinite(mean)}
    if not finite or len(own) < 2 or part.has_none(metric, state):
        return None
    known = all_metrics(closed=True).get(metric)
    ideal = known.ideal if known else 0.0
    first = min(finite, key=lambda label: distance(finite[label], ideal))
    against = [d for d in part.differences if (d.metric, d.state) == (metric, state) and first in (d.a, d.b)]
    rivals = [label for label in own if label != first]
    fails = part.failed(first)
    if all(d.significant for d in against) and all(part.failed(label) >= fails for label in rivals):
        return first
    return None
