"""The blocks of a file beside those of its runs: ensembles, figures, claims, and what is tuned."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from hgorun.config.tuning import Tune
from hgorun.config.types import Block, ExpressionText, Name, NonEmpty, Number, Positive, Window


class Inset(Block):
    """A part of a panel, enlarged inside it."""

    window: Window = Field(description="time shown")
    limits: Window | None = Field(default=None, description="range of its vertical axis (default: what it shows)")
    place: tuple[Number, Number, Number, Number] | None = Field(
        default=None,
        description="left, bottom, width and height, as fractions of the panel (default: where it covers least)",
    )


class Scaling(Block):
    """How the size of an estimate's error depends on what a run varies."""

    state: str = Field(description="a plant state")
    run: str | None = Field(default=None, description="a run with vary (default: the only one)")
    of: str = Field(default="amplitude", description="the quantity shown, as in claims: amplitude, rmse, sup, hf, ...")
    theory: bool = Field(default=False, description="also draw what theory predicts for the linearised observer")
    axes: Literal["log", "linear"] = Field(default="log", description="logarithmic axes, or linear ones")


class Panel(Block):
    """One set of axes: what it shows of which observers."""

    state: str | None = Field(default=None, description="a plant state: the truth and the estimates")
    error: str | None = Field(default=None, description="a plant state: estimate minus truth")
    magnitude: str | None = Field(default=None, description="a plant state: size of the error, logarithmic")
    output: str | None = Field(default=None, description="an output: its measurements and the truth")
    driven: str | None = Field(default=None, description="a plant state, in closed loops: of every driven plant")
    input: str | None = Field(default=None, description="an input, in closed loops: as every observer sets it")
    scaling: Scaling | None = Field(default=None, description="error size against what a run varies")
    run: str | None = Field(default=None, description="the run shown, where a file has several (default: all)")
    observers: tuple[str, ...] | None = Field(
        default=None, description="labels, with several runs also run/label (default: all)"
    )
    measurements: bool = Field(default=False, description="show the measurements of the state that is an output")
    members: Literal["lines", "bands"] | None = Field(
        default=None,
        description="of an ensemble: a line for each member (default without seeds), or median and quantiles",
    )
    window: Window | None = Field(default=None, description="time shown (default: the whole run)")
    limits: Window | None = Field(default=None, description="range of the vertical axis")
    inset: Inset | None = Field(default=None, description="a detail, enlarged inside the panel")
    title: str | None = Field(default=None, description="above the panel")

    @property
    def subject(self) -> str:
        """The key that says what the panel shows."""
        return next(key for key in PANEL_SUBJECTS if getattr(self, key) is not None)

    @model_validator(mode="after")
    def _one_subject(self) -> Panel:
        if sum(getattr(self, key) is not None for key in PANEL_SUBJECTS) != 1:
            raise ValueError(f"a panel shows exactly one of {', '.join(PANEL_SUBJECTS[:-1])} and {PANEL_SUBJECTS[-1]}")
        return self


PANEL_SUBJECTS = ("state", "error", "magnitude", "output", "driven", "input", "scaling")


# inches: a column of a journal, and both with the gap between them
WIDTHS = {"one": 3.5, "two": 7.2}


def _inches(value: Any) -> Any:
    return WIDTHS.get(value, value) if isinstance(value, str) else value


Width = Annotated[
    Positive,
    BeforeValidator(_inches),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"enum": list(WIDTHS)}]}),
]


class Figure(Block):
    """A figure: panels one below the other, or in columns."""

    title: str | None = Field(default=None, description="above the figure")
    panels: Annotated[tuple[Panel, ...], NonEmpty] = Field(description="one below the other, or in columns")
    columns: Annotated[int, Field(ge=1, le=6, strict=True)] = Field(
        default=1, description="panels side by side; filled row by row"
    )
    labels: dict[str, str] = Field(
        default_factory=dict, description="run/label or label: what the legend calls that observer"
    )
    width: Width = Field(default=6.0, description="inches; one or two: columns of a journal")
    height: Positive | None = Field(default=None, description="inches (default: 2.2 per row of panels)")
    style: Literal["light", "dark"] = Field(default="light", description="of the page")


