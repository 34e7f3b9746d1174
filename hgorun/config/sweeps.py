"""The blocks of a sweep file: a base configuration, axes along which it is varied, and what is kept of every member."""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, WithJsonSchema

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.types import Block, Interval, NonEmpty, NonNegative, Number, describe, word_or
from hgorun.errors import Problem

MOST_MEMBERS = 10**9
_WHOLE = re.compile(r"[+-]?[0-9]{1,300}")
_DEVIATIONS = 40  # from the mean: no draw of a normal distribution is farther away

Count = Annotated[int, Field(ge=1, le=MOST_MEMBERS, strict=True)]
Value: TypeAlias = bool | int | float | str
_Ends = TypeVar("_Ends", tuple[float, float, int], tuple[float, float])


def _value(value: object) -> Value:
    """A value of a list: a finite number or text; text that is an expression of numbers is a number."""
    if not isinstance(value, (bool, int, float, str)):
        raise ValueError(f"expected numbers or text, found {describe(value)}")
    if isinstance(value, (int, float)) and not _is_finite(value):
        raise ValueError(f"expected finite numbers, found {describe(value)}")
    if isinstance(value, str) and _WHOLE.fullmatch(value):
        return int(value)
    if isinstance(value, str) and not value.isidentifier():
        try:
            return parse(value, names=()).number()
        except ExpressionError:
            return value
    return value


def _is_finite(value: float) -> bool:
    """Whether it is a finite number that a float can hold, as not every integer is."""
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


class ListAxis(Block):
    """Values one by one; written as a plain list."""

    values: tuple[Annotated[Value, BeforeValidator(_value)], ...]

    @property
    def count(self) -> int:
        """How many values there are."""
        return len(self.values)


def _positive(ends: tuple[float, float, int]) -> tuple[float, float, int]:
    if not min(ends[:2]) > 0:
        raise ValueError(f"a logarithmic axis lies between numbers above 0, found {ends[0]:g} and {ends[1]:g}")
    ratio = ends[1] / ends[0]
    if not (math.isfinite(ratio) and ratio > 0):
        raise ValueError(f"the ratio of {ends[1]:g} to {ends[0]:g} is not a finite number above 0")
    return ends


def _near(ends: _Ends) -> _Ends:
    """Ends whose difference is a number: all values between them follow from it."""
    if not math.isfinite(ends[1] - ends[0]):
        raise ValueError(f"the difference of {ends[0]:g} and {ends[1]:g} is not a finite number")
    return ends


def _drawable(normal: tuple[float, float]) -> tuple[float, float]:
    if not math.isfinite(abs(normal[0]) + _DEVIATIONS * normal[1]):
        raise ValueError(f"draws with mean {normal[0]:g} and standard deviation {normal[1]:g} are not all finite")
    return normal


class LinearAxis(Block):
    """Evenly spaced values, both ends among them."""

    linear: Annotated[tuple[Number, Number, Count], AfterValidator(_near)] = Field(
        description="[first, last, how many]"
    )

    @property
    def ends(self) -> tuple[float, float]:
        """The first and the last value."""
        return self.linear[:2]

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.linear[2]


class LogAxis(Block):
    """Values with one ratio between neighbours, both ends among them."""

    log: Annotated[tuple[Number, Number, Count], AfterValidator(_positive)] = Field(
        description="[first, last, how many], with ends above 0"
    )

    @property
    def ends(self) -> tuple[float, float]:
        """The first and the last value."""
        return self.log[:2]

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.log[2]


class UniformAxis(Block):
    """Values drawn evenly from an interval."""

    uniform: Annotated[Interval, AfterValidator(_near)] = Field(description="[low, high]")
    draws: Count = Field(description="how many; the first ones are the same, whatever the number")

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.draws


class NormalAxis(Block):
    """Values drawn from a normal distribution."""

    normal: Annotated[tuple[Number, NonNegative], AfterValidator(_drawable)] = Field(
        description="[mean, standard deviation]"
    )
    draws: Count = Field(description="how many; the first ones are the same, whatever the number")

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.draws


class SeedAxis(Block):
    """Seeds: that of the base, and the integers that follow it."""

    count: Count = Field(description="how many")


AnyAxis: TypeAlias = ListAxis | LinearAxis | LogAxis | UniformAxis | NormalAxis | SeedAxis
_KINDS = ("linear", "log", "uniform", "normal", "count")
_NO_SEEDS = ("linear", "log", "uniform", "normal")
_RIGHT = "[a, b, ...], {linear: [a, b, n]}, {log: [a, b, n]}, {uniform: [a, b], draws: n}, {normal: [m, s], draws: n}"


def _written(value: object) -> Any:
    """A plain list is a mapping of one key, so that each kind of axis is a block."""
    if isinstance(value, Block):
        return value
    if isinstance(value, (list, tuple, range)):
        if not value:
            raise ValueError("expected at least one value, found an empty list")
        return {"values": list(value)}
    if not isinstance(value, dict) or sum(kind in value for kind in _KINDS) != 1:
        raise ValueError(f"expected {_RIGHT} or, for seed, {{count: n}}; found {_found(value)}")
    return value


