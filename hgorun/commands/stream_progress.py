"""How far a stream has come: when it is started again, nothing is lost or used twice."""

from __future__ import annotations

import json
import math
import os
import sys
from abc import ABC, abstractmethod
from collections import Counter, deque
from pathlib import Path
from typing import TypeAlias

import numpy as np

from hgorun.commands.stream_clock import AGAIN, UTC, Clock
from hgorun.commands.stream_lines import Sample, Samples
from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator
from hgorun.files import remove_leftovers, written_whole
from hgorun.process import say, uninterrupted

_MAGIC = b"hgorun-stream-1 "
_Key: TypeAlias = tuple[str, float, float | None]  # signal, when it was taken, and its value; None for a missing one


class Progress(ABC):
    """What has been taken and told, kept in a file with all that the estimator goes on from.

    Parameters
    ----------
    estimator : Estimator
        Goes on from the checkpoint, if there is one.
    path : Path or None
        Where the checkpoint is; None if nothing is kept.
    unit : str
        Of the times.

    Attributes
    ----------
    t : float
        The time up to which samples have been taken; -inf before the first.
    shown : float
        The last time of a grid at which the estimates have been told; -inf before the first.
    late : Counter
        By output, how many samples were late.
    clock : Clock
        The times of the samples.

    Raises
    ------
    ConfigError
        When the file is no checkpoint of this stream.
    """

    def __init__(self, estimator: Estimator, path: Path | None, unit: str = "") -> None:
        self._estimator, self._path, self.clock = estimator, path, Clock(unit)
        self.t, self.shown = -math.inf, -math.inf
        self.late = Counter[str]()
        taken = []
        if path is not None:
            remove_leftovers(path.parent)
        if path is not None and os.path.exists(path):
            try:
                stored = path.read_bytes()
            except OSError as error:
                raise ConfigError(f"cannot be read: {error.strerror}", file=str(path)) from None
            taken = self._restore(stored, str(path))
        self._start(taken)

    def _restore(self, stored: bytes, file: str) -> list[_Key]:
        if not stored.startswith(_MAGIC):
            raise ConfigError("this is not a checkpoint of a stream, or one of another version", file=file)
        head, _, rest = stored[len(_MAGIC) :].partition(b"\n")
        try:
            t, shown, taken, *more = json.loads(head)
            late, times = (*more, {}, {})[:2]  # older ones do not count, and know less of times
            self.late = Counter({str(name): int(count) for name, count in late.items()})
            self.clock.restore(times)
            self.t, self.shown = float(t), float(shown)
            keys = [(str(name), float(at), None if y is None else float(y)) for name, at, y in taken]
        except (ValueError, TypeError, AttributeError) as error:
            raise ConfigError(f"the checkpoint is damaged: {error}", file=file) from None
        try:
            self._estimator.restore(rest)
        except ConfigError as error:
            raise ConfigError(error.message, file=file) from None
        return keys

    def save(self) -> None:
        """Write the checkpoint, if one is kept; what is in it has been told, and outlasts a loss of power."""
        if self._path is None:
            return
        with uninterrupted():
            sys.stdout.flush()
            head = json.dumps([self.t, self.shown, self._keys(), self.late, self.clock.kept()]).encode()
            with written_whole(self._path, durable=True) as part:
                part.write_bytes(_MAGIC + head + b"\n" + self._estimator.checkpoint())

    @abstractmethod
    def _start(self, taken: list[_Key]) -> None:
        """Begin with what had been taken before the stream was started again."""

    @abstractmethod
    def _keys(self) -> list[_Key]:
        """Samples that may come again, and would not be known by their time alone."""

    @abstractmethod
    def knows(self, sample: Sample) -> bool:
        """Whether a sample has been taken before."""

    @abstractmethod
    def took(self, sample: Sample) -> None:
        """A sample has been taken."""


