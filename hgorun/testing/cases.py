"""An observer's class with blocks and plants to look at it on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from pydantic import ValidationError

from hgorun.config.types import Block
from hgorun.config.validation import sentence_of
from hgorun.errors import HgorunError, Problem
from hgorun.observers.base import OBSERVERS, AnyObserver, CorrectedObserver, SampledObserver, is_observer
from hgorun.plants.base import PLANTS, Plant
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.plants.inline import InlinePlant
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.testing.contract import Broken
from hgorun.testing.equations import Equations

BlockT = TypeVar("BlockT", bound=Block)
Keys = Mapping[str, Any]  # a block of a configuration

# What an observer is tried on where no plants are given: the first ones that it takes, and one of several outputs.
PLANT_BLOCKS: tuple[Keys, ...] = (
    {"type": "integrator_chain", "n": 2, "phi": "-x1 - x2 - x1**3/10", "initial": {"x1": 0.5, "x2": -0.3}},
    {"type": "contois", "inputs": {"D": "0.3"}, "initial": {"x1": 1.5, "x2": 15.0}},
    {"type": "academic", "initial": {"x1": 1.0, "x2": 0.5, "x3": -0.5}},
)
TWO_OUTPUTS: Keys = {
    "type": "inline",
    "states": ["x1", "x2", "x3", "x4"],
    "dynamics": {"x1": "x2", "x2": "-x1 - x2", "x3": "x4", "x4": "x1 - x3 - x4"},
    "output": ["x1", "x3"],
    "initial": {"x1": 0.5, "x2": -0.3, "x3": 0.2, "x4": 0.4},
}
# Plants with a state that no output shows, with an output that is none, with as many outputs as states.
WRONG_PLANTS: tuple[Keys, ...] = (
    {"states": ["a", "b"], "dynamics": {"a": "-a", "b": "-b"}, "output": "a", "initial": {"a": 1, "b": 1}},
    {"states": ["a"], "dynamics": {"a": "-a"}, "output": "1 + 0*a", "initial": {"a": 1}},
    {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-a"}, "output": ["a", "b"], "initial": {"a": 1, "b": 1}},
    {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-a"}, "output": "a*b", "initial": {"a": 0, "b": 0}},
)
CHAINS = (3, 2, 1)  # lengths of chains of integrators that are tried
TAKEN = 2  # common plants at most that are looked at, beside the one of two outputs


@dataclass(frozen=True)
class Case:
    """An observer on a plant."""

    cls: type[AnyObserver]
    name: str
    keys: Keys
    plant_keys: Keys

    @cached_property
    def plant(self) -> BuiltPlant:
        """The plant."""
        return built(self.plant_keys)

    def observer(self, **changes: object) -> AnyObserver:
        """The block, checked."""
        return block_of(self.cls, {"type": self.name, **self.keys, **changes})

    def equations(self, **changes: object) -> Equations:
        """Built anew each time."""
        observer = self.observer(**changes)
        form = self.cls.form(self.plant.model, self.plant.initial, self.plant.parameters)
        return Equations(observer, self.plant, form)

    @cached_property
    def first(self) -> Equations:
        """As they were when the case was first looked at."""
        return self.equations()

    @cached_property
    def other_numbers(self) -> dict[str, float]:
        """Keys with which the observer is another one: every number a quarter larger, where it may be."""
        found: dict[str, float] = {}
        for key, value in self.observer():
            if isinstance(value, float):
                try:
                    self.equations(**found, **{key: 1.25 * value})
                except (HgorunError, Problem, Broken):
                    continue
                found[key] = 1.25 * value
        return found

    @property
    def sampled(self) -> bool:
        """Whether it needs samples."""
        return isinstance(self.observer(), (CorrectedObserver, SampledObserver))

    @property
    def truth(self) -> dict[str, float]:
        """The plant's initial state."""
        return {name: float(v) for name, v in zip(self.plant.model.states, self.plant.initial, strict=True)}

    @property
    def aside(self) -> dict[str, float]:
        """An estimate near it."""
        return {name: 1.05 * value + 0.02 for name, value in self.truth.items()}

    def experiment(
        self, observers: Mapping[str, Keys], *, measurement: Keys | None = None, end: float = 1.0, **plant: object
    ) -> Experiment:
        """A run of observers, those without ``type`` of this class; sampled where the observer needs it."""
        blocks = {
            label: {"type": self.name, **self.keys, **more} if "type" not in more else dict(more)
            for label, more in observers.items()
        }
        sampled: Keys = {"sampling": {"period": 0.1}} if self.sampled else {}
        if isinstance(self.observer(), CorrectedObserver):  # a sample at the start would correct the initial estimate
            sampled = {"sampling": {"period": 0.1, "offset": 0.1}}
        return Experiment(
            {
                "time": {"end": end, "output_step": 0.05},
                "plant": {**self.plant_keys, **plant},
                "measurement": dict(sampled if measurement is None else measurement),
                "observers": blocks,
                "solver": {"method": "rk4", "step": 0.0025},
            }
        )