def _found(value: object) -> str:
    return (
        f"a mapping with the keys {', '.join(map(str, value)) or 'none'}"
        if isinstance(value, dict)
        else (describe(value))
    )


def _kind(value: object) -> str:
    if isinstance(value, Block):
        return "values" if isinstance(value, ListAxis) else next(k for k in _KINDS if k in type(value).model_fields)
    return next((kind for kind in _KINDS if isinstance(value, dict) and kind in value), "values")


# the names of the tags are in pydantic's locations, and must not be taken for keys: they hold a space
_LIST_SCHEMA = {
    "type": "array",
    "items": {"type": ["number", "string", "boolean"]},
    "minItems": 1,
    "description": "the values one by one",
}
Axis = Annotated[
    Annotated[
        Annotated[ListAxis, Tag("of values"), WithJsonSchema(_LIST_SCHEMA)]
        | Annotated[LinearAxis, Tag("of linear")]
        | Annotated[LogAxis, Tag("of log")]
        | Annotated[UniformAxis, Tag("of uniform")]
        | Annotated[NormalAxis, Tag("of normal")]
        | Annotated[SeedAxis, Tag("of count")],
        Discriminator(lambda value: f"of {_kind(value)}"),
    ],
    BeforeValidator(_written),
]


class Worst(Block):
    """Trajectories of the members with the largest values of a metric."""

    worst: Count = Field(description="how many members")
    by: str = Field(description="the metric")
    observer: str | None = Field(default=None, description="of this observer (default: the largest of all)")
    state: str | None = Field(default=None, description="of this state (default: the largest of all)")


class Every(Block):
    """Trajectories of members at regular places."""

    every: Count = Field(description="member 0, and each so many after it")


def _some_kind(value: object) -> str:
    if isinstance(value, (Every, dict)):
        return "some every" if isinstance(value, Every) or "every" in value else "some worst"
    return "some worst" if isinstance(value, Worst) else "some word"


_Word = Annotated[Literal["none", "all"], Field(description="of no member, or of all of them")]
Trajectories = Annotated[
    Annotated[_Word, Tag("some word")] | Annotated[Worst, Tag("some worst")] | Annotated[Every, Tag("some every")],
    Discriminator(_some_kind),
    word_or(("none", "all"), (dict, Worst, Every), "{worst: 5, by: rmse}", "{every: 100}"),
]


class Keep(Block):
    """What is kept of every member."""

    metrics: Annotated[tuple[str, ...], NonEmpty] | None = Field(
        default=None, description="names of metrics (default: all)"
    )
    quantities: tuple[str, ...] = Field(
        default=(), description="what else is measured, as in claims: std('FHGO', x2), rmse('FHGO', x2, 0, 5), ..."
    )
    trajectories: Trajectories = Field(
        default="none", description="none, all, {worst: 5, by: rmse, observer: F, state: x2} or {every: 100}"
    )


Combine = Literal["product", "zip", "sobol"]


def _counted(axes: Any) -> Any:
    """How many seeds there are is told by the key ``count`` of the axis ``seed``."""
    for name in ("seed", "seeds") if isinstance(axes, dict) else ():
        axis = axes.get(name)
        count = next(iter(axis.values())) if isinstance(axis, dict) and len(axis) == 1 else axis
        if isinstance(axis, dict) and any(kind in axis for kind in _NO_SEEDS):  # whose values are no whole numbers
            ends = axis.get("linear") or axis.get("log")
            count = ends[-1] if isinstance(ends, list) and ends else axis.get("draws")
        right = name == "seed" and isinstance(axis, dict) and "count" in axis
        if isinstance(count, int) and not isinstance(count, bool) and not right:
            alone = f"; the seed {count} alone is `seed: [{count}]`" if name == "seed" and axis == count else ""
            raise Problem((name,), f"{count} seeds are the axis `seed: {{count: {count}}}`{alone}")
        if name == "seeds" and axis is not None:
            raise Problem((name,), "the axis of seeds is called `seed`")
    return axes


def _some(axes: dict[str, AnyAxis]) -> dict[str, AnyAxis]:
    if not axes:
        raise ValueError("it names nothing to vary")
    return axes


class SweepBlocks(Block):
    """What an ensemble is beside its base: axes, and what is kept."""

    axes: Annotated[dict[str, Axis], BeforeValidator(_counted), AfterValidator(_some)] = Field(
        description="path: values, with a path as after --set; observers.*.theta means every observer that can have it"
    )
    combine: Combine = Field(
        default="product",
        description="product: every combination; zip: first with first, and so on; sobol: evenly spread points",
    )
    keep: Keep = Field(default_factory=Keep, description="what is kept of every member")


def _base(value: object) -> Any:
    if not isinstance(value, (str, dict)):
        raise ValueError(f"expected the name of a file or a configuration, found {describe(value)}")
    return value


class SweepFile(SweepBlocks):
    """A sweep file: a base configuration, axes along which it is varied, and what is kept of every member."""

    title: str = Field(default="", description="free text, above figures and in lists")
    base: Annotated[str | dict[str, Any], BeforeValidator(_base)] = Field(
        description="the configuration that members vary: a file, as seen from this one, or written here"
    )
    run: str | None = Field(default=None, description="which run of the base, where it has several: a single one")
