"""The blocks of a configuration. Each class is one mapping of the YAML file; its fields are the keys."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from hgorun.config.types import Block, ExpressionText, Name, NonEmpty, NonNegative, Number, Positive, describe, number

GIB = 2.0**30


class Time(Block):
    """Horizon and output grid: start, start + output_step, ..., the last point <= end."""

    start: Number = Field(default=0.0, description="start of the run")
    end: Number = Field(description="end of the run")
    output_step: Positive = Field(description="spacing of the output grid")
    unit: str = Field(default="s", description="label of the time unit")
    max_memory: Positive = Field(
        default=2 * GIB, description="bytes allowed for output, for samples and for delay history (default 2 GiB)"
    )

    @model_validator(mode="after")
    def _order(self) -> Time:
        if not self.end > self.start:
            raise ValueError(f"end must be after start, found end {self.end:g}, start {self.start:g}")
        return self


class Term(Block):
    """One sinusoid: amplitude * sin(omega t + phase)."""

    amplitude: Number
    omega: Number = Field(description="angular frequency, rad per time unit")
    phase: Number = 0.0


class Sinusoids(Block):
    """A sum of sinusoids."""

    type: Literal["sinusoids"]
    terms: Annotated[tuple[Term, ...], NonEmpty]


class ExpressionNoise(Block):
    """Noise as an expression of time t and, for samples, of the sample's number k."""

    type: Literal["expression"]
    value: ExpressionText


class UniformNoise(Block):
    """Uniform noise between low and high: a draw a sample, or one every ``hold``."""

    type: Literal["uniform"]
    low: Number
    high: Number
    hold: Positive | None = Field(default=None, description="a new draw every hold from start, constant between")

    @model_validator(mode="after")
    def _order(self) -> UniformNoise:
        if not self.low < self.high:
            raise ValueError(f"low must be below high, found low {self.low:g}, high {self.high:g}")
        return self


class GaussianNoise(Block):
    """Gaussian noise of standard deviation ``std``, or of a signal-to-noise ratio."""

    type: Literal["gaussian"]
    std: NonNegative | None = Field(default=None, description="standard deviation")
    snr_db: Number | None = Field(
        default=None,
        description="variance = mean of the noise-free output squared over the run / 10^(snr_db/10)",
    )
    hold: Positive | None = Field(default=None, description="a new draw every hold from start, constant between")

    @model_validator(mode="after")
    def _one(self) -> GaussianNoise:
        if (self.std is None) == (self.snr_db is None):
            raise ValueError("give either std or snr_db")
        return self


Noise = Annotated[Sinusoids | ExpressionNoise | UniformNoise | GaussianNoise, Field(discriminator="type")]


class Periodic(Block):
    """Samples at start + offset + k period, each moved by jitter or lost by chance."""

    period: Positive
    offset: NonNegative = 0.0
    jitter: NonNegative = Field(default=0.0, description="uniform on +-jitter")
    dropout: Annotated[NonNegative, Field(le=1)] = Field(default=0.0, description="probability that a sample is lost")


class Times(Block):
    """Samples at the given times."""

    times: Annotated[tuple[Number, ...], NonEmpty]

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
        raise ValueError(f"expected continuous or a mapping with period, times or steps, found {describe(value)}")
    kinds: dict[str, type[Block]] = {"period": Periodic, "times": Times, "steps": Steps}
    found = [key for key in kinds if key in value]
    if len(found) != 1:
        raise ValueError(
            "expected exactly one of period, times and steps"
            + (f", found {' and '.join(found)}" if found else f", found {', '.join(map(str, value)) or 'none'}")
        )
    return kinds[found[0]].model_validate(value)


Sampling = Annotated[Literal["continuous"] | Periodic | Times | Steps, BeforeValidator(_sampling)]


class Availability(Block):
    """How an output reaches the observers. Omitted keys are taken from the enclosing block."""

    sampling: Sampling | None = Field(default=None, description="continuous, or when samples arrive")
    delay: ExpressionText | None = Field(default=None, description="number or expression of t, >= 0")
    noise: tuple[Noise, ...] | None = Field(default=None, description="summed")
    mode: Literal["additive", "multiplicative"] | None = Field(default=None, description="y + v or y (1 + v)")


class Phase(Availability):
    """A stretch of time with its own availability."""

    until: Number = Field(description="end of the phase")
    outputs: dict[Name, Availability] = Field(default_factory=dict)