class Inequality(Block):
    """An expression of quantities, and between what its value has to lie."""

    value: str = Field(description="an expression of metrics of the runs, such as hf('FHGO', x1)/hf('SHGO', x1)")
    below: Number | None = Field(default=None, description="it holds if the value is below")
    above: Number | None = Field(default=None, description="it holds if the value is above")
    between: Window | None = Field(default=None, description="it holds if the value lies in [low, high]")

    @model_validator(mode="after")
    def _one_threshold(self) -> Inequality:
        if self.thresholds != 1:
            raise ValueError("give exactly one of below, above and between")
        return self

    @property
    def thresholds(self) -> int:
        """How many are given."""
        return sum(getattr(self, key) is not None for key in ("below", "above", "between"))

    @property
    def relation(self) -> str:
        """The key of the threshold: below, above or between."""
        return next(key for key in ("below", "above", "between") if getattr(self, key) is not None)

    def holds(self, value: float) -> bool:
        """Whether a value satisfies it."""
        if self.between is not None:
            return self.between[0] <= value <= self.between[1]
        return value < self.below if self.below is not None else value > (self.above or 0.0)


class Alternative(Inequality):
    """What decides a claim if something that the publication leaves open is chosen in another way."""

    note: str = Field(default="", description="the other choice")


class Claim(Inequality):
    """A sentence of a publication and the inequality that decides it."""

    id: str = Field(description="a short name, unique in the file")
    claim: str = Field(description="the sentence, paraphrased")
    source: str = Field(default="", description="where the publication says it: section, page")
    figure: str | None = Field(default=None, description="the figure it refers to")
    value: str = Field(
        default="", description="an expression of metrics of the runs, such as hf('FHGO', x1)/hf('SHGO', x1)"
    )
    alternatives: tuple[Alternative, ...] = Field(
        default=(), description="other choices of what is open: where they differ, the verdict is `depends`"
    )
    divergence: bool = Field(
        default=False,
        strict=True,
        description="it says that an observer diverges: the infinite error of one that did is its number",
    )
    undecidable: str = Field(default="", description="why no finite run decides it; the value is shown beside that")
    expect: Literal["confirmed", "refuted", "undecided", "undecidable", "depends"] = Field(
        default="confirmed", description="the verdict known so far; of what is undecidable just that"
    )
    note: str = Field(default="", description="what a reader should know beside the number")

    @model_validator(mode="after")
    def _one_threshold(self) -> Claim:
        if not self.value and not self.undecidable:
            raise ValueError("give a value, or say under undecidable why there is none")
        if self.thresholds != (1 if self.value else 0):
            raise ValueError("give exactly one of below, above and between" + ("" if self.value else " with a value"))
        if self.alternatives and (not self.value or self.undecidable):
            raise ValueError("alternatives go with a value that decides")
        return self

    @property
    def inequalities(self) -> tuple[Inequality, ...]:
        """Its own, if it has one, and the alternatives."""
        return (self, *self.alternatives) if self.value else ()

    @property
    def expected(self) -> str:
        """The verdict known so far."""
        return "undecidable" if self.undecidable else self.expect


def _some(assigned: dict[str, str]) -> dict[str, str]:
    if not assigned:
        raise ValueError("it sets nothing, so all members would be the same")
    return assigned


class Vary(Block):
    """A run repeated for each value of a name."""

    name: Name = Field(description="what is varied")
    values: Annotated[tuple[Number, ...], NonEmpty] = Field(description="one member of the ensemble for each")
    set: Annotated[dict[str, ExpressionText], AfterValidator(_some)] = Field(
        description="path: expression of the name, as with --set"
    )

    @model_validator(mode="before")
    @classmethod
    def _no_path(cls, data: object) -> object:
        """A path stands under ``set``, not in the place of the name."""
        if isinstance(data, dict):
            paths = [part for part in (*data, data.get("name")) if isinstance(part, str) and "." in part]
            if paths:
                raise ValueError(f"a path stands under set: {{name: v, values: [1, 2], set: {{{paths[0][:100]}: v}}}}")
        return data


class Ensemble(Block):
    """Seeds and varied values that make an ensemble of a run; with both, every seed is run with every value."""

    seeds: Annotated[int, Field(ge=2, le=100_000, strict=True)] | None = Field(
        default=None, description="repeated with this many seeds: seed, seed + 1, ..."
    )
    vary: Vary | None = Field(default=None, description="repeated for each value of a name")

    @property
    def kind(self) -> str:
        """What members differ in, in words; nothing for a single run."""
        return " and ".join(key for key in ("seeds", "vary") if getattr(self, key) is not None)


class StudyBlocks(Block):
    """What a file has beside its runs."""

    title: str = ""
    reference: str = ""
    runs: dict[str, Any] = Field(default_factory=dict)
    figures: dict[str, Figure] = Field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    tune: Tune | None = None
