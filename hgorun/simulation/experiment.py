"""An experiment: a validated configuration with its plant, its observers and its schedule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from hgorun.config.models import ExperimentBlocks, Time
from hgorun.config.overrides import replaced
from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError, Problem
from hgorun.measurement.availability import Stretch, resolve
from hgorun.measurement.blocks import Measurement
from hgorun.measurement.noise import deviations
from hgorun.memo import Memo, Same
from hgorun.observers.base import AnyObserver
from hgorun.plants.base import Plant
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.result.data import Coordinates
from hgorun.result.windows import points_in
from hgorun.simulation.blocks import Checked, check, check_again, observer_of, plain, resolved
from hgorun.simulation.forms import form_of
from hgorun.simulation.observer_block import Design
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form

# what the runs of a family share, and by which their schedules are known again
_STRETCHES: Memo[list[list[Stretch]]] = Memo(16)
_POINTS: Memo[np.ndarray] = Memo(16, lambda points: points.size < 1_000_000)

_ONLY_A_FILE = "only a file can extend another one; see hgorun.load"
_KEPT = ("name", "text", "source", "_checked", "_noise", "_chosen")  # in a copy; all else follows from these


class Experiment:
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
    """

    def __init__(
        self, config: Mapping[str, Any] | Source, *, name: str = "experiment", text: str | None = None
    ) -> None:
        if not isinstance(config, Source):
            if "extends" in config:
                raise ConfigError(_ONLY_A_FILE, key="extends")
            text = _yaml(plain(dict(config)))
            config = parse(text, name)
        self.name, self.text, self.source = name, text or "", config
        self._checked = check(config)

    def located(self) -> AbstractContextManager[None]:
        """Turn a problem at a key into an error that names file, line and key."""
        return self.source.located()

    def varied(self, changes: Mapping[str, Any], *, seed: int | None = None, name: str | None = None) -> Experiment:
        """The same experiment, but for some values.

        Only what has changed is checked again, and runs of equal structure share their compiled code.

        Parameters
        ----------
        changes : mapping of str to value
            By path: keys and list indices with dots between, as after ``--set``. None removes a key. A list that is
            not there is given whole.
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
        source, touched = self.source, set()
        for path, value in changes.items():
            source, place = replaced(source, path, plain(value))
            touched.add(place)
        if ("extends",) in touched:
            raise ConfigError(_ONLY_A_FILE, key="extends")
        if seed is not None:
            source, place = replaced(source, "seed", seed)
            touched.add(place)
        new = object.__new__(type(self))
        new.__dict__ |= self.__dict__
        new._chosen, new._noise = self._taken(), self._noise
        new.source, new.name = source, self.name if name is None else name
        new._checked = check_again(source, self._checked, touched)
        new._forget(self._checked)
        return new

    def design_with(self, label: str, changes: Mapping[str, Any]) -> Design:
        """One of the observers with other values in its block, as :meth:`varied` has it, without all the rest.

        Raises
        ------
        ConfigError
        """
        source = self.source
        for path, value in changes.items():
            source, _ = replaced(source, path, plain(value))
        with source.located():
            observer = observer_of(label, source.data["observers"][label], source)
            form, origin = form_of(self.plant, label, observer, self._noise, self._taken().get(label))
            return Design.of(label, observer, form, origin)

    def __getstate__(self) -> dict[str, Any]:
        """Without what has been derived: equations of CasADi cannot be pickled."""
        return {key: value for key, value in self.__dict__.items() if key in _KEPT}

    def _taken(self) -> dict[str, Coordinates]:
        """What was chosen of several possible coordinates."""
        return {} if len(self.plant.model.outputs) == 1 else self.coordinates

    def _forget(self, before: Checked) -> None:
        """Leave out what has been derived from parts that are no longer the same."""
        now, known = self._checked, self.__dict__
        known["_designed"] = known.get("_designed", {}) | known.get("designs", {})
        stale = {"designs"}
        if now.plant is not before.plant or now.blocks.time.start != before.blocks.time.start:
            stale |= {"plant", "_forms", "stretches", "grid"}
        if now.observers is not before.observers:
            stale |= {"_forms"} if now.observers.keys() == before.observers.keys() else {"_forms", "grid"}
        if now.measurement is not before.measurement or now.blocks.time != before.blocks.time:
            stale |= {"stretches"}
        if now.blocks.time != before.blocks.time or now.blocks.metrics != before.blocks.metrics:
            stale |= {"grid"}
        for name in stale:
            known.pop(name, None)

    @property
    def blocks(self) -> ExperimentBlocks:
        """The configuration's own keys."""
        return self._checked.blocks

    @property
    def plant_block(self) -> Plant:
        """The block of the plant."""
        return self._checked.plant

    @property
    def measurement(self) -> Measurement:
        """The block of the measurement."""
        return self._checked.measurement

    @property
    def observers(self) -> dict[str, AnyObserver]:
        """The blocks of the observers by their labels."""
        return self._checked.observers

    @cached_property
    def plant(self) -> BuiltPlant:
        """The plant as a model with numbers."""
        with self.located():
            return build_plant(self.plant_block, self.origin)

    @cached_property
    def _forms(self) -> dict[str, tuple[Form, Form]]:
        """For every observer the form of the plant, and the one first found with the same equations."""
        with self.located():
            noise = self._noise
            return {
                label: form_of(self.plant, label, observer, noise, self._chosen.get(label))
                for label, observer in self.observers.items()
            }

    @cached_property
    def _noise(self) -> dict[str, float]:
        """Standard deviation of the outputs' noise, where several outputs share the states."""
        outputs = self.plant.model.outputs
        return deviations(self.stretches, outputs) if len(outputs) > 1 else {}

    @cached_property
    def _chosen(self) -> dict[str, Coordinates]:
        """Coordinates taken by the experiment that this one varies: they are chosen once."""
        return {}

    @property
    def forms(self) -> dict[str, Form]:
        """For every observer the plant in the form that it needs."""
        return {label: form for label, (form, _) in self._forms.items()}

    @property
    def coordinates(self) -> dict[str, Coordinates]:
        """Of every observer with constant gain the coordinates in which it corrects."""
        chains = {label: form for label, form in self.forms.items() if isinstance(form, CanonicalForm)}
        return {label: Coordinates(form.map, form.taken) for label, form in chains.items()}

    @cached_property
    def designs(self) -> dict[str, Design]:
        """Every observer with its gains."""
        with self.located():
            return {label: self._design(label) for label in self.observers}

    def _design(self, label: str) -> Design:
        known = self.__dict__.setdefault("_designed", {}).get(label)
        observer, (form, origin) = self.observers[label], self._forms[label]
        if known is not None and known.observer is observer and known.form is form:
            return cast(Design, known)
        return Design.of(label, observer, form, origin)

    @cached_property
    def stretches(self) -> list[list[Stretch]]:
        """Every output's availability, phase by phase."""
        outputs, time = self.plant.model.outputs, self.blocks.time
        with self.located():
            return _STRETCHES.get(
                (Same(self.measurement), outputs, time), lambda: resolve(self.measurement, outputs, time)
            )

    @property
    def adaptive(self) -> bool:
        """Whether given tolerances control every step."""
        return self.blocks.solver.adaptive

    @property
    def given_step(self) -> float | None:
        """The step of the file; None where it is found automatically."""
        step = self.blocks.solver.step
        return None if step == "auto" or self.adaptive else step

    @property
    def origin(self) -> float:
        """The start of the run, on the clock of the configuration."""
        return self.blocks.time.start

    @property
    def time(self) -> Time:
        """Horizon and output grid, counted from the start of the run: where the clock began costs no digits."""
        return self.blocks.time.from_zero

    @property
    def metric_step(self) -> float:
        """Spacing of the points that metrics are taken from."""
        return self.blocks.metrics.record or self.blocks.time.output_step

    @cached_property
    def grid(self) -> tuple[np.ndarray, int, int]:
        """The finer of output and metric grid, from 0 on, and how many of its points make a step of each.

        Raises
        ------
        ConfigError
            When one grid is not a multiple of the other, or the output is larger than allowed.
        """
        time, record, origin = self.time, self.metric_step, self.origin
        fine = min(record, time.output_step)
        ratios = [round(step / fine) for step in (time.output_step, record)]
        with self.located():
            for ratio, step in zip(ratios, (time.output_step, record), strict=True):
                if abs(ratio * fine - step) > 1e-6 * fine:
                    raise Problem(
                        ("metrics", "record"),
                        f"record {record:g} and output_step {time.output_step:g}: one must be a multiple of the other",
                    )
            rounding = 1e-9 + 2 * np.spacing(time.end) / fine
            count = np.floor(time.end / fine * (1 + 1e-12) + rounding) + 1
            width = self.plant.model.n + sum(
                self.plant.model.n * 2 + 8 for _ in self.observers
            )  # states and estimates, before the exact size is known
            size = count * width * 8
            if size > time.max_memory:
                raise Problem(
                    ("time", "output_step"),
                    f"the output grid has {count:.4g} points, about {size / 2**30:.3g} GiB; "
                    f"time.max_memory allows {time.max_memory / 2**30:.3g} GiB",
                )
            for path, step in ((("time", "output_step"), time.output_step), (("metrics", "record"), record)):
                if step > time.end * (1 + 1e-9):
                    raise Problem(path, f"{step:g} is longer than the run, {time.end:g}: shorten it")
            points = _POINTS.get((int(count), fine), lambda: np.arange(int(count)) * fine)
            measured = points[:: ratios[1]]
            for key in ("window", "transient"):
                window = getattr(self.blocks.metrics, key)
                if window is None:
                    continue
                since = window[0] - origin, window[1] - origin
                slack = 1e-9 * fine + np.spacing(max(map(abs, window)))
                outside = since[0] < -slack or since[1] > time.end + slack
                if outside and key == "window":  # of the transient of a shortened run there may be less
                    raise Problem(
                        ("metrics", key),
                        f"[{window[0]:g}, {window[1]:g}] reaches outside the run, which lasts from "
                        f"{origin:g} to {self.blocks.time.end:g}",
                    )
                if measured[points_in(measured, since)].size == 0:
                    raise Problem(("metrics", key), f"no output point lies in [{window[0]:g}, {window[1]:g}]")
        return points, ratios[0], ratios[1]

    def resolved(self) -> dict[str, Any]:
        """The configuration after ``extends``, ``--set`` and defaults, as plain data."""
        return resolved(self._checked, self.coordinates)

    @property
    def resolved_text(self) -> str:
        """The resolved configuration as YAML."""
        return _yaml(self.resolved())

    @property
    def resolved_later(self) -> Callable[[], str]:
        """What makes :attr:`resolved_text`, which takes longer than a run."""
        return partial(_resolved_text, self._checked, self.coordinates)


def _resolved_text(checked: Checked, coordinates: Mapping[str, Coordinates]) -> str:
    return _yaml(resolved(checked, coordinates))


def _yaml(values: dict[str, Any]) -> str:
    import yaml

    return yaml.safe_dump(values, sort_keys=False, allow_unicode=True)
