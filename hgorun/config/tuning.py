"""The block ``tune``: which gains are sought, for what, over which seeds, and how much may be tried."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, WithJsonSchema, model_validator

from hgorun.config.types import Block, NonEmpty, Number, describe
from hgorun.errors import Problem

MOST_GAINS = 6
_AT_AN_END = 0.02  # of a range, in the scale in which it is sought: what is nearer to an end of it is at the end
_DECADE = 10.0


class Range(Block):
    """Between which values a gain is sought, evenly on a linear or a logarithmic scale."""

    written_as = "{log: [low, high]} or {linear: [low, high]}"

    log: tuple[Number, Number] | None = Field(default=None, description="[low, high], both > 0")
    linear: tuple[Number, Number] | None = Field(default=None, description="[low, high]")

    @model_validator(mode="after")
    def _one(self) -> Range:
        if (self.log is None) == (self.linear is None):
            raise ValueError("give exactly one of log and linear")
        low, high = self.ends
        if not low < high:
            raise ValueError(f"expected [low, high] with low < high, found [{low:g}, {high:g}]")
        if self.log is not None and not low > 0:
            raise ValueError(f"a logarithmic range needs numbers > 0, found [{low:g}, {high:g}]")
        wide = high / low if self.log is not None else high - low
        if not math.isfinite(wide):
            raise ValueError(f"the range is wider than numbers can tell, found [{low:g}, {high:g}]")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value."""
        return self.log or self.linear or (0.0, 0.0)

    def at(self, place: np.ndarray | float) -> np.ndarray:
        """The values at places between 0 and 1: the ends, and what lies between them."""
        low, high = self.ends
        value = low * (high / low) ** place if self.log is not None else low + (high - low) * place
        return np.asarray(np.clip(value, low, high))

    def end_at(self, value: float) -> str | None:
        """Which end a value is at, ``lower`` or ``upper``, beyond which better ones may lie."""
        first, last = self.at(np.array([_AT_AN_END, 1 - _AT_AN_END]))
        if value <= first:
            return "lower"
        return "upper" if value >= last else None

    def beyond(self, end: str, farther: float) -> Range:
        """The same with one end farther out, on the same side of zero.

        Parameters
        ----------
        end : str
            ``lower`` or ``upper``.
        farther : float
            By how many decades, or by how many times the width of a linear range.

        Raises
        ------
        ValueError
            When numbers do not reach so far.
        """
        low, high = self.ends
        if self.log is not None:
            wide = _DECADE**farther
            return Range(log=(low / wide, high) if end == "lower" else (low, high * wide))
        wide = farther * (high - low)
        if end == "lower":
            return Range(linear=(low / _DECADE if 0 < low <= wide else low - wide, high))
        return Range(linear=(low, high / _DECADE if -wide <= high < 0 else high + wide))

    def __str__(self) -> str:
        """As it is written in a file."""
        low, high = self.ends
        return f"{{{'log' if self.log is not None else 'linear'}: [{low:g}, {high:g}]}}"


def _texts(value: Any) -> Any:
    """Quantities as texts; inside brackets YAML cuts ``hf(F, x2)`` at its comma, which is mended here."""
    given = (value,) if isinstance(value, str) else value
    if not isinstance(given, (list, tuple)):
        raise ValueError(f"expected a quantity such as hf(FHGO, x2), or a list of two, found {describe(value)}")
    found: list[str] = []
    for part in given:
        if found and _is_open(found[-1]):
            found[-1] += f", {part}"
        elif isinstance(part, str):
            found.append(part)
        else:
            raise ValueError(f"expected quantities such as hf(FHGO, x2), found {describe(part)}")
    return tuple(found)


def _is_open(text: str) -> bool:
    """Whether a bracket is not closed."""
    return text.count("(") > text.count(")")


def _mended(block: Any, name: str) -> Any:
    """A block in braces, where YAML has cut a quantity at its commas: the rest of it are keys without a value."""
    if not isinstance(block, dict) or not isinstance(block.get(name), str):
        return block
    text, rest = block[name], dict(block)
    for key, part in block.items():
        if part is None and _is_open(text):
            text += f", {key}"
            del rest[key]
    return rest | {name: text}