class InOrder(Progress):
    """Of samples that come in the order in which they are known, once each time the stream is started.

    Of those that are known at the same time some may have been taken and others not yet: those that have been are
    remembered until time goes on.
    """

    def _start(self, taken: list[_Key]) -> None:
        self._taken = taken  # of those that are known at t
        self._restored, self._left, self._seen = self.t, Counter(taken), set[str]()

    def _keys(self) -> list[_Key]:
        return self._taken

    def save_what_there_is(self) -> None:
        """Write the checkpoint of a stream that ends before its time, if samples have been taken."""
        if self.t > -math.inf:
            self.save()

    def knows(self, sample: Sample) -> bool:
        """Whether a sample had been taken before the stream was started again."""
        if sample.signal not in self._seen:
            self._begin(sample.signal, sample.t)
        known = _known(sample)
        if known != self._restored:
            return known < self._restored
        key = _key(sample)
        self._left[key] -= 1
        return self._left[key] >= 0

    def unknown(self, samples: Samples, signals: list[str]) -> np.ndarray:
        """The places of samples that had not been taken before; ``signals`` are the names of the kinds."""
        for kind in np.unique(samples.kinds).tolist() if len(self._seen) < len(signals) else ():
            if signals[kind] not in self._seen:
                self._begin(signals[kind], float(samples.t[samples.kinds == kind][0]))
        new = samples.t > self._restored
        for k in np.flatnonzero(samples.t == self._restored).tolist():
            new[k] = not self.knows(_sample(samples, k, signals))
        return np.flatnonzero(new)

    def _begin(self, signal: str, t: float) -> None:
        """Where a signal goes on an hour before it had ended, in a night when clocks are put back, this is told."""
        self._seen.add(signal)
        if t < self._restored and self.clock.back(signal, t) == "night":
            skipped = f"samples up to t = {self.clock.until(signal):.10g} are skipped as old ones"
            say(f"hgorun: {AGAIN.format(signal)} in this night: {skipped}; {UTC}")

    def took(self, sample: Sample) -> None:
        if self._path is not None:
            known = _known(sample)
            if known != self.t:
                self.t, self._taken = known, []
            self._taken.append(_key(sample))

    def took_all(self, samples: Samples, signals: list[str]) -> None:
        """Samples have been taken, in the order of time."""
        for k in range(int(np.searchsorted(samples.t, samples.t[-1])), samples.t.size):
            self.took(_sample(samples, k, signals))


class Redelivered(Progress):
    """Of samples that may come again at any moment, among new ones: the last ones are remembered, refused ones too.

    Parameters
    ----------
    remembered : int
        So many, at least those that a broker has on their way at once, and those that the estimator can go back to.
    """

    def __init__(self, estimator: Estimator, path: Path | None, remembered: int, unit: str = "") -> None:
        self._remembered = remembered
        super().__init__(estimator, path, unit)

    def _start(self, taken: list[_Key]) -> None:
        self._order, self._taken = deque[_Key](), set[_Key]()
        for key in taken:
            self._add(key)

    def _keys(self) -> list[_Key]:
        return list(self._order)

    def knows(self, sample: Sample) -> bool:
        return _key(sample) in self._taken

    def took(self, sample: Sample) -> None:
        self.t = max(self.t, _known(sample))
        self._add(_key(sample))

    def refused(self, sample: Sample) -> None:
        """A sample has been refused: when it comes again, others may have come that would let it pass."""
        self._add(_key(sample))

    def _add(self, key: _Key) -> None:
        self._order.append(key)
        self._taken.add(key)
        if len(self._order) > self._remembered:
            self._taken.discard(self._order.popleft())


def _known(sample: Sample) -> float:
    return sample.t if sample.available is None else sample.available


def _key(sample: Sample) -> _Key:
    return sample.signal, sample.t, None if math.isnan(sample.y) else sample.y


def _sample(samples: Samples, k: int, signals: list[str]) -> Sample:
    return Sample(0, float(samples.t[k]), signals[samples.kinds[k]], float(samples.y[k]), None)
