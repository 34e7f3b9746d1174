"""The configuration of a run, checked, and what is read off it."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager
from typing import Any

from hgorun.config.controller import Controller
from hgorun.config.models import ExperimentBlocks, Time
from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError, Problem
from hgorun.measurement.blocks import Measurement
from hgorun.observers.base import AnyObserver
from hgorun.plants.base import Plant
from hgorun.simulation.experiment.blocks import check
from hgorun.simulation.experiment.resolved import as_yaml, plain

ONLY_A_FILE = "only a file can extend another one; see hgorun.load"


def written(blocks: Mapping[str, Any], name: str) -> tuple[str, Source]:
    """A mapping as a file would have it: its text, and what that says.

    Raises
    ------
    ConfigError
        When it extends a file, or holds what no file can.
    """
    if "extends" in blocks:
        raise ConfigError(ONLY_A_FILE, key="extends")
    text = as_yaml(plain(dict(blocks)))
    return text, parse(text, name)


class Configured:
    """What stands in a configuration; an :class:`~hgorun.Experiment` has what follows from it."""

    def __init__(
        self, config: Mapping[str, Any] | Source, *, name: str = "experiment", text: str | None = None
    ) -> None:
        if not isinstance(config, Source):
            text, config = written(config, name)
        self.name, self.text, self.source = name, text or "", config
        self._checked = check(config)

    def located(self) -> AbstractContextManager[None]:
        """Turn a problem at a key into an error that names file, line and key."""
        return self.source.located()

    @property
    def blocks(self) -> ExperimentBlocks:
        """The configuration's own keys."""
        return self._checked.blocks

    @property
    def plant_block(self) -> Plant:
        """The block of the plant."""
        return self._checked.plant

    @property
    def controller(self) -> Controller | None:
        """The block of the controller, where there is one."""
        return self.blocks.controller

    @property
    def closed(self) -> bool:
        """Whether the estimates drive the plant, a copy of it for each observer."""
        return self.controller is not None

    def require_open(self, why: str) -> None:
        """Refuse a controller.

        Raises
        ------
        Problem
        """
        if self.closed:
            raise Problem(("controller",), f"{why}: leave it out, and give the inputs as expressions of t")

    @property
    def measurement(self) -> Measurement:
        """The block of the measurement."""
        return self._checked.measurement

    @property
    def observers(self) -> dict[str, AnyObserver]:
        """The blocks of the observers by their labels."""
        return self._checked.observers

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
