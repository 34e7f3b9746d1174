"""The parts of a result file that estimates of recorded data have: samples, bands, scores."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from hgorun.errors import printable
from hgorun.result.hdf5.stored import StoredFile
from hgorun.result.hdf5.writer import Writer, labels_of, units_in
from hgorun.result.records.data import ResultData
from hgorun.result.records.recorded import Assessed, Recorded, RecordedOutput, Unseen

_OF_OBSERVERS = {
    "used": "whether each observer has taken the sample",
    "innovation": "sample minus what each observer had estimated",
    "nis": "innovation squared over its variance",
}

_AT_ONCE = "when the sample was measured, and the observers got it"  # true of all three times, which may be one


def write_inputs(w: Writer, result: ResultData) -> None:
    """The plant's inputs over time, where it has some."""
    if result.inputs:
        w.data(
            "plant/u",
            result.u,
            ("time", "plant_input"),
            labels=labels_of(result.inputs),
            long_name="input",
            units=units_in(result.units, result.inputs),
        )


def write_recorded(w: Writer, result: ResultData, recorded: Recorded) -> None:
    """Inputs, samples, and what was set aside."""
    unit = result.units.get("time", "")
    w.group("plant").attrs["outputs"] = labels_of(result.outputs)
    write_inputs(w, result)
    if result.measures is not None:
        w.group("plant").attrs["measures"] = json.dumps(dict(result.measures))
    w.names("observer", tuple(result.observers))
    for name, one in recorded.outputs.items():
        base = f"measurement/{name}"
        w.scale(f"{base}/number", np.arange(one.y.size), long_name="number of the sample")
        numbered = (f"{base}/number",)
        for key, values, meaning in (
            ("time", one.available, "when the observers get the sample"),
            ("taken", one.taken, "time it was measured"),
            ("available", one.available, "time it was known"),
        ):
            known = _AT_ONCE if one.taken is one.available else meaning
            w.data(f"{base}/{key}", values, numbered, units=unit, long_name=known)
        measured_in = result.units.get(name) or None
        w.data(f"{base}/y", one.y, numbered, units=measured_in, long_name="sample")
        for key, meaning in _OF_OBSERVERS.items():
            values = np.asarray(getattr(one, key), dtype=np.int8 if key == "used" else float)
            units = measured_in if key == "innovation" else None
            w.data(f"{base}/{key}", values, (*numbered, "observer"), units=units, long_name=meaning)
    for group, several in (("held_out", recorded.held_out), ("reference", recorded.reference)):
        for name, unseen in several.items():
            base = f"{group}/{name}"
            w.scale(f"{base}/number", np.arange(unseen.y.size), long_name="number of the sample")
            w.data(f"{base}/taken", unseen.taken, (f"{base}/number",), units=unit, long_name="time it was measured")
            w.data(
                f"{base}/y",
                unseen.y,
                (f"{base}/number",),
                units=result.units.get(name) or None,
                long_name="sample that no observer was given",
            )


def write_assessed(w: Writer, result: ResultData, label: str, assessed: Assessed, units: str | None) -> None:
    """The band of an observer, and its scores."""
    base = f"observers/{label}"
    for name, values in (("lower", assessed.lower), ("upper", assessed.upper)):
        w.data(
            f"{base}/{name}",
            values,
            ("time", "plant_state"),
            labels=labels_of(result.states),
            long_name=f"{name} end of the band of 95 %",
            units=units,
        )
    w.group(base).attrs["no_band"] = json.dumps(dict(assessed.no_band))
    w.group(f"scores/{label}")
    for name, of in assessed.scores.items():
        data = w.data(f"scores/{label}/{name}", list(of.values()), labels=labels_of(tuple(of)))
        w.index(data, 0, len(of))


class RecordedFile:
    """Reads what :func:`write_recorded` and :func:`write_assessed` have written."""

    def __init__(self, file: StoredFile, observers: int, outputs: tuple[str, ...]) -> None:
        self._file, self._observers, self._outputs = file, observers, outputs

    def recorded(self) -> Recorded:
        """Samples, and what was set aside."""
        outputs = {name: self._output(f"measurement/{name}") for name in self._outputs}
        origin = self._file.text("time_origin") if "time_origin" in self._file.file.attrs else ""
        return Recorded(outputs, self._unseen("held_out"), self._unseen("reference"), printable(origin))

    def _output(self, base: str) -> RecordedOutput:
        read, m = self._file.numbers, self._observers
        y = read(f"{base}/y", None)
        taken, available = (read(f"{base}/{key}", y.size) for key in ("taken", "available"))
        used, innovation, nis = (read(f"{base}/{key}", y.size, m) for key in _OF_OBSERVERS)
        return RecordedOutput(taken, available, y, used != 0, innovation, nis)

    def _unseen(self, group: str) -> dict[str, Unseen]:
        if group not in self._file.file:
            return {}
        found = {}
        for name in self._file.group(group):
            y = self._file.numbers(f"{group}/{name}/y", None)
            found[str(name)] = Unseen(self._file.numbers(f"{group}/{name}/taken", y.size), y)
        return found

    def assessed(self, label: str, nt: int, n: int) -> Assessed:
        """The band of an observer, and its scores."""
        base = f"observers/{label}"
        lower, upper = (self._file.numbers(f"{base}/{key}", nt, n) for key in ("lower", "upper"))
        no_band = self._file.mapping("no_band", self._file.group(base))
        if not all(isinstance(text, str) for text in no_band.values()):
            raise self._file.error(f"{base}: attribute no_band must give a reason for every state")
        names = self._file.group(f"scores/{label}")
        return Assessed(lower, upper, no_band, {name: self._score(f"scores/{label}/{name}") for name in names})

    def _score(self, name: str) -> Mapping[str, float]:
        labels = self._file.labels(name)
        return dict(zip(labels, self._file.numbers(name, len(labels)).tolist(), strict=True))