@dataclass(frozen=True)
class Subject:
    """A class of observers with the cases that it is looked at in."""

    cls: type[AnyObserver]
    name: str
    keys: Keys
    plants: Sequence[Keys] | None

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """One for every plant that was given; else those of the common plants that the observer takes."""
        if self.plants is not None:
            if not self.plants:
                raise Broken("plants=[]", "at least one entry")
            return tuple(self._given(plant) for plant in self.plants)
        found: list[Case] = []
        refused: list[str] = []
        for plant in (*PLANT_BLOCKS, TWO_OUTPUTS):
            case = self.case(plant)
            if len(found) == TAKEN and plant is not TWO_OUTPUTS:
                continue
            try:
                equations = case.first
            except (HgorunError, Problem) as error:
                refused.append(f"{plant['type']}: {error}")
                continue
            if not (found and equations.singular):  # the first plant shows whether it is the observer's own fault
                found.append(case)
        if not found:
            raise Broken(
                "none of the common plants taken (" + "; ".join(refused) + ")",
                "a plant that it takes, given by plants=[...]",
            )
        return tuple(found)

    def _given(self, plant: Keys) -> Case:
        case = self.case(plant)
        try:
            _ = case.first
        except (HgorunError, Problem) as error:
            raise Broken(
                f"the plant {plant.get('type', 'inline')} refused: {error}", "a plant that it takes"
            ) from error
        return case

    def on_integrators(self, n: int) -> Equations | None:
        """The observer of n integrators; None where it does not take them."""
        keys = {"type": "integrator_chain", "n": n, "initial": {f"x{i + 1}": 0.5 for i in range(n)}}
        try:
            equations = self.case(keys).equations()
        except (HgorunError, Problem, Broken):
            return None
        return None if equations.singular else equations

    def case(self, plant: Keys) -> Case:
        """The observer on a plant."""
        states = built(plant).model.states
        return Case(self.cls, self.name, {**self.cls.example(states), **self.keys}, plant)


def block_of(cls: type[BlockT], keys: Keys) -> BlockT:
    """A block of an observer or a plant; Broken where the keys do not make one."""
    try:
        return cls.model_validate(dict(keys))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise Broken(
            f"the block {dict(keys)} refused at {key or 'its top'}: {sentence_of(first)}",
            "keys that work: by block=, or by the class method example for keys without default",
        ) from error


def built(keys: Keys) -> BuiltPlant:
    """The plant of a block."""
    cls: type[Plant] = InlinePlant if keys.get("type", "inline") == "inline" else PLANTS.find(keys["type"])
    return build_plant(block_of(cls, keys))


@contextmanager
def lent(subject: type[AnyObserver], keys: Keys) -> Iterator[str]:
    """A name under which configurations find the class for a while: its own, or that of the block's type."""
    if not is_observer(subject):
        raise TypeError(
            f"found {subject!r}; expected a class derived from ContinuousObserver, SampledObserver or HybridObserver "
            "with nothing left abstract"
        )
    own = [name for name, cls in OBSERVERS.all().items() if cls is subject]
    name = str(keys.get("type", own[0] if own else subject.__name__))
    with OBSERVERS.replaced(name, subject):
        yield name


def as_tuple(plants: Iterable[Keys] | None) -> tuple[Keys, ...] | None:
    """The plants, several times over."""
    return None if plants is None else tuple(plants)
