"""Random logs of irregular samples, late in any order and some missing, in files, and the estimates of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml
from examples import Block
from plain_observers import Array, Input, Log, Plain, Sample

from hgorun.config.reading import read_source
from hgorun.estimate.estimate import estimate
from hgorun.estimate.log import log_of

END, STEP = 2.0, 0.04
TIMES = [0.0, 1.0, 2.0]


def random_samples(seed: int, gaps: Sequence[float], *, late: bool = True) -> list[Sample]:
    """Of outputs with mean gaps: known together, in another order or not before the end; NaN where one is missing."""
    rng = np.random.default_rng(seed)
    found: list[Sample] = []
    for i, gap in enumerate(gaps):
        taken = np.round(np.cumsum(gap * rng.uniform(0.1, 2.5, int(END / gap) + 3)), 4)
        if seed % 3 == 0:
            taken = np.append(0.0, taken)
        taken = taken[taken < END]
        lateness = 3 * gap * rng.uniform(0, 1, taken.size) * (rng.random(taken.size) < 0.6)
        known = np.round(taken + (lateness if late else 0.0), 4)
        if late and taken.size > 6:
            known[2:5], known[-1] = known[2:5].max(), END + 1
        y = np.where(rng.random(taken.size) > 0.15, rng.normal(size=taken.size), np.nan)
        y[0] = rng.normal()
        found += zip(taken.tolist(), known.tolist(), [i] * taken.size, y.tolist(), strict=True)
    first = min(found)[0]
    if len(gaps) > 1 and (first, 1) not in [(t, i) for t, _, i, _ in found]:  # two that are taken together
        found.append((first, first + 0.2 * late, 1, 0.7))
    return sorted(found)


def random_input(seed: int, middle: float = 0.0, size: float = 1.0) -> Input:
    """Held or linear, with values at the times that are looked at, where steps end then."""
    rng = np.random.default_rng(1000 + seed)
    times = np.unique(np.round([*np.arange(0, END + 0.1, 0.5), *rng.uniform(0, END, 8)], 4))
    return Input(times.tolist(), (middle + size * rng.normal(size=times.size)).tolist(), linear=seed % 2 == 1)


def written(folder: Path, samples: Sequence[Sample], outputs: Sequence[str], inputs: Mapping[str, Input]) -> Block:
    """Each signal in a file of its own; the block `data` of them."""
    data: Block = {"outputs": {}, "inputs": {}}
    for i, name in enumerate(outputs):
        own = [(t, k, "" if np.isnan(y) else y) for t, k, j, y in samples if j == i]
        lines = "\n".join(["t,known,y", *(f"{t!r},{k!r},{y}" for t, k, y in own), ""])
        (folder / f"{name}.csv").write_text(lines)
        data["outputs"][name] = {"file": f"{name}.csv", "column": "y", "time": "t", "std": 0.1}
        if any(t != k for t, k, _ in own):
            data["outputs"][name]["available"] = "known"
    for name, u in inputs.items():
        lines = "\n".join(["t,u", *(f"{t!r},{v!r}" for t, v in zip(u.times, u.values, strict=True)), ""])
        (folder / f"{name}.csv").write_text(lines)
        hold = "linear" if u.linear else "zero"
        data["inputs"][name] = {"file": f"{name}.csv", "column": "u", "time": "t", "hold": hold}
    return data


def estimated(folder: Path, config: Block) -> dict[str, Array]:
    """What ``hgorun estimate`` makes of files in a folder, by observer."""
    file = folder / "config.yaml"
    common = {"time": {"start": 0, "end": END, "output_step": 1.0}, "solver": {"method": "rk4", "step": STEP}}
    file.write_text(yaml.safe_dump({**common, **config}, sort_keys=False))
    _, source = read_source(file, ())
    result = estimate(source, log_of(source, file).read(), sensitivity=False)
    assert result.status == "ok"
    return {label: one.xhat for label, one in result.observers.items()}


def expected(plain: Plain, samples: Sequence[Sample], start: Sequence[float], u: Input, late: str) -> Array:
    """What plain NumPy makes of them."""
    log = Log([s for s in samples if s[1] <= END and not np.isnan(s[3])], TIMES, start, u, STEP)
    return log.replayed(plain) if late == "replay" else log.by_innovation(plain)
