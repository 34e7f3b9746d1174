"""Recorded measurements on the bench: observers on a log, with scores in place of a truth."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from hgorun.config.written import beside
from hgorun.config.yaml_source import Source
from hgorun.data.recording import InputSignal, Recording, Signal
from hgorun.estimate.completed import completed
from hgorun.estimate.estimate import estimate_prepared
from hgorun.estimate.holdout import thinned
from hgorun.estimate.log import log_of
from hgorun.estimate.prepared import PreparedEstimate, prepare_estimate
from hgorun.explore.bench import Bench, Progress, Ready, Shown
from hgorun.explore.knobs import Knob
from hgorun.explore.recorded_knobs import knobs_of
from hgorun.explore.state import State
from hgorun.memo import Memo
from hgorun.simulation.experiment.resolved import as_yaml, changed

Samples = tuple[Recording, Mapping[str, Signal]]  # what observers get, and what is held out between

_LOGS = 8  # that are kept: with another std or period the log is read again
_NO_PART = ("extends", "runs", "tune", "figures", "claims")  # of what an estimate is made of


@dataclass(frozen=True, eq=False)
class Estimated(Shown):
    """A state whose observers have followed the log."""

    prepared: PreparedEstimate
    samples: Samples


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedBench(Bench):
    """A configuration of recorded data.

    Attributes
    ----------
    source : Source
        What the file says, of the run that is meant.
    text_of_file : str
        As written.
    """

    source: Source
    text_of_file: str = ""
    _samples: Memo[Samples] = field(default_factory=lambda: Memo(_LOGS), repr=False)

    @classmethod
    def of(cls, path: Path, source: Source, text: str, run_name: str | None) -> RecordedBench:
        """Read the log of a file.

        Raises
        ------
        ConfigError
        """
        name = run_name or path.stem
        with source.located():
            samples = _read(source, path)
        bench = cls(path, completed(source, samples[0], name, text), run_name, source=source, text_of_file=text)
        bench._samples.get(_key(source), lambda: samples)
        return bench

    def _knobs(self) -> Sequence[Knob]:
        return knobs_of(self.base, self.source)

    def ready(self, state: State) -> Ready:
        said, _ = changed(self.source, state.changes(self.knobs))
        with said.located():
            samples = self._samples.get(_key(said), lambda: _read(said, self.path))
        experiment = completed(said, samples[0], self.base.name, self.text_of_file)
        prepared = prepare_estimate(experiment, samples[0])

        def carried_out(progress: Progress) -> Shown:
            with experiment.located():
                result = estimate_prepared(prepared, *samples, with_error=False)  # which the page does not show
            return Estimated(state, said, experiment, result, prepared, samples)

        return Ready(prepared.run.structure.compiled, carried_out)

    def finished(self, shown: Shown) -> Shown | None:
        """With how much the scores depend on each gain: two more runs for each of them."""
        assert isinstance(shown, Estimated)
        with shown.experiment.located():
            result = estimate_prepared(shown.prepared, *shown.samples, sensitivity=True, with_error=False)
        return Shown(shown.state, shown.said, shown.experiment, result)

    def text(self, shown: Shown, target: Path) -> str:
        data = beside(shown.said, self.path.parent, target.parent)
        return as_yaml({key: part for key, part in data.items() if key not in _NO_PART})

    def says(self, source: Source, file: Path) -> Mapping[str, object]:
        with source.located():
            recording, between = _read(source, file)
        whole = completed(source, recording, self.base.name, "").resolved()
        return {
            **{key: part for key, part in whole.items() if key not in ("data", *_NO_PART)},
            "outputs": {name: _content(one) for name, one in recording.outputs.items()},
            "inputs": {name: _content(one) for name, one in recording.inputs.items()},
            "compared": [[name, _content(one)] for of in (recording.reference, between) for name, one in of.items()],
        }


def _content(signal: Signal | InputSignal) -> list[object]:
    """A signal wherever its file stands."""
    of = [getattr(signal, one.name) for one in fields(signal) if one.name not in ("source", "sources", "lines")]
    return [part.tobytes() if isinstance(part, np.ndarray) else part for part in of]


def _read(source: Source, path: Path) -> Samples:
    log = log_of(source, path)
    return thinned(log.read(), log.block.period)


def _key(source: Source) -> str:
    """What the samples depend on."""
    return json.dumps([source.data.get(key) for key in ("data", "time", "plant")], sort_keys=True, default=str)
