"""What the block ``data`` of a configuration says of samples that come one after the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from hgorun.config.data import Data
from hgorun.config.overrides import replaced
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.noise.gaussian import GaussianNoise
from hgorun.simulation.experiment.experiment import Experiment


@dataclass(frozen=True, eq=False, repr=False)
class StatedOfData:
    """What is said of samples; nothing without such a block.

    Attributes
    ----------
    block : Data or None
    inputs : tuple of str
        Those that come with the samples.
    gates : mapping of str to float
        By output, standard deviations of the innovation beyond which a sample is not used.
    std : mapping of str to float
        By output, the standard deviation of its noise.
    """

    block: Data | None
    inputs: tuple[str, ...]
    gates: Mapping[str, float]
    std: Mapping[str, float]

    @classmethod
    def of(cls, source: Source) -> StatedOfData:
        """That of a configuration.

        Raises
        ------
        ConfigError
        """
        data = source.data.get("data") if isinstance(source.data, dict) else None
        if data is None:
            return cls(None, (), {}, {})
        block = validate(Data, data, source, ("data",))
        gates = {name: one.gate for name, one in block.outputs.items() if one.gate is not None}
        std = {name: one.std for name, one in block.outputs.items() if one.std is not None}
        return cls(block, tuple(block.inputs), gates, std)


def noisy(outputs: Mapping[str, Any], std: Mapping[str, float]) -> dict[str, Any]:
    """Blocks of outputs with gaussian noise of these standard deviations where they have none."""
    added = {
        name: {"noise": [{"type": "gaussian", "std": value}]} | dict(outputs.get(name) or {})
        for name, value in std.items()
    }
    return {**outputs, **added}


def with_noise(experiment: Experiment, std: Mapping[str, float]) -> Experiment:
    """The experiment with gaussian noise of the outputs for which its block ``measurement`` has none of their own.

    It is made anew, since coordinates may follow from the noise; where the noise of all outputs is the same already, it
    is the experiment itself.
    """
    outputs = dict((experiment.source.data.get("measurement") or {}).get("outputs") or {})
    of = dict(zip(experiment.plant.model.outputs, experiment.stretches, strict=True))
    added = {
        name: value
        for name, value in std.items()
        if "noise" not in (outputs.get(name) or {}) and not _is_noise(value, of.get(name, ()))
    }
    if not added:
        return experiment
    source, _ = replaced(experiment.source, "measurement.outputs", noisy(outputs, added))
    return Experiment(source, name=experiment.name, text=experiment.text)


def _is_noise(std: float, stretches: Sequence[Stretch]) -> bool:
    """Whether the noise of an output is gaussian of this standard deviation, and no other."""
    try:
        added = (GaussianNoise(type="gaussian", std=std),)
    except ValidationError:  # which the experiment tells, with its key
        return False
    return bool(stretches) and all(stretch.noise == added for stretch in stretches)


def require_known_start(experiment: Experiment) -> None:
    """Refuse a start that is to be fitted to the first samples: when a stream begins, there are none.

    Raises
    ------
    Problem
        Where an observer has states whose start is not given, so that a file would begin elsewhere.
    """
    data = experiment.source.data.get("data")
    first = data.get("first_samples", 1) if isinstance(data, dict) else 1
    if first == 1:
        return
    for label, observer in experiment.observers.items():
        missing = [state for state in experiment.plant.model.states if state not in observer.initial]
        if missing:
            message = (
                f"{first} samples are not there when a stream begins, and {label} has no start for "
                f"{', '.join(missing)}: give observers.{label}.initial, such as the estimate of a file with the first "
                "minutes, or first_samples: 1, with which these states start at 0"
            )
            raise Problem(("data", "first_samples"), message)
