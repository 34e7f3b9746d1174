"""The block ``measurement`` of a configuration: how each output reaches the observers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, SerializeAsAny, model_validator
from pydantic_core import PydanticCustomError

from hgorun.config.expressions import ExpressionError, nearest, parse
from hgorun.config.separators import misread
from hgorun.config.types import Block, ExpressionText, Name, NonEmpty, NonNegative, Number, Positive, describe
from hgorun.noise.base import NOISE, Noise


class Periodic(Block):
    """Samples at start + offset + k period, each moved by jitter or lost by chance."""

    period: Positive = Field(description="time between two samples")
    offset: NonNegative = Field(default=0.0, description="time from the start of the phase to its first sample")
    jitter: NonNegative = Field(default=0.0, description="uniform on +-jitter")
    dropout: Annotated[NonNegative, Field(le=1)] = Field(default=0.0, description="probability that a sample is lost")


class Times(Block):
    """Samples at the given times."""

    times: Annotated[tuple[Number, ...], NonEmpty] = Field(description="times of the samples, increasing")

    @model_validator(mode="after")
    def _increasing(self) -> Times:
        for a, b in zip(self.times, self.times[1:], strict=False):
            if not b > a:
                raise ValueError(f"times must increase, found {a:g} before {b:g}")
        return self


class Steps(Block):
    """Samples at t_0 = start, t_(k+1) = t_k + steps(k)."""

    steps: ExpressionText = Field(description="expression of k, positive")


def _sampling(value: Any) -> Any:
    """Tell the three forms apart by their main key, so that errors speak of one of them."""
    if value == "continuous" or isinstance(value, Block):
        return value
    if not isinstance(value, dict):
        meant = (
            f": write {{period: {value}}}" if isinstance(value, (int, float)) and not isinstance(value, bool) else ""
        )
        meant += (isinstance(value, str) and (near := nearest(value, ("continuous",))) and f".{near}") or ""
        found_one = f"found {describe(value)}{meant}"
        raise ValueError(f"expected continuous or a mapping with period, times or steps, {found_one}")
    kinds: dict[str, type[Block]] = {"period": Periodic, "times": Times, "steps": Steps}
    found = [key for key in kinds if key in value]
    if len(found) != 1:
        other = ", ".join(map(str, value))[:100]
        near = "" if found else next(filter(None, (nearest(str(key), kinds) for key in value)), "")
        beside = [key for key in value if key in Availability.model_fields]
        if beside and not found:
            near = f" `{beside[0]}` stands beside `sampling`, not in it"
        raise ValueError(
            "expected exactly one of period, times and steps"
            + (f", found {' and '.join(found)}" if found else f", found {other or 'none'}{near and '.' + near}")
        )
    return kinds[found[0]].model_validate(value)


Sampling = Annotated[Literal["continuous"] | Periodic | Times | Steps, BeforeValidator(_sampling)]


_ALIASES = {"gaussian": ("normal", "white", "gauss"), "sinusoids": ("sine", "sin", "cosine", "harmonic", "sinus")}


def _hint(name: str, known: Sequence[str]) -> str:
    """What may have been meant, by other names of the same, too."""
    meant = [kind for kind, names in _ALIASES.items() if name.lower() in names and kind in known]
    return f" Did you mean `{meant[0]}`?" if meant else nearest(name, known)


def _noise(value: Any) -> Any:
    """One item of noise, checked by the class that its type names."""
    if isinstance(value, Noise):
        return value
    if not isinstance(value, dict):
        remedy = misread(value) if isinstance(value, str) else ""
        found = f"{describe(value)}{remedy and f'; {remedy}'}"
        raise ValueError(f"expected a mapping with type: {', '.join(NOISE.names())}; found {found}")
    if "type" not in value:
        raise ValueError(f"type is missing; one of {', '.join(NOISE.names())}")
    try:
        cls = NOISE.find(str(value["type"]))
    except KeyError:
        known = NOISE.names()
        raise PydanticCustomError(
            "unknown_type",
            "no noise is called {name}.{hint} Known: {known}",
            {
                "key": "type",
                "name": describe(value["type"]),
                "hint": _hint(str(value["type"]), known),
                "known": ", ".join(known),
            },
        ) from None
    return cls.model_validate(value)


NoiseItem = Annotated[SerializeAsAny[Noise], BeforeValidator(_noise)]


def _not_negative(text: str) -> str:
    """Of a delay that is a number; one that is a function of time is known along the run."""
    try:
        found = parse(text).number()
    except ExpressionError:  # it has names
        return text
    if not found >= 0:
        raise ValueError(f"the delay must be a number >= 0, found {found:g}")
    return text


class Availability(Block):
    """How an output reaches the observers. Omitted keys are taken from the enclosing block."""

    sampling: Sampling | None = Field(default=None, description="continuous, or when samples arrive")
    delay: Annotated[ExpressionText, AfterValidator(_not_negative)] | None = Field(
        default=None, description="number or expression of t, >= 0"
    )
    noise: tuple[NoiseItem, ...] | None = Field(default=None, description="summed")
    mode: Literal["additive", "multiplicative"] | None = Field(default=None, description="y + v or y (1 + v)")


class Phase(Availability):
    """A stretch of time with its own availability."""

    until: Number = Field(description="end of the phase")
    outputs: dict[Name, Availability] = Field(default_factory=dict, description="overrides for single outputs")


class Measurement(Availability):
    """When outputs are measured, how late, and with what noise: for all outputs, for single ones, and in phases."""

    outputs: dict[Name, Availability] = Field(default_factory=dict, description="overrides for single outputs")
    phases: tuple[Phase, ...] = Field(default=(), description="one after the other in time")


def noise_blocks(measurement: Measurement) -> Iterator[tuple[str, tuple[Noise, ...]]]:
    """Where noise is given in a configuration, of all outputs and of single ones: paths, and what stands there."""
    blocks: list[tuple[str, Measurement | Phase]] = [("measurement", measurement)]
    blocks += [(f"measurement.phases.{i}", phase) for i, phase in enumerate(measurement.phases)]
    for path, block in blocks:
        if block.noise is not None:
            yield f"{path}.noise", block.noise
        for name, output in block.outputs.items():
            if output.noise is not None:
                yield f"{path}.outputs.{name}.noise", output.noise
