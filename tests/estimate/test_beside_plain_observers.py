"""Estimates of random logs beside plain integrations: triangular plants, tanks, cascades and impulses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_jumps import Impulsive, ImpulsiveRiccati
from plain_logs import estimated, expected, random_input, random_samples, written
from plain_observers import Array, Cascade, Fhgo1, KineticRate, Plain, StandardRiccati, slopes, without_model


@dataclass(frozen=True)
class Case:
    """A plant with one recorded input, what is measured of it how often, and observers of it."""

    plant: Block
    start: dict[str, float]
    observers: dict[str, tuple[Block, Plain]]
    gaps: Sequence[float] = (0.2,)
    outputs: Sequence[str] = ("a",)
    input: str = "u"
    usual: tuple[float, float] = (0.0, 1.0)  # of the input: middle and size
    measured: tuple[float, float] = (0.0, 1.0)


def triangular(t: float, x: Array, u: float) -> Array:
    a, b, c = x
    db = (1 + 0.3 * np.sin(b)) * c - 0.1 * a * b
    return np.array([(1.2 + 0.5 * np.cos(a) + 0.2 * u) * b - 0.2 * np.sin(a), db, -c - np.sin(a * b) + u])


def blocks(t: float, x: Array, u: float) -> Array:
    a, b, c, d = x
    da = (1 + 0.3 * np.cos(a)) * b + 0.2 * u * d - 0.1 * c
    dc = d * (1 + 0.2 * np.sin(c)) + 0.1 * b * a
    return np.array([da, -np.sin(a) + 0.3 * c - 0.1 * b * d, dc, -c - 0.2 * a * b + u])


def chains(t: float, x: Array, u: float) -> Array:
    a, b, c, d = x
    return np.array([b, -np.sin(a) + 0.3 * c - 0.1 * b, d, -c - 0.2 * a * b + u])


def contois(t: float, x: Array, u: float) -> Array:
    growth = 1.064 * x[0] * x[1] / (4.39 * x[0] + x[1])
    return np.array([growth - u * x[0], -growth + u * (20 - x[1])])


def growth(t: float, x: Array, u: float) -> Array:
    """The map to the coordinates of a chain: biomass and its growth."""
    return np.array([x[0], 1.064 * x[0] * x[1] / (4.39 * x[0] + x[1])])


def by_slopes(x: Array, v: Array, u: float) -> Array:
    return np.asarray(x - np.linalg.solve(slopes(growth, 0.0, x, u), v))


def of_growth(z: Array) -> Array:
    return np.array([z[0], 4.39 * z[0] * z[1] / (1.064 * z[0] - z[1])])


def in_growth(t: float, z: Array, u: float) -> Array:
    x = of_growth(z)
    return np.asarray(slopes(growth, t, x, u) @ contois(t, x, u))


class ImpulsiveInGrowth(Impulsive):
    """It integrates z and jumps there."""

    def start(self, xhat: Array, u: float) -> Array:
        return growth(0.0, xhat, u)

    def xhat(self, z: Array, u: float) -> Array:
        return of_growth(z)


YIELDS = np.array([[-1.5, 0.3], [0.8, -0.5], [0.4, 1.1]])
TANK: Block = {
    "theta": 2.5,
    "gains": [1.4, 0.8],
    "yields": dict(zip("sxp", YIELDS.tolist(), strict=True)),
    "dilution": "D*(1 + 0.1*sin(t))",
    "feed": {"s": "2*D", "x": "0.1*cos(t)"},
}
RATES = KineticRate(
    without_model,
    [0, 2],
    2.5,
    K=YIELDS,
    dilution=lambda t, u: u * (1 + 0.1 * np.sin(t)),
    feed=lambda t, u: np.array([2 * u, 0.1 * np.cos(t), 0.0]),
    gains=(1.4, 0.8),
)
CASCADE = Cascade(
    without_model,
    [0],
    3.0,
    M=[1.0, 2.0],
    alpha=[2.0, 1.2, 0.7],
    of_derivatives=lambda z, u: np.array([z[0], z[1] + 0.2 * z[0], z[2] - u + 0.2 * z[1]]),
    to_derivatives=lambda x, u: np.array([x[0], x[1] - 0.2 * x[0], x[2] + u - 0.2 * (x[1] - 0.2 * x[0])]),
)
THREE, FOUR = {"a": 0.8, "b": 0.1, "c": 0.3}, {"a": 0.8, "b": 0.1, "c": 0.3, "d": -0.2}
CASES = {
    "triangular": Case(
        {
            "states": list(THREE),
            "dynamics": {
                "a": "(1.2 + 0.5*cos(a) + 0.2*u)*b - 0.2*sin(a)",
                "b": "(1 + 0.3*sin(b))*c - 0.1*a*b",
                "c": "-c - sin(a*b) + u",
            },
            "output": "a",
        },
        THREE,
        {
            "fhgo1": ({"theta": 2, "delta": 3}, Fhgo1(triangular, [0], 2.0)),
            "shgo_riccati": ({"theta": 2}, StandardRiccati(triangular, [0], 2.0)),
            "impulsive_riccati": ({"theta": 1, "r": 0.5}, ImpulsiveRiccati(triangular, [0], 1.0, r=0.5)),
        },
    ),
    "blocks": Case(
        {
            "states": list(FOUR),
            "dynamics": {
                "a": "(1 + 0.3*cos(a))*b + 0.2*u*d - 0.1*c",
                "b": "-sin(a) + 0.3*c - 0.1*b*d",
                "c": "d*(1 + 0.2*sin(c)) + 0.1*b*a",
                "d": "-c - 0.2*a*b + u",
            },
            "output": ["a", "c"],
        },
        FOUR,
        {
            "fhgo1": ({"theta": 1.5, "delta": 4}, Fhgo1(blocks, [0, 2], 1.5, delta=4.0)),
            "impulsive_riccati": ({"theta": 1}, ImpulsiveRiccati(blocks, [0, 2], 1.0)),
        },
        (0.15, 0.4),
        "ac",
    ),
    "tank": Case(
        {
            "states": list("sxp"),
            "dynamics": {"s": "-0.3*s + D*(2 - s)", "x": "0.1*x - D*x", "p": "-D*p"},
            "output": ["s", "p"],
        },
        {"s": 1.0, "x": 0.5, "p": 0.2},
        {"kinetic_rate": (TANK, RATES)},
        (0.15, 0.4),
        "sp",
        "D",
        (0.5, 0.1),
        (1.0, 0.3),
    ),
    "derivatives": Case(
        {
            "states": list(THREE),
            "dynamics": {"a": "b - 0.2*a", "b": "c + u", "c": "-0.6*c - b - sin(a)"},
            "output": "a",
        },
        THREE,
        {"cascade": ({"theta": 3, "M": [1, 2], "alpha": [2, 1.2, 0.7]}, CASCADE)},
    ),
    "chains": Case(
        {
            "states": list(FOUR),
            "dynamics": {"a": "b", "b": "-sin(a) + 0.3*c - 0.1*b", "c": "d", "d": "-c - 0.2*a*b + u"},
            "output": ["a", "c"],
        },
        FOUR,
        {"impulsive": ({"theta": 2}, Impulsive(chains, [0, 2], 2.0))},
        (0.15, 0.4),
        "ac",
    ),
    "contois": Case(
        {"type": "contois"},
        {"x1": 1.5, "x2": 12.0},
        {
            "impulsive": ({"theta": 1}, Impulsive(contois, [0], 1.0, lift=by_slopes)),
            "impulsive in z": (
                {"type": "impulsive", "theta": 1, "coordinates": "canonical"},
                ImpulsiveInGrowth(in_growth, [0], 1.0),
            ),
        },
        outputs=["x1"],
        input="D",
        usual=(0.5, 0.05),
        measured=(1.5, 0.05),
    ),
}


def compared(case: Case, seed: int, folder: Path) -> None:
    middle, size = case.measured
    samples = [(t, k, i, middle + size * y) for t, k, i, y in random_samples(seed, case.gaps, late=seed % 5 != 4)]
    u = random_input(seed, *case.usual)
    blocks, wanted = {}, {}
    for name, (block, plain) in case.observers.items():
        for late in ("replay",) if name.startswith("impulsive") else ("innovation", "replay"):
            blocks[f"{name} {late}"] = {"type": name, **block, "late": late, "initial": case.start}
            wanted[f"{name} {late}"] = expected(plain, samples, list(case.start.values()), u, late)
    data = written(folder, samples, case.outputs, {case.input: u})
    found = estimated(folder, {"plant": case.plant, "observers": blocks, "data": data})
    for label, one in wanted.items():
        np.testing.assert_allclose(found[label], one, rtol=0, atol=1e-12 * np.max(np.abs(one)), err_msg=label)


@pytest.mark.costly
@pytest.mark.parametrize("name", CASES)
def test_estimates_of_a_random_log(name: str, tmp_path: Path) -> None:
    compared(CASES[name], list(CASES).index(name), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_estimates_of_further_random_logs(name: str, tmp_path: Path) -> None:
    for seed in range(6, 16):
        compared(CASES[name], seed, tmp_path)
