"""Estimates of random logs beside plain integrations: what decides, adapts, reconstructs or looks back at samples."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from examples import Block
from plain_decisions import Adaptive, AdaptiveAtSamples, Bank, Reconstructed, Switched
from plain_logs import END, estimated, expected, random_input, random_samples, written
from plain_observers import Array, Input, Plain, Sample
from plain_steps import (
    Algebraic,
    Derivatives,
    Horizon,
    Kkl,
    Levant,
    Luenberger,
    Recursion,
    SavitzkyGolay,
    Spline,
    filtering,
    hybrid_red,
    implicit_red,
    quotients,
    red,
    tracking,
)

Case = tuple[Block, Plain, tuple[str, ...]]  # the observer's block, the same as plain NumPy, late samples
BOTH, BACK, LEFT = ("innovation", "replay"), ("replay",), ("drop",)


def jerk(t: float, x: Array, u: float) -> Array:
    return np.array([x[1], x[2], -0.6 * x[2] - x[1] - np.sin(x[0]) + u])


def pair(t: float, x: Array, u: float) -> Array:
    a, b, c, d = x
    return np.array([b, -np.sin(a) + 0.3 * c - 0.1 * b, d, -c - 0.2 * a * b + u])


def low(t: float, x: Array, u: float) -> Array:
    return np.array([x[1] - 0.2 * x[0] + 0.3 * u, -np.sin(x[0]) - 0.3 * x[1]])


def swing(t: float, x: Array, u: float) -> Array:
    return np.array([x[1], -np.sin(x[0]) - 0.3 * x[1]])


MATRIX = np.array([[0, 1, 0], [0, 0, 1], [-0.5, -1, -0.6]])


def linear(t: float, x: Array, u: float) -> Array:
    return np.asarray(MATRIX @ x + np.array([0, 0.3, 1]) * u)


def plant(output: str | Sequence[str], **dynamics: str) -> Block:
    return {"states": list(dynamics), "dynamics": dynamics, "output": output}


JERK = plant("a", a="b", b="c", c="-0.6*c - b - sin(a) + u")
PAIR = plant(["a", "c"], a="b", b="-sin(a) + 0.3*c - 0.1*b", c="d", d="-c - 0.2*a*b + u")
LOW = plant("a", a="b - 0.2*a + 0.3*u", b="-sin(a) - 0.3*b")
CHAIN = plant("a", a="b - 0.2*a", b="c + u", c="-0.6*c - b - sin(a)")
SWING = plant("a", a="b", b="-sin(a) - 0.3*b")
LINEAR = plant("a", a="b", b="c + 0.3*u", c="-0.5*a - b - 0.6*c + u")
OSCILLATOR = plant("a", a="b", b="-a - 0.3*b")

COSTS: Block = {"theta_1": 2.0, "dT": 0.2, "lam": 0.3, "m": 0.5, "beta": 12.0}
BANK: Block = {"observer": {"type": "shgo"}, "thetas": [2, 4, 1], "nu": 3, "lam1": 0.8, "lam2": 0.02, "eps": 0.8}
THREE_MODES = Bank(pair, [0, 2], thetas=(2, 4, 1), nu=3, lam=(0.8, 0.02), eps=0.8)
OFTEN: Block = {"thetas": [2, 8, 1, 4], "nu": 8, "eps": 0.97}  # modes begin anew, and are shown later
RESET = Bank(pair, [0, 2], thetas=(2, 8, 1, 4), nu=8, lam=(0.8, 0.02), eps=0.97, reset=True)
TWO: Mapping[str, Case] = {
    "switched": (
        {"theta_1": 3, "theta_2": 1, "delta": {"a": 1.2, "c": 1.5}, "dwell": 0.4},
        Switched(pair, [0, 2], thetas=(3, 1), delta=[1.2, 1.5], dwell=0.4),
        BOTH,
    ),
    "bank": (BANK, THREE_MODES, BACK),
    "bank with reset": ({**BANK, **OFTEN, "reset": True}, RESET, BACK),
    "aekf": (
        {**COSTS, "window": 0.8, "copies": 4},
        Adaptive(pair, [0, 2], Q=np.eye(4), R=np.eye(2), d=0.8, N=4, **COSTS),
        BOTH,
    ),
}


class Keeping(Bank):
    """What it is not: at a reset every mode keeps the innovation of the estimate that it had."""

    def decided(self, z: Array, e: Array, t: float) -> Array:
        _, kept, _, _ = self.parts(z)
        x, _, eta, mode = self.parts(super().decided(z, e, t))
        return self.whole(x, kept, eta, mode)


def derivatives(x: Array, u: float) -> Array:
    """Of the output of CHAIN."""
    return np.array([x[0], x[1] - 0.2 * x[0], x[2] + u - 0.2 * (x[1] - 0.2 * x[0])])


def of_derivatives(z: Array, u: float) -> Array:
    return np.array([z[0], z[1] + 0.2 * z[0], z[2] - u + 0.2 * z[1]])


def of_low(z: Array, u: float) -> Array:
    return np.array([z[0], z[1] + 0.2 * z[0] - 0.3 * u])


def on_chain(kind: type[Derivatives], **keys: object) -> Derivatives:
    return kind(jerk, [0], n=3, back=of_derivatives, there=derivatives, **keys)  # type: ignore[arg-type]  # any keys


BLEND: Block = {"phi": 6, "G": 2}
DYNAMIC: Block = {"l": [2, 1], "a": 1.17, "b": 2.3, "q": 0.15, "gamma": "0.3*y**2", "internal": {"theta": 1.5}}


def reconstructed(*gain: float, theta: float, mu: float = 0.0, dynamic: bool = False) -> Reconstructed:
    plain = Reconstructed(low, [0], theta, l=np.array(gain), back=of_low, mu=mu, phi=6, G=2)
    if dynamic:
        plain.dynamic, plain.gamma = (1.17, 2.3, 0.15), lambda y: 0.3 * y**2
    return plain


INJECTED: Mapping[str, Case] = {
    "direct": ({"theta": 2, "l": [2, 1.5], "mu": 0.7, **BLEND}, reconstructed(2, 1.5, theta=2, mu=0.7), BOTH),
    "dynamic_gain": (DYNAMIC, reconstructed(2, 1, theta=1.5, dynamic=True), BOTH),
    "direct_dynamic": (
        {**DYNAMIC, **BLEND, "mu_0": 0.7},
        reconstructed(2, 1, theta=1.5, mu=0.7, dynamic=True),
        BOTH,
    ),
}
FITTED: Mapping[str, Case] = {
    "savgol": ({"window": 6, "degree": 3}, on_chain(SavitzkyGolay, window=6, degree=3), BACK),
    "algebraic": ({"window": 6}, on_chain(Algebraic, window=6), BACK),
    "algebraic of other ends": (
        {"window": 7, "kappa": 1, "mu": 2},
        on_chain(Algebraic, window=7, ends=(1, 2)),
        BACK,
    ),
    "levant": ({"G": 2}, on_chain(Levant, G=2), BOTH),
}
STEPPED: Mapping[str, Case] = {
    "red": ({"L": 2}, on_chain(Recursion, step=implicit_red(2, 2), implicit=True, shown=quotients), LEFT),
    "red proper": ({"L": 2, "discretisation": "proper"}, on_chain(Recursion, step=red(2, 2, exact=True)), LEFT),
    "red explicit": ({"L": 2, "discretisation": "explicit"}, on_chain(Recursion, step=red(2, 2, exact=False)), LEFT),
    "hybrid_red": (
        {"L": 2, "M": 1.5, "discretisation": "proper"},
        on_chain(Recursion, step=hybrid_red(2, 2, 1.5, exact=True)),
        LEFT,
    ),
    "filtering": (
        {"L": 2, "n_f": 2, "discretisation": "explicit"},
        on_chain(Recursion, step=filtering(2, 2, 2, exact=False), more=2),
        LEFT,
    ),
}
FOLLOWED: Mapping[str, Case] = {
    "tracking": ({"r": 3, "h_0": 2}, Recursion(swing, [0], step=tracking(3, 2)), LEFT),
    "mhe": (
        {"window": 4, "Q": {"a": 0.2, "b": 0.3}, "R": {"a": 0.4}, "iterations": 2},
        Horizon(swing, [0], Q=np.diag([0.2, 0.3]), R=np.eye(1) * 0.4, N=4, iterations=2),
        BACK,
    ),
}
PRESENT = 7 / 9  # of the gaps of 0.2 s: samples of each output are 9/7 times as far apart in the mean
AT_SAMPLES: Mapping[str, Case] = {
    "aekf": (
        {"update": "jump", **COSTS, "copies": 3},
        AdaptiveAtSamples(linear, [0], length=3, Q=np.eye(3), R=PRESENT * np.eye(1), d=0.6, N=3, **COSTS),
        BACK,
    ),
    "luenberger_exact": (
        {"poles": ["-1+2j", "-1-2j", -2]},
        Luenberger(linear, [0], A=MATRIX, C=np.eye(3)[:1], poles=[-1 + 2j, -1 - 2j, -2], T=0.2),
        BACK,
    ),
}
TWO_AT_SAMPLES: Mapping[str, Case] = {
    "aekf": (
        {"update": "jump", **COSTS, "copies": 3},
        AdaptiveAtSamples(pair, [0, 2], Q=np.eye(4), R=PRESENT * np.eye(2), d=0.6, N=3, **COSTS),
        BACK,
    ),
}
PERIOD = 0.2
LOST = {(3, 0), (6, 0), (6, 1), (8, 1)}  # samples of outputs
THREE = {"a": 0.8, "b": 0.1, "c": 0.3}
GROUPS: Mapping[str, tuple[Block, dict[str, float], Sequence[str], Sequence[float], Mapping[str, Case]]] = {
    "two outputs": (PAIR, {**THREE, "d": -0.2}, "ac", [0.15, 0.4], TWO),
    "injected": (LOW, {"a": 0.8, "b": 0.1}, "a", [0.2], INJECTED),
    "fitted": (CHAIN, THREE, "a", [0.15], FITTED),
    "stepped": (CHAIN, THREE, "a", [0.15], STEPPED),
    "followed": (SWING, {"a": 0.8, "b": 0.1}, "a", [0.2], FOLLOWED),
    "at samples": (LINEAR, THREE, "a", [], AT_SAMPLES),
    "two at samples": (PAIR, {**THREE, "d": -0.2}, "ac", [], TWO_AT_SAMPLES),
}


def of_one_period(seed: int, outputs: int) -> list[Sample]:
    """Some late and in another order, all known at the end; a few are lost."""
    rng, found = np.random.default_rng(seed), []
    for k in range(10):
        t = round(0.1 + PERIOD * k, 4)
        known = t if rng.random() < 0.4 else round(min(t + 0.6 * rng.random(), END), 4)
        found += [(t, known, i, float(rng.normal())) for i in range(outputs) if (k, i) not in LOST]
    return found


def drawn(group: str, seed: int) -> tuple[list[Sample], Input]:
    block, _, outputs, gaps, _ = GROUPS[group]
    if not gaps:
        return of_one_period(seed, len(outputs)), random_input(seed)
    samples = random_samples(seed, gaps, late=seed % 5 != 4)
    if "u" in str(block["dynamics"]):
        return samples, random_input(seed)
    # samples at the times that are looked at, where steps end then
    return sorted([*samples, (1.0, 1.0, 0, 0.3), (2.0, 2.0, 0, -0.4)]), Input()


def of_log(plain: Plain, samples: Sequence[Sample], start: Sequence[float], u: Input, late: str) -> Array:
    if late != "drop":
        return expected(plain, samples, start, u, late)
    return expected(plain, [s for s in samples if s[0] == s[1]], start, u, "innovation")


def compared(group: str, names: Sequence[str], seed: int, folder: Path) -> None:
    block, start, outputs, _, cases = GROUPS[group]
    samples, u = drawn(group, seed)
    observers, wanted = {}, {}
    for name in names:
        keys, plain, treatments = cases[name]
        for late in treatments:
            own = {"type": name.partition(" ")[0], **keys, "late": late, "initial": start}
            observers[f"{name} {late}"] = own
            wanted[f"{name} {late}"] = of_log(plain, samples, list(start.values()), u, late)
    data = written(folder, samples, outputs, {"u": u} if len(u.times) > 1 else {})
    found = estimated(folder, {"plant": block, "observers": observers, "data": data})
    for label, one in wanted.items():
        np.testing.assert_allclose(found[label], one, rtol=0, atol=1e-12 * np.max(np.abs(one)), err_msg=label)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("group", "name"),
    [
        ("two outputs", "bank with reset"),
        ("injected", "direct_dynamic"),
        ("fitted", "algebraic"),
        ("stepped", "red"),
        ("at samples", "luenberger_exact"),
        ("two at samples", "aekf"),
    ],
)
def test_estimates_of_a_random_log(group: str, name: str, tmp_path: Path) -> None:
    compared(group, [name], 0, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_estimates_of_further_random_logs(group: str, tmp_path: Path) -> None:
    for seed in (4, 5):
        compared(group, list(GROUPS[group][-1]), seed, tmp_path)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("name", "without"),
    [
        ("switched", Switched(pair, [0, 2], thetas=(3, 3), delta=[9, 9])),
        ("switched", Switched(pair, [0, 2], thetas=(1, 1), delta=[9, 9])),
        ("bank", Bank(pair, [0, 2], thetas=(2,), nu=3)),
        ("bank with reset", replace(RESET, reset=False)),
        ("bank with reset", Keeping(**vars(RESET))),
        ("aekf", Adaptive(pair, [0, 2], Q=np.eye(4), R=np.eye(2), d=9, **COSTS)),
    ],
)
def test_what_the_plain_observers_decide_matters(name: str, without: Plain) -> None:
    """Otherwise the comparison says nothing of it."""
    (samples, u), start = drawn("two outputs", 0), list(GROUPS["two outputs"][1].values())
    difference = expected(TWO[name][1], samples, start, u, "innovation") - expected(
        without, samples, start, u, "innovation"
    )
    assert np.max(np.abs(difference)) > 0.01


def test_the_spline_of_a_random_log(tmp_path: Path) -> None:
    """A start of the variance 1e8 costs half of the digits, which plain NumPy loses likewise."""
    samples, u = drawn("fitted", 3)
    keys = {"type": "spline", "smoothing": 1e-3, "late": "replay", "initial": THREE}
    config = {"plant": CHAIN, "observers": {"O": keys}, "data": written(tmp_path, samples, "a", {"u": u})}
    wanted = of_log(on_chain(Spline, smoothing=1e-3), samples, list(THREE.values()), u, "replay")
    np.testing.assert_allclose(estimated(tmp_path, config)["O"], wanted, rtol=1e-8, atol=1e-8)


def test_kkl_of_samples_of_a_linear_plant(tmp_path: Path) -> None:
    """With samples at the times that are looked at, where steps end then."""
    rng = np.random.default_rng(3)
    samples = [(round(PERIOD * k, 4), round(PERIOD * k, 4), 0, float(rng.normal())) for k in range(11)]
    start = {"a": 0.8, "b": 0.1}
    A = np.array([[0, 1], [-1, -0.3]])
    plain = Kkl(swing, [0], 1.5, A=A, C=np.eye(2)[:1], lam=(1, 2, 3, 4, 5), T=PERIOD)
    keys = {"type": "kkl", "theta": 1.5, "initial": start}
    config = {"plant": OSCILLATOR, "observers": {"O": keys}, "data": written(tmp_path, samples, "a", {})}
    wanted = of_log(plain, samples, list(start.values()), Input(), "innovation")
    np.testing.assert_allclose(estimated(tmp_path, config)["O"], wanted, rtol=0, atol=1e-12)
