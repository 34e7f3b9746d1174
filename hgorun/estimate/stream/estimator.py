"""Observers that follow samples as they come."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from hgorun.config.named import Named
from hgorun.config.reading import read_source
from hgorun.engine.plan import Floats, Integers
from hgorun.errors import ConfigError
from hgorun.estimate.completed import streamed
from hgorun.estimate.samples import stated
from hgorun.estimate.stated_of_data import StatedOfData, require_known_start, with_noise
from hgorun.estimate.stream.arriving import Arriving
from hgorun.estimate.stream.checkpoint import Checkpoint, Settings, damaged
from hgorun.estimate.stream.following import Following
from hgorun.estimate.stream.gate_counts import by_gate
from hgorun.estimate.stream.given import as_number, names_in, positive_by_name, require_names, require_outputs
from hgorun.estimate.stream.live_system import LiveSystem
from hgorun.estimate.stream.remembered import Remembered
from hgorun.estimate.stream.together import Together
from hgorun.simulation.experiment.expected import require_experiment
from hgorun.simulation.experiment.experiment import Experiment


class Estimator:
    """The observers of an experiment on samples that come one after the other.

    At the times of samples the estimates have the bits of ``hgorun estimate`` with the same steps. Memory is constant.

    Parameters
    ----------
    experiment : Experiment
        Its plant is what the observers copy. Estimates begin at ``time.start`` with the observers' ``initial``.
    gates : mapping of str to float, optional
        By output, standard deviations of the innovation beyond which a sample is not used. By default, as for what
        follows, that of the block ``data``; none where it is empty.
    std : mapping of str to float, optional
        By output, the standard deviation of its noise, where ``measurement.outputs`` has none of it.
    inputs : sequence of str, optional
        Inputs that are given with the samples, and held; the others are expressions of the time.
    remembered : int
        So many events are remembered for samples that come late; what was taken before them is refused.

    Raises
    ------
    ConfigError

    Examples
    --------
    >>> estimator = Estimator(hgorun.load("config.yaml"))
    >>> estimator.update(0.1, {"y": 0.52})
    >>> estimator.predict(0.15)["SHGO"].shape
    (2,)
    """

    def __init__(
        self,
        experiment: Experiment,
        *,
        gates: Mapping[str, float] | None = None,
        std: Mapping[str, float] | None = None,
        inputs: Sequence[str] | None = None,
        remembered: int = 1000,
    ) -> None:
        require_experiment(experiment)
        if gates is None or std is None or inputs is None:
            said = StatedOfData.of(experiment.source)
            gates = said.gates if gates is None else gates
            std = said.std if std is None else std
            inputs = said.inputs if inputs is None else inputs
        gates = positive_by_name("gates", gates)
        require_names("std", std)
        inputs = names_in("inputs", inputs)
        if not isinstance(remembered, int) or remembered < 0:
            raise ConfigError(f"remembered: expected a whole number of events, 0 or more, found {remembered!r:.50}")
        experiment = with_noise(experiment, std).with_recorded(inputs)
        with experiment.located():
            require_known_start(experiment)
            self._system = system = LiveSystem.of(experiment, inputs)
            require_outputs("gates", gates, system.outputs)
            self._run = Following(system, gates)
        self._experiment, self._live = experiment, self._run.live
        self._settings: Settings = {"gates": gates, "std": dict(stated(experiment)), "inputs": sorted(system.inputs)}
        self._past = Remembered(self._run, max(remembered, int(system.joint)))
        self._arriving = Arriving(self._run, self._past)
        self._together = Together(
            self._run, self._arriving, decided=bool(gates or system.steps or system.timed or remembered > 0)
        )

    @classmethod
    def load(cls, path: str | Path, overrides: Sequence[str] = (), *, remembered: int = 1000) -> Estimator:
        """The observers of a configuration of recorded data, as ``hgorun estimate CONFIG -`` has them.

        The file needs neither ``time.end`` nor ``plant.initial``; arguments are those of :func:`hgorun.load`, and
        ``remembered`` as above.

        Raises
        ------
        ConfigError
        """
        _, source = read_source(path, overrides)
        said = StatedOfData.of(source)
        experiment = streamed(source, said, Path(path).stem)
        return cls(experiment, gates=said.gates, std=said.std, inputs=said.inputs, remembered=remembered)

    @property
    def t(self) -> float:
        """The time of the last event."""
        return self._experiment.origin + self._live.t

    @property
    def states(self) -> tuple[str, ...]:
        """Names of what is estimated."""
        return self._experiment.plant.model.states

    @property
    def labels(self) -> tuple[str, ...]:
        """Of the observers."""
        return self._system.labels

    @property
    def any_lost(self) -> bool:
        """Whether one of the observers has no numbers any more."""
        return bool(self._live.diverged.min() < np.inf)

    @property
    def lost(self) -> dict[str, bool]:
        """Which observers have no numbers any more."""
        lost = (self._live.diverged < np.inf).tolist()
        return Named(dict(zip(self.labels, lost, strict=True)), "observer")

    @property
    def gated(self) -> dict[str, dict[str, tuple[int, int]]]:
        """By observer and output with a gate: how many samples were outliers and not used, and of how many.

        As they are judged now: where a late sample is gone back to, those behind it are judged anew.
        """
        return by_gate(self._run, lambda i, j: (self._run.outliers[i][j], self._run.offered[i][j]))

    @property
    def gated_in_a_row(self) -> dict[str, dict[str, int]]:
        """By observer and output with a gate: how many samples, at most, were left out one after the other."""
        return by_gate(self._run, lambda i, j: self._run.in_a_row[i][j][1])

    def estimate(self) -> dict[str, Floats]:
        """xhat of every observer at the last event, by label, shape (n,) each."""
        return Named(dict(self._system.estimates(self._live)), "observer")

    def predict(self, t: float) -> dict[str, Floats]:
        """xhat of every observer at a time that is not before the last event; nothing follows from it.

        Raises
        ------
        ValueError
            For an earlier time.
        """
        ((_, found),) = self.predictions([t])
        return found

    def predictions(self, times: Iterable[float]) -> Iterator[tuple[float, dict[str, Floats]]]:
        """xhat of every observer at ascending times, each reached from the one before; nothing follows from it.

        As :meth:`predict` at each, but for the steps, of which none is made twice. Between two times the estimator may
        be used; what happens to it is not seen here.

        Parameters
        ----------
        times : iterable of float
            None before the last event.

        Raises
        ------
        ValueError
            For an earlier time.
        """
        ahead, regime = self._live.state(), self._run.regime
        for t in times:
            since, kept = self._arriving.since_start(as_number("t", t), ahead[0]), self._live.state()
            try:
                self._live.restore(ahead)
                self._live.advance(since, regime)
                found = Named({label: np.array(xhat) for label, xhat in self.estimate().items()}, "observer")
                ahead = self._live.state()
            finally:  # whoever is interrupted here goes on from the last event, too
                self._live.restore(kept)
            yield t, found

    def require_reachable(self, t: float) -> None:
        """Refuse a time that is before the last event, or so far ahead that it is of another clock.

        Raises
        ------
        ValueError
        """
        self._arriving.since_start(as_number("t", t))

    def update(
        self,
        t: float,
        y: Mapping[str, float],
        available: float | None = None,
        u: Mapping[str, float] | None = None,
    ) -> None:
        """Take samples, and go on to when they are known.

        Parameters
        ----------
        t : float
            When they were taken.
        y : mapping of str to float
            By output; one that is NaN is missing.
        available : float, optional
            When they are known, if that is later than ``t``.
        u : mapping of str to float, optional
            Inputs from then on; one that is NaN stays what it is.

        Raises
        ------
        ValueError
            For a time that has passed, for names that are unknown, and for infinite numbers.
        TypeError
            For what is no number, or no mapping.
        """
        self._arriving.take(t, y, available, u)

    @property
    def kinds(self) -> dict[str, int]:
        """The numbers of outputs and of inputs that come with samples, for :meth:`update_many`; by name."""
        return self._together.kinds

    def at_once(self, t: Floats, kinds: Integers) -> int:
        """How many of some samples, from the first on, :meth:`update_many` may take together.

        It cannot take samples of an output that has not been heard before, and none where something is decided in
        between: with gates, with samples that may come late, and for observers that step from sample to sample; nor
        samples of several outputs that are taken at one time, where these correct an observer together.

        Parameters
        ----------
        t : ndarray, shape (N,)
        kinds : ndarray of int, shape (N,)
            What each is of, see :attr:`kinds`.
        """
        return self._together.at_once(t, kinds)

    def update_many(self, t: Floats, kinds: Integers, values: Floats) -> dict[str, tuple[Floats, np.ndarray]]:
        """Take samples that are known when they are taken, with the bits of one :meth:`update` after the other.

        Parameters
        ----------
        t, kinds, values : ndarray, shape (N,)
            As many as :meth:`at_once` allows; values are numbers.

        Returns
        -------
        dict of str to (ndarray, ndarray of bool)
            By observer xhat after every sample, shape (N, n), and whether it had no numbers any more, shape (N,).
        """
        return Named(self._together.take(t, kinds, values), "observer")

    @cached_property
    def _identity(self) -> str:
        """What a checkpoint has to be of: the configuration, and which inputs are given."""
        text = self._experiment.resolved_text + json.dumps(sorted(self._system.inputs))
        return hashlib.sha256(text.encode()).hexdigest()

    def checkpoint(self) -> bytes:
        """All that the estimator goes on from, with what is remembered for samples that come late."""
        numbers, notes = self._run.told([self._run.state(), *self._past.before])
        return Checkpoint(numbers, notes, self._past.events).written(self._identity, self._settings)

    def restore(self, checkpoint: bytes | bytearray) -> None:
        """Go on from a checkpoint of the same configuration, with the same gates, std and inputs.

        Raises
        ------
        HgorunError
            When it is none, or one of another configuration or with others.
        TypeError
            When it is no bytes at all.
        """
        if not isinstance(checkpoint, bytes | bytearray):
            raise TypeError(f"checkpoint: expected the bytes of checkpoint(), found {checkpoint!r:.50}")
        found = Checkpoint.read(checkpoint, self._identity, self._settings)
        try:
            now, *before = self._run.states(found.numbers, found.notes)
            self._run.restore(now)
        except Exception as error:
            raise damaged(error) from error
        self._past.replace(found.events, before)
