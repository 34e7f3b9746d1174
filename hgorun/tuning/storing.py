"""The evidence of a tuning as a file: everything that was tried, the front, and the held-out seeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from hgorun.result.hdf5.forms import TUNING
from hgorun.result.hdf5.sink import hdf5_written_whole
from hgorun.tuning.evidence import Evidence
from hgorun.version import __version__

_TEXT = h5py.string_dtype()


def save(found: Sequence[Evidence], path: Path, *, name: str, config: str) -> Path:
    """Write a file with a group for each task, called after what was tuned.

    ``scan/gains (candidate, gain)``, ``scan/values (candidate, seed, quantity)`` with NaN where a seed was not tried,
    ``front/candidate, gains, held_out (point, seed, quantity), confidence``, and the attributes ``gains, quantities,
    goals`` (how many of the quantities are minimised), ``seeds, held_out, chosen`` (the place of the knee or of the
    minimum in the front), ``runs, budget, ended`` (why runs are left).

    Raises
    ------
    HgorunError
        When the file cannot be written.
    """
    with hdf5_written_whole(path) as file:
        file.attrs["format"] = TUNING
        file.attrs["name"] = name
        file.attrs["config"] = config
        file.attrs["hgorun_version"] = __version__
        for one in found:
            _write(file.create_group(one.task.label, track_order=True), one)
    return path


def _write(group: h5py.Group, found: Evidence) -> None:
    task, trials = found.task, found.found.trials
    group.attrs["gains"] = np.array([gain.path for gain in task.gains], dtype=_TEXT)
    texts = [*(text for text, _ in task.goals), *(limit.text for limit in task.limits)]
    group.attrs["quantities"] = np.array(texts, dtype=_TEXT)
    group.attrs["goals"] = len(task.goals)
    group.attrs["seeds"], group.attrs["held_out"] = np.array(task.seeds), np.array(task.held_out)
    group.attrs["chosen"], group.attrs["runs"] = found.chosen, trials.spent
    group.attrs["budget"], group.attrs["ended"] = task.budget, found.found.ended
    for place, values in {
        "scan/gains": trials.gains,
        "scan/values": trials.values,
        "front/candidate": found.front,
        "front/gains": found.gains,
        "front/held_out": found.held_out,
        "front/confidence": found.confidence,
    }.items():
        group.create_dataset(place, data=values, track_times=False)