def _whole(value: Any) -> Any:
    """A bound, its quantity mended."""
    return _mended(value, "value")


_TEXTS_SCHEMA = {"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}, "minItems": 1}]}
# for editors: in braces, the rest of a quantity that YAML cuts at its comma is a key without a value
_CUT = ConfigDict(json_schema_extra={"patternProperties": {r"\)$": {"type": "null"}}})


class Bound(Block):
    """What has to hold besides."""

    model_config = _CUT

    value: str = Field(description="an expression of quantities, such as peak(FHGO, x2)")
    below: Number | None = Field(default=None, description="its mean over the seeds has to be below")
    above: Number | None = Field(default=None, description="its mean over the seeds has to be above")

    @model_validator(mode="after")
    def _one(self) -> Bound:
        if (self.below is None) == (self.above is None):
            raise ValueError("give exactly one of below and above")
        return self


_DEFAULT, _FEW = 2000, 2  # runs for so many gains
_ONE_OF_A_LOG = 200  # runs for one gain on recorded data: a scan of 64, and what a simplex takes
_FOR_A_SEED = 8  # runs for each of the seeds, at least


class Tune(Block):
    """Gains are sought that minimise one quantity, or the front of two."""

    model_config = _CUT

    gains: dict[str, Range] = Field(
        description="path: range, with a path as after --set; observers.*.theta: of every observer that can have it"
    )
    minimise: Annotated[
        tuple[str, ...], BeforeValidator(_texts), NonEmpty, Field(max_length=2), WithJsonSchema(_TEXTS_SCHEMA)
    ] = Field(
        description="one quantity or two, as in claims: hf(FHGO, x2); hf(*, x2) where several observers are tuned"
    )
    subject: tuple[Annotated[Bound, BeforeValidator(_whole)], ...] = Field(
        default=(), description="what has to hold besides"
    )
    seeds: Annotated[int, Field(ge=1, le=10_000, strict=True)] = Field(
        default=20, description="over how many seeds a quantity is averaged"
    )
    held_out: Annotated[int, Field(ge=2, le=10_000, strict=True)] = Field(
        default=50, description="further seeds, for the numbers that are reported"
    )
    budget: Annotated[int, Field(ge=20, le=10_000_000, strict=True)] | None = Field(
        default=None,
        description="runs that the search of each observer may take; by default 2000, and twice as many for every gain "
        "beyond two; on recorded data 200 for one gain",
    )

    @model_validator(mode="before")
    @classmethod
    def _goal(cls, value: Any) -> Any:
        return _mended(value, "minimise")

    @model_validator(mode="after")
    def _some(self) -> Tune:
        if not self.gains:
            raise ValueError(f"expected 1 to {MOST_GAINS} gains, found 0")
        return self

    def require_enough(self) -> None:
        """Refuse a budget that is too small for the seeds; recorded data have none.

        Raises
        ------
        Problem
        """
        least = _FOR_A_SEED * self.seeds
        if self.budget is not None and self.budget < least:
            message = f"a budget of {self.budget} runs is too small for {self.seeds} seeds: {least} at least"
            raise Problem(("tune", "budget"), message)

    def runs(self, gains: int, *, recorded: bool = False) -> int:
        """The budget for so many gains of an observer, as given or as many runs as they need.

        A grid gets finer in every gain: with 2000 runs the best of four gains is within 8 % of that of brute force,
        with 8000 it is better. Recorded data have no seeds, and a simplex ends a search by itself, so that of one gain
        only the scan would take more.
        """
        if self.budget is not None:
            return self.budget
        if recorded and gains == 1:
            return _ONE_OF_A_LOG
        return max(_DEFAULT << max(gains - _FEW, 0), _FOR_A_SEED * self.seeds)


def require_few(count: int) -> None:
    """Refuse more gains of a single search than it can find.

    Raises
    ------
    Problem
    """
    if count > MOST_GAINS:
        raise Problem(("tune", "gains"), f"expected 1 to {MOST_GAINS} gains of an observer, found {count}")


class TuneFile(Block):
    """A file of its own for ``tune``."""

    title: str = ""
    base: str = Field(description="the configuration whose gains are tuned, a path relative to this file")
    run: str | None = Field(default=None, description="which run of the base, where it has several")
    tune: Tune