class Measurement(Availability):
    """What the observers are told: for all outputs, for some of them, and in phases of time."""

    outputs: dict[Name, Availability] = Field(default_factory=dict, description="overrides for single outputs")
    phases: tuple[Phase, ...] = Field(default=(), description="one after the other in time")


def _step(value: Any) -> Any:
    if value == "auto":
        return value
    step = number(value)
    if not step > 0:
        raise ValueError(f"expected auto or a number > 0, found {describe(value)}")
    return step


class Solver(Block):
    """How the differential equations are solved."""

    method: Literal["euler", "rk4", "dopri5"] = "rk4"
    step: Annotated[Literal["auto"] | float, BeforeValidator(_step)] = Field(
        default="auto", description="longest step of a fixed-step run, or auto"
    )
    rtol: Positive | None = Field(default=None, description="relative tolerance: dopri5 with adaptive steps")
    atol: Positive | None = Field(default=None, description="absolute tolerance: dopri5 with adaptive steps")
    max_step: Positive | None = Field(default=None, description="longest adaptive step")
    divergence: Positive | None = Field(
        default=None, description="an observer has diverged beyond it (default 1e6 (1 + max |x|))"
    )

    @property
    def adaptive(self) -> bool:
        """Whether the step is controlled by an error estimate."""
        return self.rtol is not None or self.atol is not None

    @model_validator(mode="after")
    def _adaptive_needs_dopri5(self) -> Solver:
        if self.adaptive and self.method != "dopri5":
            raise ValueError(f"rtol and atol need method dopri5, found {self.method}")
        if self.max_step is not None and not self.adaptive:
            raise ValueError("max_step goes with rtol and atol; a fixed step is set by step")
        return self


Window = tuple[Number, Number]


class Metrics(Block):
    """Where and how the errors are measured."""

    window: Window | None = Field(default=None, description="steady window (default: the last two thirds)")
    transient: Window | None = Field(default=None, description="transient window (default: the first third)")
    average: Positive | None = Field(default=None, description="length of hf's moving mean (default: 1 % of the run)")
    settling: Annotated[Positive, Field(lt=1)] = Field(
        default=0.05, description="settled below this part of the transient peak"
    )
    record: Positive | None = Field(default=None, description="spacing of the points measured (default: output_step)")

    @model_validator(mode="after")
    def _order(self) -> Metrics:
        for name in ("window", "transient"):
            window = getattr(self, name)
            if window is not None and not window[0] < window[1]:
                raise ValueError(f"{name} must be [from, to] with from < to, found [{window[0]:g}, {window[1]:g}]")
        return self


class Panel(Block):
    """One set of axes: what it shows of which observers."""

    state: str | None = Field(default=None, description="a plant state: the truth and the estimates")
    error: str | None = Field(default=None, description="a plant state: estimate minus truth")
    output: str | None = Field(default=None, description="an output: its measurements and the truth")
    observers: tuple[str, ...] | None = Field(default=None, description="labels (default: all)")
    measurements: bool = Field(default=False, description="show the measurements of the state that is an output")
    window: Window | None = Field(default=None, description="time shown (default: the whole run)")
    limits: Window | None = Field(default=None, description="range of the vertical axis")
    title: str | None = None

    @model_validator(mode="after")
    def _one_subject(self) -> Panel:
        if sum(x is not None for x in (self.state, self.error, self.output)) != 1:
            raise ValueError("a panel shows exactly one of state, error and output")
        return self


class Figure(Block):
    """A figure: panels one below the other."""

    title: str | None = None
    panels: Annotated[tuple[Panel, ...], NonEmpty]
    width: Positive = Field(default=6.0, description="inches")
    height: Positive | None = Field(default=None, description="inches (default: 2.2 a panel)")


class Experiment(Block):
    """A whole configuration file. Plants and observers are checked by the classes that their type names."""

    title: str = ""
    reference: str = ""
    extends: str | None = Field(default=None, description="another file that this one changes")
    time: Time
    plant: dict[str, Any]
    measurement: Measurement = Field(default_factory=Measurement)
    observers: dict[str, dict[str, Any]]
    solver: Solver = Field(default_factory=Solver)
    seed: Annotated[int, Field(ge=0, lt=2**63, strict=True)] = 0
    metrics: Metrics = Field(default_factory=Metrics)
    figures: dict[str, Figure] = Field(default_factory=dict)
