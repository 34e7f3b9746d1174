"""A finding: one thing that an analysis says of an observer, declared once.

Table, JSON, comparison, claims, ``hgorun show`` and the reference in the documentation follow from the record::

    @finding("the decay rate of the slowest pole", unit="1/time")
    def slowest_rate(observer: Subject) -> float:
        poles = error_dynamics(observer.observer, observer.form).certificate.poles
        return float(-poles.real.max())

The function's name is the finding's. It returns a value or raises NoValue with the reason why there is none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any, Literal, TypeGuard

import numpy as np

from hgorun.analysis.subject import Subject
from hgorun.registry import Registry

# a number, a truth, text, an array, or a mapping of such by state or by name
Value = bool | float | str | np.ndarray | Mapping[str, Any]
Place = Literal["json", "table", "compare"]

# columns of a group stay together in the table, and groups come in this order; others follow
GROUPS = (
    "poles",
    "decay",
    "slopes",
    "theta",
    "delay",
    "period",
    "rate",
    "peaking",
    "noise, predicted",
    "noise, measured",
    "h2",
    "hinf",
    "excitation",
)
_number = count()


@dataclass(frozen=True)
class Remarked:
    """A value with sentences that stand below the table."""

    value: Value
    remarks: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """What is said of an observer, and how.

    Attributes
    ----------
    name : str
        Its key in JSON and in ``analysis('run/label', key)``.
    meaning : str
        A sentence for the reference; Markdown.
    of : callable
        Gives the value for an observer of a run, or raises NoValue.
    unit : str
        In the units of time and of the states: ``time``, ``1/time``, ``state``; empty for a mere number.
    group : str
        Of columns that stay together; empty: it stands alone.
    title : str
        Of the column: the name, if empty.
    places : tuple of {"json", "table", "compare"}
        Where it is said; ``compare`` puts it beside the metrics of ``compare --analyze``.
    optional : bool
        Left out where it has no value; else JSON has null, and the reason.
    applies : callable
        Whether an observer is asked for it at all.
    order : int
        In which it was declared.
    """

    name: str
    meaning: str
    of: Callable[[Subject], Value | Remarked]
    unit: str = ""
    group: str = ""
    title: str = ""
    places: tuple[Place, ...] = ("json", "table")
    optional: bool = False
    applies: Callable[[Subject], bool] = lambda _: True
    order: int = 0

    def __call__(self, observer: Subject) -> Value | Remarked:
        """The value for an observer of a run."""
        return self.of(observer)


def is_finding(thing: object) -> TypeGuard[Finding]:
    """Whether it is the record of a finding."""
    return isinstance(thing, Finding)


FINDINGS: Registry[Finding] = Registry(
    "finding",
    package="hgorun.analysis.findings",
    group="hgorun.findings",
    accepts=is_finding,
    expected="a function with the decorator hgorun.analysis.finding.finding",
)


def finding(
    meaning: str,
    *,
    unit: str = "",
    group: str = "",
    title: str = "",
    places: tuple[Place, ...] = ("json", "table"),
    optional: bool = False,
    applies: Callable[[Subject], bool] = lambda _: True,
) -> Callable[[Callable[[Subject], Value | Remarked]], Finding]:
    """Declare a function of an observer as a finding; see :class:`Finding` for the arguments."""

    def declared(function: Callable[[Subject], Value | Remarked]) -> Finding:
        name = function.__name__
        record = Finding(
            name=name,
            meaning=meaning,
            of=function,
            unit=unit,
            group=group or name,
            title=title or name,
            places=places,
            optional=optional,
            applies=applies,
            order=next(_number),
        )
        return FINDINGS.add(name, record)

    return declared


def in_order(findings: Mapping[str, Finding]) -> tuple[Finding, ...]:
    """By group, then as they were declared, file by file."""

    def place(one: Finding) -> tuple[int, str, int]:
        known = GROUPS.index(one.group) if one.group in GROUPS else len(GROUPS)
        return known, one.of.__module__, one.order

    return tuple(sorted(findings.values(), key=place))


def all_findings() -> tuple[Finding, ...]:
    """Every finding, built in or from another package."""
    return in_order(FINDINGS.all())
