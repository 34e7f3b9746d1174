"""An experiment: a validated configuration with its plant, its observers and its schedule."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import cached_property
from typing import Any

import numpy as np

from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError, NotObservableForm, Problem
from hgorun.measurement.availability import Stretch, resolve
from hgorun.plants.build import BuiltPlant, build_plant
from hgorun.result.windows import points_in
from hgorun.simulation.blocks import check
from hgorun.symbolic.forms import Form

_ELSEWHERE = {"title", "reference", "extends", "figures", "claims", "plant", "observers"}  # the last two have classes


class Experiment:
    """One run, complete: everything that :func:`hgorun.simulate` needs.

    Parameters
    ----------
    config : mapping or Source
        The blocks of a configuration, as they stand in a YAML file.
    name : str
        Results are called by it; the stem of the file where there is one.
    text : str, optional
        The configuration as written, before ``extends`` and ``--set``.

    Attributes
    ----------
    source : Source
        The configuration with everything merged, and where each part was written.
    blocks : hgorun.config.models.Experiment
    plant_block : Plant
    measurement : Measurement
    observers : dict of str to Observer

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
                raise ConfigError("only a file can extend another one; see hgorun.load", key="extends")
            text = _yaml(dict(config))
            config = parse(text, name)
        self.name, self.text, self.source = name, text or "", config
        self.blocks, self.plant_block, self.measurement, self.observers = check(config)
        self.prepared: object = None  # what hgorun.simulation.simulate has made of it

    def located(self) -> AbstractContextManager[None]:
        """Turn a problem at a key into an error that names file, line and key."""
        return self.source.located()

    @cached_property
    def plant(self) -> BuiltPlant:
        """The plant as a model with numbers."""
        with self.located():
            return build_plant(self.plant_block)

    @cached_property
    def forms(self) -> dict[str, Form]:
        """For every observer the plant in the form that it needs."""
        built: dict[Any, Form] = {}
        with self.located():
            for label, observer in self.observers.items():
                if observer.form not in built:
                    try:
                        built[observer.form] = observer.form(
                            self.plant.model, self.plant.initial, self.plant.parameters
                        )
                    except NotObservableForm as error:
                        asked = f"observer {label} ({observer.type}) asks for another form of the plant"
                        raise Problem(("plant",), f"{error}; {asked}") from error
        return {label: built[observer.form] for label, observer in self.observers.items()}

    @cached_property
    def stretches(self) -> list[list[Stretch]]:
        """Every output's availability, phase by phase."""
        with self.located():
            return resolve(self.measurement, self.plant.model.outputs, self.blocks.time)

    @property
    def metric_step(self) -> float:
        """Spacing of the points that metrics are taken from."""
        return self.blocks.metrics.record or self.blocks.time.output_step

    @cached_property
    def grid(self) -> tuple[np.ndarray, int, int]:
        """The finer of output and metric grid, and how many of its points make a step of each.

        Raises
        ------
        ConfigError
            When one grid is no multiple of the other, or the output is larger than allowed.
        """
        time, record = self.blocks.time, self.metric_step
        fine = min(record, time.output_step)
        ratios = [round(step / fine) for step in (time.output_step, record)]
        with self.located():
            for ratio, step in zip(ratios, (time.output_step, record), strict=True):
                if abs(ratio * fine - step) > 1e-6 * fine:
                    raise Problem(
                        ("metrics", "record"),
                        f"record {record:g} and output_step {time.output_step:g}: one must be a multiple of the other",
                    )
            count = np.floor((time.end - time.start) / fine * (1 + 1e-12) + 1e-9) + 1
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
            points = time.start + np.arange(int(count)) * fine
            measured = points[:: ratios[1]]
            for key in ("window", "transient"):
                window = getattr(self.blocks.metrics, key)
                if window is not None and measured[points_in(measured, window)].size == 0:
                    raise Problem(("metrics", key), f"no output point lies in [{window[0]:g}, {window[1]:g}]")
        return points, ratios[0], ratios[1]

    @cached_property
    def resolved_text(self) -> str:
        """The resolved configuration as YAML."""
        return _yaml(self.resolved())

    def resolved(self) -> dict[str, Any]:
        """The configuration after ``extends``, ``--set`` and defaults: all that the numbers of the run follow from.

        Titles, references, figures and claims are not in it.
        """
        values = self.blocks.model_dump(mode="json", exclude=_ELSEWHERE, exclude_none=True)
        values["measurement"] = self.measurement.model_dump(mode="json", exclude_none=True)
        values["plant"] = self.plant_block.model_dump(mode="json", exclude_none=True)
        values["observers"] = {label: _plain(o.model_dump(exclude_none=True)) for label, o in self.observers.items()}
        return values


def _yaml(values: dict[str, Any]) -> str:
    import yaml

    return yaml.safe_dump(values, sort_keys=False, allow_unicode=True)


def _plain(value: Any) -> Any:
    """Values as YAML can write them: complex numbers as text, tuples as lists."""
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, complex):
        return value.real if value.imag == 0 else str(value).strip("()")
    return value
