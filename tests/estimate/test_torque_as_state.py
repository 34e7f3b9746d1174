"""A load torque on logs: as ``sigma`` of `extended`, as that of `shgo`, and as a state of the plant, which is the same.

What they are compared with shares no code with them: between two events the estimates of a linear plant are an
exponential of a matrix. With the innovation e = C xhat(t_k) - y_k + alpha(t) - alpha(t_k), alpha' = -K_1 e, it is

    xhat' = A xhat + b u + B sigma - K e,    sigma' = -K_3 e,    e' = -K_1 e.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from examples import Block
from plain import as_text
from recordings import assessed_of, held_input, recorded_of, recording, signal, source
from scipy.linalg import expm

from hgorun.estimate.estimate import estimate

FRICTION, GAIN, INERTIA, THETA, STD, GATE = 0.4, 1.5, 0.8, 2.0, 0.02, 5.0
POLES = [-1.0, -1.5 + 0.5j, -1.5 - 0.5j]
K = np.poly(POLES).real[1:] * THETA ** np.arange(1, 4)
STEP = 1 / 64  # all times are multiples of it
START = np.array([0.2, -0.3])
MOTOR: Block = {
    "states": ["phi", "w"],
    "parameters": {"d": FRICTION, "k": GAIN},
    "inputs": {"u": "0"},
    "dynamics": {"phi": "w", "w": "k*u - d*w"},
    "output": "phi",
}
LOADED: Block = {
    **MOTOR,
    "states": ["phi", "w", "TL"],
    "parameters": {**MOTOR["parameters"], "J": INERTIA},
    "dynamics": {"phi": "w", "w": "k*u - d*w - TL/J", "TL": "0"},
}


@dataclass
class Log:
    """Samples of the angle, when each is known, and a held input."""

    taken: np.ndarray
    known: np.ndarray
    y: np.ndarray
    times: np.ndarray
    u: np.ndarray


def even() -> Log:
    """As a controller has them, with a torque that steps."""
    t = np.arange(0, 256, 8) * STEP
    return Log(t, t, angle(t), t[::4], np.sin(t[::4]))


def sparse_and_late() -> Log:
    """At irregular times, some known later, none behind a newer one; the input changes between them."""
    random = np.random.default_rng(5)
    t = np.cumsum(random.choice([3, 8, 21, 40], 24)) * STEP
    late = np.minimum(random.integers(0, 12, t.size) * STEP, np.append(np.diff(t), 1.0) - STEP)
    times = np.cumsum(np.append(0, random.integers(5, 60, 20))) * STEP
    return Log(t, t + late, angle(t), times, random.normal(size=times.size))


def with_outliers() -> Log:
    """Of which a gate leaves some out, and one that it takes."""
    one = even()
    one.y[[4, 5, 17, 26]] += [3.0, -1.0, 0.9, 0.05]
    return one


def angle(t: np.ndarray) -> np.ndarray:
    return np.sin(1.1 * t) + 0.3 * t + STD * np.random.default_rng(1).normal(size=t.size)


def exact(log: Log, gate: float | None) -> tuple[np.ndarray, np.ndarray]:
    """(phi, w, sigma) after each event, sorted by time, and which samples are used, as their innovations decide."""
    M = np.zeros((6, 6))  # of phi, w, sigma, e, alpha, u
    M[0, 1], M[1, 1], M[1, 2], M[1, 5] = 1.0, -FRICTION, 1.0, GAIN
    M[[0, 1, 2, 3, 4], 3] = -np.array([*K, K[0], K[0]])
    z, t = np.array([*START, 0.0, 0.0, 0.0, log.u[0]]), 0.0
    kept: dict[int, float] = {}
    sizes, used, found = list[float](), np.ones(log.y.size, dtype=bool), []
    events = [(float(at), 0, k) for k, at in enumerate(log.times)] + [
        (float(at), 1, k) for k, at in enumerate(log.taken)
    ]
    for at, kind, k in sorted([*events, *((float(at), 2, k) for k, at in enumerate(log.known))]):
        z, t = expm(M * (at - t)) @ z, at
        if kind == 0:
            z[5] = log.u[k]
        elif kind == 1:
            kept[k] = z[0] - z[4]
        else:
            e = kept[k] + z[4] - log.y[k]
            n = min(len(sizes), 61)
            scale = max(1.4826 * float(np.median(sizes[-n:])) * max(8 / n, 1), STD) if n >= 2 else np.inf
            used[k] = gate is None or abs(e) <= gate * scale
            sizes.append(abs(e))
            z[3] = e if used[k] else z[3]
            found.append(z[:3].copy())
    return np.array(found), used


@pytest.mark.costly
@pytest.mark.parametrize(("log", "gate"), [(even(), None), (sparse_and_late(), None), (with_outliers(), GATE)])
def test_a_torque_is_estimated_alike_however_it_is_said(log: Log, gate: float | None) -> None:
    wanted, used = exact(log, gate)
    assert np.all(used) == (gate is None)
    start = dict(zip(("phi", "w"), START.tolist(), strict=True))
    block: Block = {"theta": THETA, "poles": as_text(POLES), "initial": start}
    plants: list[tuple[Block, dict[str, Block]]] = [
        (MOTOR, {"E": {"type": "extended", **block}, "S": {"type": "shgo", "extend": 1, **block}}),
        (LOADED, {"T": {"type": "shgo", **block, "initial": {**start, "TL": 0.0}}}),
    ]
    out = signal("phi", log.taken, log.y, log.known, gate=gate, std=None if gate is None else STD)
    for plant, observers in plants:
        time = {"start": 0.0, "end": float(log.known[-1]), "output_step": STEP}
        config = {
            "plant": plant,
            "observers": observers,
            "time": time,
            "solver": {"step": STEP / 2, "method": "dopri5"},
        }
        result = estimate(source(config), recording(out, u=held_input("u", log.times, log.u)), sensitivity=False)
        at = np.rint(log.known / STEP).astype(int)
        for label, one in result.observers.items():
            torque = (
                -one.xhat[at, 2] / INERTIA if label == "T" else one.internal["sigma"].reshape(len(one.xhat), -1)[at, 0]
            )
            found = np.column_stack([one.xhat[at, :2], torque])
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9, err_msg=label)
            assert assessed_of(result, label).scores.get("gated", {}).get("phi", 0) == np.count_nonzero(~used)
        assert np.array_equal(recorded_of(result).outputs["phi"].used.all(axis=1), used)
