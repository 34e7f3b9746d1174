"""Exported C on random logs, irregular, late, missing and of two rates: the estimates of ``hgorun estimate``."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from exported_c import COMPILERS, NATIVE, Compiled, compile_c, sizes
from plain_logs import END, TIMES, estimated, random_input, random_samples, written
from plain_observers import Array, Input, Sample

from hgorun.config.reading import read_source
from hgorun.estimate.completed import completed
from hgorun.estimate.log import log_of
from hgorun.estimate.prepared import prepare_estimate
from hgorun.export.c_files import c_files
from hgorun.export.prepared import exported_estimate
from hgorun.observers.base import CorrectedObserver, SampledObserver

PAIR: Block = {
    "states": list("abcd"),
    "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b + u"},
    "output": ["a", "c"],
}
FILTER: Block = {"Q": {"b": 0.3, "d": 0.2}, "R": {"a": 0.3, "c": 0.4}}
FLOWING: dict[str, Block] = {
    "shgo": {"theta": 2},
    "fhgo2": {"theta": 2, "r": 2},
    "integral": {"theta": 1.7, "r": 1},
    "lowpass": {"theta": 1.7, "r": 1, "rho": 0.2},
    "treangle": {"theta": 2},
    "extended": {"theta": 1.5},
    "updated": {"theta_0": 1, "theta_max": 4, "delta": 0.3},
    "dead_zone": {"theta": 2, "lam": 0.7, "rho": 0.5},
    "stubborn": {"theta": 2, "lam": 0.7, "rho": 1.5, "internal": {"sigma": 0.3}},
    "homogeneous": {"theta": 1.5, "d0": -0.2, "dinf": 0.3},
    "fhgo1": {"theta": 1.5, "delta": 4},
    "shgo_riccati": {"theta": 1.5},
    "kalman_bucy": FILTER,
}
JUMPING: dict[str, Block] = {"impulsive": {"theta": 1}, "impulsive_riccati": {"theta": 1}, "ekf": FILTER}
CHAIN: Block = {
    "states": list("abc"),
    "dynamics": {"a": "b", "b": "c + 0.3*u", "c": "-0.5*a - b - 0.6*c + u"},
    "output": "a",
}
LOW: Block = {"states": ["a", "b"], "dynamics": {"a": "b - 0.2*a", "b": "-sin(a) - 0.3*b + u"}, "output": "a"}
RELAY: Block = {"L": 2, "discretisation": "explicit"}
INJECTED: Block = {"l": [2, 1], "a": 1.17, "b": 2.3, "q": 0.15, "gamma": "0.3*y**2", "phi": 6, "G": 2}
OF_CHAIN: dict[str, Block] = {
    "savgol": {"window": 6, "degree": 3},
    "algebraic": {"window": 6},
    "levant": {"G": 2},
    "red": {"L": 2},
    "hybrid_red": {"M": 1.5, **RELAY},
    "filtering": {"n_f": 2, **RELAY},
    "aekf": {"update": "jump", "theta_1": 2, "dT": 0.2, "lam": 0.3, "m": 0.5, "copies": 3},
    "luenberger_exact": {"poles": [-1, -2, -3]},
}
OF_LOW: dict[str, Block] = {"direct": {"theta": 2, "l": [2, 1.5], "mu": 0.7, "phi": 6, "G": 2}}
OF_LOW |= {"direct_dynamic": {**INJECTED, "mu_0": 0.7}, "reduced_sampled": {"H": 0.6}, "deadbeat": {}}
DERIVED: dict[str, tuple[Block, dict[str, float], dict[str, Block]]] = {
    "chain": (CHAIN, {"a": 0.8, "b": 0.1, "c": 0.3}, OF_CHAIN),
    "low": (LOW, {"a": 0.8, "b": 0.1}, OF_LOW),
}


def followed(one: Compiled, samples: Sequence[Sample], u: Input) -> Array:
    """The estimates at the times of `TIMES` of a compiled observer that is told what becomes known, when it does."""
    q = len(one.observer.outputs)
    found, newest = [], [-1.0] * q
    jumps = isinstance(one.observer.design.observer, (CorrectedObserver, SampledObserver))
    for t in sorted({*TIMES, *u.times, *(t for s in samples for t in s[:2])}):
        assert one.predict(t) == 0
        if t in u.times:
            assert one.input(t, [u(t, t)]) == 0
            if u.linear and t < END:
                after = min(later for later in u.times if later > t)
                assert one.input(after, [u(after, after)]) == 0
        now = {i: (taken, y) for taken, known, i, y in sorted(samples) if known == t}
        if jumps and now:
            y = [now[i][1] if i in now else 0.0 for i in range(q)]
            assert one.update(t, y, sum(1 << i for i in now)) == 0
        for taken, known, i, y_i in [] if jumps else sorted(samples):
            if known == t:
                assert one.update(taken, [y_i] * q, 1 << i) == (0 if taken >= newest[i] else 1)
                newest[i] = max(newest[i], taken)
        if t in TIMES:
            found.append(one.estimate)
    return np.array(found)


def compared(
    blocks: dict[str, Block],
    samples: Sequence[Sample],
    u: Input,
    folder: Path,
    *compiler: str,
    plant: Block = PAIR,
    start: dict[str, float] | None = None,
) -> None:
    """Compiler and options: gcc or clang first."""
    start = {"a": 0.8, "b": 0.1, "c": 0.3, "d": -0.2} if start is None else start
    observers = {kind: {"type": kind, **block, "initial": start} for kind, block in blocks.items()}
    data = written(folder, samples, plant["output"], {"u": u})
    expected = estimated(folder, {"plant": plant, "observers": observers, "data": data})
    text, source = read_source(folder / "config.yaml", ())
    recording = log_of(source, folder / "config.yaml").read()
    exported = exported_estimate(prepare_estimate(completed(source, recording, "config", text), recording))
    files = {name: content for one in exported for name, content in c_files(one).items()}
    files["sizes.c"] = sizes([one.name for one in exported])
    library = ctypes.CDLL(str(compile_c(folder, files, *compiler[1:], compiler=compiler[0])))
    told = [s for s in samples if s[1] <= END and not np.isnan(s[3])]
    for one in exported:
        own = followed(Compiled(library, one), told, u)
        largest = np.max(np.abs(expected[one.name]))
        np.testing.assert_allclose(own, expected[one.name], rtol=0, atol=1e-12 * largest, err_msg=one.name)


def drawn(seed: int, *, late: bool) -> tuple[list[Sample], Input]:
    return random_samples(seed, [0.15, 0.4], late=late), random_input(seed)


@pytest.mark.costly
@pytest.mark.parametrize("late", [False, True])
def test_c_gives_the_estimates_of_a_random_log(late: bool, tmp_path: Path) -> None:
    few = {kind: FLOWING[kind] for kind in ("fhgo2", "stubborn")} if late else {"ekf": FILTER}
    compared(few, *drawn(1, late=late), tmp_path, "gcc", "-O0")


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("late", [False, True])
def test_c_gives_the_estimates_of_further_random_logs(compiler: str, late: bool, tmp_path: Path) -> None:
    for seed in range(2, 6):
        folder = tmp_path / str(seed)
        folder.mkdir()
        compared(FLOWING if late else {**FLOWING, **JUMPING}, *drawn(seed, late=late), folder, compiler, *NATIVE)


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("plant", DERIVED)
def test_c_of_observers_that_differentiate_or_step_gives_the_estimates_of_a_log(
    compiler: str, plant: str, tmp_path: Path
) -> None:
    """Of samples with one period, as some of them need."""
    block, start, observers = DERIVED[plant]
    rng = np.random.default_rng(1)
    samples = [(t, t, 0, float(rng.normal())) for t in np.round(0.1 + 0.2 * np.arange(10), 4).tolist()]
    compared(observers, samples, random_input(1), tmp_path, compiler, *NATIVE, plant=block, start=start)
