"""The blocks of a configuration. Each class is one mapping of the YAML file; its fields are the keys."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from hgorun.config.controller import Controller
from hgorun.config.data import Data
from hgorun.config.study import Claim, Figure
from hgorun.config.time_units import run_unit
from hgorun.config.tuning import Tune
from hgorun.config.types import (
    NUMBER_SCHEMA,
    SEEDS,
    Block,
    Number,
    Positive,
    Window,
    describe,
    number,
)
from hgorun.errors import Problem

GIB = 2.0**30


class Time(Block):
    """Horizon and output grid: start, start + output_step, ..., the last point <= end."""

    start: Number = Field(default=0.0, description="start of the run")
    end: Number = Field(description="end of the run")
    output_step: Positive = Field(description="spacing of the output grid")
    unit: Annotated[str, AfterValidator(run_unit)] = Field(default="s", description="unit of time: s, min, h, d, ...")
    max_memory: Positive = Field(
        default=2 * GIB, description="bytes allowed for output, for samples and for delay history (default 2 GiB)"
    )

    @model_validator(mode="after")
    def _order(self) -> Time:
        if not self.end > self.start:
            raise Problem(("end",), f"end must be after start, found end {self.end:g}, start {self.start:g}")
        return self

    @property
    def from_zero(self) -> Time:
        """The same horizon, counted from its start."""
        return self.model_copy(update={"start": 0.0, "end": self.end - self.start}) if self.start else self


def _step(value: object) -> Any:
    if value == "auto":
        return value
    step = number(value)
    if not step > 0:
        raise ValueError(f"expected auto or a number > 0, found {describe(value)}")
    return step


Method = Literal["euler", "rk4", "dopri5", "rodas5p"]


class Solver(Block):
    """How the differential equations are solved."""

    method: Literal["auto", Method] = Field(
        default="auto",
        description="auto: rk4 for a given step, what is cheapest for an automatic one; rodas5p is for stiff plants "
        "and very high gains",
    )
    step: Annotated[Literal["auto"] | float, BeforeValidator(_step), WithJsonSchema(NUMBER_SCHEMA)] = Field(
        default="auto", description="longest step of a fixed-step run; auto: found by error control"
    )
    accuracy: Annotated[Positive, Field(lt=1)] = Field(
        default=1e-3, description="automatic step: relative error of the metrics that is allowed"
    )
    max_evaluations: Positive = Field(
        default=1e8, description="automatic step: evaluations of the right-hand side that are allowed"
    )
    rtol: Positive | None = Field(default=None, description="relative tolerance: adaptive steps of dopri5 or rodas5p")
    atol: Positive | None = Field(default=None, description="absolute tolerance (default: from each state's size)")
    max_step: Positive | None = Field(default=None, description="longest adaptive step")
    divergence: Positive | None = Field(
        default=None, description="bound beyond which an observer has diverged; by default divergence is confirmed"
    )

    @property
    def adaptive(self) -> bool:
        """Whether every step is controlled by given tolerances."""
        return self.rtol is not None or self.atol is not None

    @property
    def controlled(self) -> bool:
        """Whether the step is found by error control."""
        return self.step == "auto" and not self.adaptive

    @property
    def given_method(self) -> Method:
        """The method of a run whose step or whose tolerances are given."""
        return "rk4" if self.method == "auto" else self.method

    @property
    def alone_stiff(self) -> bool:
        """Whether a plant alone is followed by the method for stiff equations, whose errors are controlled."""
        return self.method == "rodas5p" or self.controlled

    @model_validator(mode="after")
    def _adaptive_needs_an_estimate(self) -> Solver:
        if self.adaptive and self.method not in ("dopri5", "rodas5p"):
            raise Problem(("method",), f"rtol and atol need method dopri5 or rodas5p, found {self.method}")
        if self.max_step is not None and not self.adaptive:
            raise Problem(("max_step",), "max_step needs rtol and atol; a fixed step is set with step")
        return self


class Metrics(Block):
    """Where and how the errors are measured."""

    window: Window | None = Field(default=None, description="steady window (default: the last two thirds)")
    transient: Window | None = Field(default=None, description="transient window (default: the first third)")
    average: Positive | None = Field(default=None, description="length of hf's moving mean (default: 1 % of the run)")
    settling: Annotated[Positive, Field(lt=1)] = Field(
        default=0.05, description="the error has settled below this fraction of the transient peak"
    )
    record: Positive | None = Field(default=None, description="spacing of the points measured (default: output_step)")

    @model_validator(mode="after")
    def _order(self) -> Metrics:
        for name in ("window", "transient"):
            window = getattr(self, name)
            if window is not None and not window[0] < window[1]:
                raise Problem((name,), f"it must be [from, to] with from < to, found [{window[0]:g}, {window[1]:g}]")
        return self


class ExperimentBlocks(Block):
    """A whole configuration file. Plant, measurement and observers are checked by classes of their own rooms."""

    read_before = ("runs",)

    @classmethod
    def _inside(cls, key: object, value: object) -> str:
        if key == "seeds":
            count = value if isinstance(value, int) and value > 1 else 50
            of_sweep = f"or `axes: {{seed: {{count: {count}}}}}` with base in a file for hgorun sweep"
            return (
                f" {count} seeds are `runs: {{many: {{seeds: {count}}}}}`, {of_sweep}; tune has a key seeds of its own."
            )
        return " A run is varied: `runs: {many: {vary: ...}}`." if key == "vary" else super()._inside(key, value)

    title: str = Field(default="", description="free text, above figures and in lists")
    reference: str = Field(default="", description="free text: the publication")
    extends: str | None = Field(default=None, description="another file that this one changes")
    time: Time = Field(description="horizon and output grid")
    plant: dict[str, Any] = Field(description="a built-in plant by its type, or equations written in place")
    measurement: dict[str, Any] = Field(
        default_factory=dict, description="when outputs are measured, how late they are, and their noise"
    )
    controller: Controller | None = Field(default=None, description="inputs that are a function of the estimates")
    data: Data | None = Field(default=None, description="recorded measurements, which hgorun estimate takes")
    observers: dict[str, dict[str, Any]] = Field(description="label: an observer by its type, with its gains")
    solver: Solver = Field(default_factory=Solver, description="how the equations are integrated")
    seed: Annotated[int, Field(ge=0, lt=SEEDS, strict=True, description="of all random numbers")] = 0
    metrics: Metrics = Field(default_factory=Metrics, description="windows in which errors are measured")
    figures: dict[str, Figure] = Field(default_factory=dict, description="name: a figure of runs of this file")
    claims: tuple[Claim, ...] = Field(default=(), description="sentences and the inequalities that decide them")
    tune: Tune | None = Field(default=None, description="gains that hgorun tune finds, and for what")


class File(ExperimentBlocks):
    """A configuration file, which may hold several runs of an experiment."""

    runs: dict[str, dict[str, Any]] = Field(
        default_factory=dict, description="name: what the run changes, and seeds or vary for an ensemble of runs"
    )
