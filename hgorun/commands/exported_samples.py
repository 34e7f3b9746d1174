"""A recording as lines of a stream: what ``hgorun estimate CONFIG -`` reads."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hgorun.commands.outputs import STDOUT
from hgorun.data.recording import Recording
from hgorun.files import write_text


def export_samples(recording: Recording, target: Path, *, quiet: bool = False) -> int:
    """Write the samples."""
    if target == STDOUT:
        for line in lines(recording):
            sys.stdout.write(line)
        return 0
    write_text(target, "".join(lines(recording)))
    if not quiet:
        print(f"written: {target}")
    return 0


def lines(recording: Recording) -> Iterator[str]:
    """``t,signal,y``, and ``available`` where samples come late, in the order in which they are known.

    Times count from the origin of the recording, values are in the units of the model. At one time inputs
    stand before outputs. Of several samples of an output with one time, the second ones stand behind the first ones of
    all outputs, as observers take them.
    """
    rows: list[tuple[float, int, int, float, str, float]] = []
    late = any(signal.late for signal in recording.outputs.values())
    for number, given in enumerate(recording.inputs.values()):
        rows += [
            (t, 0, number, t, given.name, y) for t, y in zip(given.times.tolist(), given.values.tolist(), strict=True)
        ]
    for number, signal in enumerate(recording.outputs.values(), start=len(recording.inputs)):
        times = np.column_stack([signal.available, signal.taken, signal.values]).tolist()
        before = Counter[tuple[float, float]]()
        for known, t, y in times:
            rows.append((known, before[known, t], number, t, signal.name, y))
            before[known, t] += 1
    rows.sort(key=lambda row: row[:4])
    yield "t,signal,y,available\n" if late else "t,signal,y\n"
    for known, _, _, t, name, y in rows:
        yield f"{t!r},{name},{y!r},{known!r}\n" if late else f"{t!r},{name},{y!r}\n"
