"""Estimates of random logs beside plain recursions: difference quotients, implicit steps, and a map fitted in a box."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_logs import estimated, expected, random_input, random_samples, written
from plain_observers import Array, Input, Plain, Sample, without_model
from plain_sampled import FromTheFirstSample, KklOfBox, ReducedOrder, forward_differences, implicit_levant
from plain_steps import Recursion

CHAIN: Block = {"states": list("abc"), "dynamics": {"a": "b", "b": "c", "c": "-0.6*c - b - sin(a) + u"}, "output": "a"}
SIX: Block = {
    "states": [f"x{i}" for i in range(1, 7)],
    "dynamics": {**{f"x{i}": f"x{i + 1}" for i in range(1, 6)}, "x6": "-x1 + u"},
    "output": "x1",
}
COUPLED: Block = {
    "states": list("abcd"),
    "dynamics": {
        "a": "-0.2*a + (1 + 0.3*sin(c))*b + 0.2*u*d",
        "b": "-sin(a) - b*d + 0.3*u",
        "c": "0.3*a*u + 0.4*b + (2 + cos(a))*d",
        "d": "-c - 0.2*a*b - 0.3*d",
    },
    "output": ["a", "c"],
}
MORE_MEASURED: Block = {
    "states": list("abc"),
    "dynamics": {"a": "-0.2*a + (1 + 0.3*sin(c))*b", "b": "-sin(a) - b + 0.3*u", "c": "0.3*a*u + 0.4*b"},
    "output": ["a", "c"],
}
THREE = {"a": 0.8, "b": 0.1, "c": 0.3}
FOUR = {**THREE, "d": -0.2}


def f_1(y: Array, u: float) -> Array:
    return np.array([-0.2 * y[0], 0.3 * y[0] * u])


def g(y: Array, u: float) -> Array:
    return np.array([[1 + 0.3 * np.sin(y[1]), 0.2 * u], [0.4, 2 + np.cos(y[0])]])


def f_2(y: Array, z: Array, u: float) -> Array:
    return np.array([-np.sin(y[0]) - z[0] * z[1] + 0.3 * u, -y[1] - 0.2 * y[0] * z[0] - 0.3 * z[1]])


def reduced(*H: float) -> ReducedOrder:
    return ReducedOrder(without_model, [0, 2], H=H or None, f_1=f_1, g=g, f_2=f_2, hidden=[1, 3])


GAINS = [2.0, 1.6, 0.4]
QUOTIENTS = Recursion(without_model, [0], n=3, step=forward_differences(0.9, GAINS))
FITTED = ReducedOrder(
    without_model,
    [0, 2],
    H=(1.0,),
    f_1=f_1,
    g=lambda y, u: np.array([[1 + 0.3 * np.sin(y[1])], [0.4]]),
    f_2=lambda y, z, u: np.array([-np.sin(y[0]) - z[0] + 0.3 * u]),
    hidden=[1],
)
CASES: dict[str, tuple[Block, dict[str, float], Block, Plain]] = {
    "hgo_fd": (CHAIN, THREE, {"eps": 0.9, "gains": GAINS}, QUOTIENTS),
    "hgo_sa": (CHAIN, THREE, {"eps": 0.9, "gains": GAINS}, QUOTIENTS),
    "levant": (
        SIX,
        {f"x{i}": 0.1 * i for i in range(1, 7)},
        {"G": 2, "discretisation": "implicit"},
        FromTheFirstSample(without_model, [0], n=6, step=implicit_levant(6, 2), implicit=True),
    ),
    "reduced_sampled": (COUPLED, FOUR, {"H": [1.0, 0.6]}, reduced(1.0, 0.6)),
    "deadbeat": (COUPLED, FOUR, {}, reduced()),
    "reduced_sampled of more": (MORE_MEASURED, THREE, {"H": 1}, FITTED),
}


def together(seed: int, outputs: Sequence[str]) -> list[Sample]:
    """Irregular and missing, of all outputs at the same times."""
    rng = np.random.default_rng(seed)
    rows = random_samples(seed, [0.15], late=False)
    more = [(t, k, 1, np.nan if np.isnan(y) else float(rng.normal())) for t, k, _, y in rows]
    return sorted([*rows, *more]) if len(outputs) > 1 else rows


@pytest.mark.costly
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 4))])
def test_estimates_of_a_random_log(name: str, seed: int, tmp_path: Path) -> None:
    """The first sample of seed 0 is taken at the start, that of seed 1 later."""
    plant, start, keys, plain = CASES[name]
    outputs = plant["output"] if isinstance(plant["output"], list) else [plant["output"]]
    samples, u = together(seed, outputs), random_input(seed)
    wanted = expected(plain, samples, list(start.values()), u, "innovation")
    block = {"type": name.partition(" ")[0], **keys, "initial": start}
    config = {"plant": plant, "observers": {"O": block}, "data": written(tmp_path, samples, outputs, {"u": u})}
    found = estimated(tmp_path, config)["O"]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * np.max(np.abs(wanted)))


@pytest.mark.costly
@pytest.mark.parametrize("first", [2, pytest.param(0, marks=pytest.mark.slow)])
def test_kkl_of_samples_with_a_map_fitted_in_a_box(first: int, tmp_path: Path) -> None:
    """Coefficients of some hundreds amplify the errors of two integrations."""
    T, lam, box = 0.2, np.array([2.0, 3.5, 5.0]), {"a": [-1.2, 1.2], "b": [-1.2, 1.2]}
    axis = np.linspace(-1.2, 1.2, 7)
    points = np.stack([one.ravel() for one in np.meshgrid(axis, axis, indexing="ij")], axis=1)
    plain = KklOfBox(lambda t, x, u: np.array([x[1], -x[0] - x[0] ** 3]), [0], lam=1.2 * lam, T=T, points=points)
    rng = np.random.default_rng(3)
    times = [round(T * k, 4) for k in range(first, 11)]
    samples = [(t, t, 0, float(np.cos(t) + 0.05 * rng.normal())) for t in times]
    wanted = expected(plain, samples, [0.4, -0.3], Input(), "innovation")
    keys = {"type": "kkl", "theta": 1.2, "lam": lam.tolist(), "box": box, "grid": 7, "initial": {"a": 0.4, "b": -0.3}}
    plant = {"states": ["a", "b"], "dynamics": {"a": "b", "b": "-a - a**3"}, "output": "a"}
    config = {"plant": plant, "observers": {"O": keys}, "data": written(tmp_path, samples, "a", {})}
    np.testing.assert_allclose(estimated(tmp_path, config)["O"], wanted, rtol=0, atol=2e-6)
