"""The file of a benchmark: plants, scenarios, contestants with one knob each, seeds, and how much is tried."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from hgorun.config.nearest import among
from hgorun.config.tuning import Range
from hgorun.config.types import Block, NonEmpty, Positive
from hgorun.errors import Problem

Count = Annotated[int, Field(ge=2, le=1000, strict=True)]


class Venue(Block):
    """A plant: a configuration with a run for each scenario and one observer, which gives the initial estimate."""

    file: str = Field(description="the configuration, as seen from the benchmark's file")
    rate: Positive = Field(
        default=1.0, description="how fast the plant is, 1/time: knobs that are rates are multiples of it"
    )


class Knob(Block):
    """The one number of a contestant that is tuned."""

    key: str = Field(
        default="theta", description="of the observer's block; with dots between, as in Q.x3, inside of it"
    )
    range: Range = Field(default_factory=lambda: Range(log=(0.5, 200)), description="where it is sought")
    rate: bool = Field(default=True, description="whether the range is in multiples of the plant's rate")
    whole: bool = Field(default=False, description="whether it is a whole number")
    follow: dict[str, Positive] = Field(
        default_factory=dict, description="other keys of the block that are so many times the knob"
    )


class Special(Block):
    """What is different for a contestant on one plant."""

    knob: Knob | None = Field(default=None, description="the number that is tuned there; that of the others by default")
    block: dict[str, Any] = Field(default_factory=dict, description="further keys of the observer's block")


class Contestant(Block):
    """An observer, and what is tuned of it."""

    group: str = Field(description="which kind it is: a colour of the figure")
    knob: Knob = Field(default_factory=Knob, description="the number that is tuned")
    steps: Literal["plant", "auto"] = Field(
        default="plant", description="of integration: those of the plant's file, or found by error control"
    )
    scenarios: tuple[str, ...] = Field(default=(), description="the only ones that it is made for; all by default")
    plants: dict[str, Special] = Field(
        default_factory=dict, description="plant: another `knob`, and further keys of the `block`, there"
    )
    block: dict[str, Any] = Field(description="the observer's block without its knob and its initial estimate")

    @model_validator(mode="after")
    def _free(self) -> Contestant:
        if "type" not in self.block:
            raise ValueError("block: the key type is missing")
        for one in (self, *map(self.on, self.plants)):
            for key in (one.knob.key, *one.knob.follow, "initial"):
                if key in one.block:
                    why = "it is that of the plant's file" if key == "initial" else "it is tuned"
                    raise ValueError(f"block: {key} is not given here: {why}")
        return self

    def on(self, plant: str) -> Contestant:
        """The contestant as it is on a plant."""
        own = self.plants.get(plant)
        if own is None:
            return self
        changes = {"knob": own.knob or self.knob, "block": {**self.block, **own.block}, "plants": {}}
        return self.model_copy(update=changes)


class Others(Block):
    """Observers of the program, and of other packages, that the file does not name."""

    group: str = Field(default="others", description="their group; that of differentiators is differentiator")
    knobs: Annotated[tuple[Knob, ...], NonEmpty] = Field(
        description="the first of these that an observer has among its keys is tuned"
    )


class Seeds(Block):
    """Seeds for tuning, and others, which follow, for the numbers that are reported."""

    first: Annotated[int, Field(ge=0, strict=True)] = Field(default=0, description="the first of them")
    tuning: Count = Field(default=20, description="for tuning")
    scoring: Count = Field(default=50, description="for the numbers that are reported")


class Tries(Block):
    """How many values of each knob are tried: all over its range, then around the best one."""

    coarse: Count = Field(default=9, description="all over its range, with a quarter of the seeds")
    fine: Count = Field(default=10, description="around the best of these, with all seeds")


class BenchmarkFile(Block):
    """Plants x scenarios x contestants."""

    title: str = Field(default="", description="free text, above tables and figures")
    plants: Annotated[dict[str, Venue], NonEmpty] = Field(description="name: plant")
    scenarios: Annotated[tuple[str, ...], NonEmpty] = Field(description="the runs that every plant's file has")
    observers: Annotated[dict[str, Contestant], NonEmpty] = Field(description="label: contestant")
    others: Others | None = Field(default=None, description="how observers that are not named here take part")
    without: dict[str, str] = Field(default_factory=dict, description="type: why it does not take part")

    @model_validator(mode="after")
    def _known(self) -> BenchmarkFile:
        for label, one in self.observers.items():
            for name in one.scenarios:
                if name not in self.scenarios:
                    raise Problem(
                        ("observers", label, "scenarios"),
                        f"no scenario is called {name!r}; there are {among(name, self.scenarios)}",
                    )
            for name in one.plants:
                if name not in self.plants:
                    raise Problem(
                        ("observers", label, "plants"),
                        f"no plant is called {name!r}; there are {among(name, self.plants)}",
                    )
        return self

    seeds: Seeds = Field(default_factory=Seeds, description="whose runs are averaged")
    tries: Tries = Field(default_factory=Tries, description="how many values of each knob are tried")
