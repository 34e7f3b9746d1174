"""An experiment: a validated configuration with its plant, its observers and its schedule."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Set
from functools import cached_property, partial
from typing import Any, Literal, TypeAlias

from hgorun.config.named import Named
from hgorun.errors import ConfigError, KeyPath
from hgorun.measurement.sensors import sensors_of
from hgorun.memo import Memo, same
from hgorun.observers.base import AnyObserver
from hgorun.observers.capabilities import ByLateness, BySampling, NoiseInformed
from hgorun.result.records.observer import Coordinates
from hgorun.simulation.design.design import Design
from hgorun.simulation.design.forms import Around, coordinates_of, form_of
from hgorun.simulation.experiment.blocks import Checked, as_available, check_again, observer_of
from hgorun.simulation.experiment.configured import ONLY_A_FILE
from hgorun.simulation.experiment.observed import Observed
from hgorun.simulation.experiment.resolved import changed, resolved, resolved_text
from hgorun.simulation.experiment.variation import stale, unchanged
from hgorun.symbolic.forms import Form
from hgorun.symbolic.sensors import Sensor

_DESIGNS: Memo[Design] = Memo(256)  # what the runs of a family share

# in a copy; all else follows from these
_KEPT = ("name", "text", "source", "_checked", "_noise", "_chosen", "_known", "_intervals", "begun", "_recorded")

Begun: TypeAlias = Mapping[str, Mapping[str, Literal["sample", "model"]]]
"""By observer the states whose initial estimates were taken from data: a first sample, or what the model says of some.
"""


class Experiment(Observed):
    """One run, complete: everything that :func:`hgorun.simulate` needs.

    Figures and claims are checked for their keys and then left out: which names they may use is decided by all runs
    of a study, and is checked by :func:`hgorun.load`.

    It can be pickled and copied; what has been derived from the blocks is derived again then.

    Parameters
    ----------
    config : mapping or Source
        The blocks of a configuration, as they stand in a YAML file; scalars and arrays of numpy are taken too.
    name : str
        Results are called by it; the stem of the file where there is one.
    text : str, optional
        The configuration as written, before ``extends`` and ``--set``.

    Attributes
    ----------
    source : Source
        The configuration with everything merged, and where each part was written.

    Raises
    ------
    ConfigError
        For the first thing wrong in it.

    Examples
    --------
    >>> plant = {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}}
    >>> time, observers = {"end": 5, "output_step": 0.1}, {"SHGO": {"type": "shgo", "theta": 5}}
    >>> list(Experiment({"time": time, "plant": plant, "observers": observers}).observers)
    ['SHGO']
    """

    def _repr_html_(self) -> str:
        """In a notebook: the plant, and the observers with their keys."""
        from hgorun.simulation.experiment.notebook import as_html

        return as_html(self)

    def varied(self, changes: Mapping[str, Any], *, seed: int | None = None, name: str | None = None) -> Experiment:
        """The same experiment, but for some values.

        Only what has changed is checked again, and runs of equal structure share their compiled code.

        Parameters
        ----------
        changes : mapping of str to value
            By path: keys and list indices with dots between, as after ``--set``; ``observers.*`` is every observer
            whose block has the key that follows. None removes a key, which need not be there. A list that is not there
            is given whole.
        seed : int, optional
            Override the seed of the experiment.
        name : str, optional
            What results are called by.

        Raises
        ------
        ConfigError
            When a path leads nowhere, or a value does not fit.

        Examples
        --------
        >>> faster = experiment.varied({"observers.SHGO.theta": 2})
        >>> shorter = experiment.varied({"time.end": 10, "observers.FHGO": None})
        """
        source, touched = changed(self.source, changes, seed)
        if ("extends",) in touched:
            raise ConfigError(ONLY_A_FILE, key="extends")
        new = object.__new__(type(self))
        new.__dict__ |= self.__dict__
        new._chosen, new._noise = self._taken(), self._noise
        new.source, new.name = source, self.name if name is None else name
        new._checked = check_again(source, self._checked, touched)
        new.begun = _still_begun(self.begun, touched)
        new._forget(self._checked)
        return new

    def design_with(self, label: str, changes: Mapping[str, Any]) -> Design:
        """One of the observers with other values in its block, as :meth:`varied` has it, without all the rest.

        Raises
        ------
        ConfigError
        """
        source, _ = changed(self.source, changes)
        with source.located():
            found = observer_of(label, source.data["observers"][label], source)
            observer = self._informed(self._available(found))
            form, origin = form_of(self.plant, label, observer, self._noise, self._taken().get(label), self._around)
            return Design.of(label, observer, form, origin)

    def __getstate__(self) -> dict[str, Any]:
        """Without what has been derived: equations of CasADi cannot be pickled."""
        return {key: value for key, value in self.__dict__.items() if key in _KEPT}

    def _anew(self) -> Experiment:
        new = object.__new__(type(self))
        new.__dict__ |= self.__getstate__()
        return new

    def _taken(self) -> dict[str, Coordinates]:
        """What was chosen of several possible coordinates."""
        return {} if len(self.plant.model.outputs) == 1 else self.coordinates

    def _forget(self, before: Checked) -> None:
        """Leave out what has been derived from parts that are no longer the same."""
        known, same_blocks = self.__dict__, unchanged(before, self._checked)
        formed = known.get("_formed", {}) | known.get("_forms", {})
        known["_formed"] = {label: forms for label, forms in formed.items() if label in same_blocks}
        for name in stale(before, self._checked):
            known.pop(name, None)

    @property
    def observers(self) -> dict[str, AnyObserver]:
        """The blocks of the observers by their labels."""
        checked = self._checked.observers
        several = any(isinstance(one, BySampling | ByLateness) for one in checked.values())
        return self._by_availability if several else checked

    @cached_property
    def _by_availability(self) -> dict[str, AnyObserver]:
        """The observers where some have other equations for samples, or for what is late."""
        found = {label: self._available(observer) for label, observer in self._checked.observers.items()}
        return Named(found, "observer")

    def _available(self, observer: AnyObserver) -> AnyObserver:
        """An observer's block as it is where outputs are sampled, or not, or late."""
        return as_available(observer, self.sampled, self._late)

    @cached_property
    def _forms(self) -> dict[str, tuple[Form, Form]]:
        """For every observer the form of the plant, and the one first found with the same equations."""
        with self.located():
            known = self.__dict__.get("_formed", {})
            return {label: known.get(label) or self._form(label) for label in self.observers}

    def _form(self, label: str) -> tuple[Form, Form]:
        return form_of(self.plant, label, self.observers[label], self._noise, self._chosen.get(label), self._around)

    @cached_property
    def _chosen(self) -> dict[str, Coordinates]:
        """Coordinates taken by the experiment that this one varies: they are chosen once."""
        return {}

    @cached_property
    def forms(self) -> dict[str, Form]:
        """For every observer the plant in the form that it needs."""
        return {label: form for label, (form, _) in self._forms.items()}

    @cached_property
    def coordinates(self) -> dict[str, Coordinates]:
        """Of every observer with constant gain the coordinates in which it corrects."""
        found = {label: coordinates_of(form) for label, form in self.forms.items()}
        return {label: taken for label, taken in found.items() if taken is not None}

    @cached_property
    def designs(self) -> dict[str, Design]:
        """Every observer with its gains."""
        with self.located():
            return {label: self._design(label, *self._forms[label]) for label in self.observers}

    def design_alone(self, label: str) -> Design:
        """One of the observers with its gains, whatever is wrong with the others."""
        with self.located():
            return self._design(label, *self._form(label))

    def _design(self, label: str, form: Form, origin: Form) -> Design:
        block = self.observers[label]
        sensors = self._sensors if isinstance(block, NoiseInformed) else ()
        key = label, same(block), sensors, same(form), same(origin)
        return _DESIGNS.get(key, lambda: Design.of(label, self._informed(block), form, origin))

    def _informed(self, observer: AnyObserver) -> AnyObserver:
        """An observer's block with what it asks of the rest of the configuration."""
        return observer.informed(self._sensors) if isinstance(observer, NoiseInformed) else observer

    @property
    def _sensors(self) -> tuple[Sensor, ...]:
        return sensors_of(self.stretches, self._intervals) if self._known is None else self._known

    @cached_property
    def _known(self) -> tuple[Sensor, ...] | None:
        """Sensors that the observers are designed for, if not this experiment's own."""
        return None

    @cached_property
    def _intervals(self) -> dict[int, float]:
        """By the numbers of outputs the mean time between samples, where samples that are known say it."""
        return {}

    def with_intervals(self, intervals: Mapping[str, float]) -> Experiment:
        """The same, but with observers that are designed for samples so far apart in the mean, by output."""
        new = self._anew()
        new._intervals = {i: intervals[name] for i, name in enumerate(self.plant.model.outputs) if name in intervals}
        return new

    @cached_property
    def begun(self) -> Begun:
        """Which initial estimates were taken from data, since nothing else is said of them; without data none."""
        return {}

    def with_begun(self, begun: Begun) -> Experiment:
        """The same, where these were."""
        new = self._anew()
        new.begun = begun
        return new

    @cached_property
    def _recorded(self) -> Set[str] | None:
        """See :meth:`with_recorded`; None in a simulation."""
        return None

    def with_recorded(self, inputs: Iterable[str]) -> Experiment:
        """The same, where outputs and these inputs are recorded, or come one by one, and nothing is simulated."""
        new = object.__new__(type(self))
        new.__dict__ |= self.__dict__
        new._recorded = frozenset(inputs)
        return new

    def _around(self) -> Around:
        """What decides whether observers take the plant, besides its equations and numbers."""
        law, recorded = self.plant.symbolic.controller, self._recorded or ()
        untimed = {i for i, name in enumerate(self.plant.model.inputs) if name in recorded}
        untimed |= set(() if law is None else law.driven)
        past = law is None and self._recorded is None
        return Around(sampled=self.sampled(), past=past, untimed=tuple(sorted(untimed)))

    def informed_by(self, other: Experiment) -> Experiment:
        """The same with observers that are designed for the noise of another's sensors."""
        new = self._anew()
        new._known = other._sensors
        return new

    def resolved(self) -> dict[str, Any]:
        """The configuration after ``extends``, ``--set`` and defaults, as plain data."""
        return resolved(self._checked, self.coordinates)

    @property
    def resolved_text(self) -> str:
        """The resolved configuration as YAML."""
        return resolved_text(self._checked, self.coordinates)

    @property
    def resolved_later(self) -> Callable[[], str]:
        """What makes :attr:`resolved_text`, which takes longer than a run."""
        return partial(resolved_text, self._checked, self.coordinates)


def _still_begun(begun: Begun, touched: Set[KeyPath]) -> Begun:
    """What is left of that where some values are given."""
    return {
        label: {
            state: how
            for state, how in of.items()
            if not any(place == ("observers", label, "initial", state)[: len(place)] for place in touched)
        }
        for label, of in begun.items()
    }
