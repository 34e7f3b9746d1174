"""The theorems' transients, measured on random plants: no error is above its bound, and the bounds say something."""

from typing import Any

import numpy as np
import pytest
from chosen_cases import ALL_CASES
from examples import findings, said
from hypothesis import given, settings
from hypothesis import strategies as st

from hgorun import Experiment
from hgorun.analysis.report import Findings, analyze
from hgorun.result.records.theory import Transient

ASKED = findings("decay", "convergence")
OBSERVERS = (
    ("shgo", 0),
    ("fhgo2", 0),
    ("fhgo2", 1),
    ("fhgo2", 2),
    ("fhgo2", 3),
    ("integral", 1),
    ("integral", 2),
    ("treangle", 0),
    ("lowpass", 1),
    ("low_power", 0),
)
TERMS = ("{c}*sin(x{j})", "sin({c}*x{j})", "{c}*tanh(x{j})", "{c}*sin(x{j} + u)", "{c}*x{j}/4", "{c}*sin(x1)*cos(x{j})")
seeds = st.integers(0, 2**32 - 1)


def plant(rng: np.random.Generator, n: int, *, last_only: bool) -> dict[str, Any]:
    """A chain with triangular phi of bounded slopes: sines, tanh, linear terms, an input."""
    dynamics = {}
    for i in range(n):
        terms = [f"x{i + 2}"] if i + 1 < n else [f"-x{n}", "-2*tanh(x1)"]
        if i + 1 == n or not last_only:
            terms += [rng.choice(TERMS).format(c=f"({rng.uniform(-1.5, 1.5):.3f})", j=j + 1) for j in range(i + 1)]
        dynamics[f"x{i + 1}"] = " + ".join(terms)
    return {
        "states": list(dynamics),
        "dynamics": dynamics,
        "output": "x1",
        "inputs": {"u": "sin(2*t)"},
        "initial": {name: float(rng.uniform(-2, 2)) for name in dynamics},
    }


def poles(rng: np.random.Generator, count: int) -> list[Any]:
    """A conjugate set near -1."""
    found: list[Any] = []
    while len(found) < count:
        real, imaginary = -rng.uniform(0.5, 2), rng.uniform(0, 1)
        pair = count - len(found) >= 2 and rng.random() < 0.5
        found += [f"{real:.3f}+{imaginary:.3f}j", f"{real:.3f}-{imaginary:.3f}j"] if pair else [float(real)]
    return found


def experiment(rng: np.random.Generator, kind: str, r: int, n: int) -> dict[str, Any]:
    model = plant(rng, n, last_only=kind == "low_power")
    order = {"treangle": 2 * n, "low_power": 2 * n - 2}.get(kind, n + r)
    block: dict[str, Any] = {"type": kind, "poles": poles(rng, order)}
    if kind in ("fhgo2", "integral", "lowpass"):
        block["r"] = r
    if kind == "lowpass":
        block |= {"rho": 0.1, "poles": -1}
    block["initial"] = {name: float(rng.uniform(-3, 3)) for name in model["states"]}
    return {
        "plant": model,
        "measurement": {},
        "observers": {"observer": block},
        "solver": {"divergence": 1e18},  # peaks of theta^(n-1) are what is measured here
    }


def with_noise(config: dict[str, Any], n: int) -> None:
    config["plant"]["disturbance"] = {f"x{n}": "0.5*sin(3*t) + 0.2", "x1": "0.1*cos(t)"}
    terms = [{"amplitude": 0.01, "omega": 30}, {"amplitude": 0.02, "omega": 7}]
    config["measurement"]["noise"] = [
        {"type": "sinusoids", "terms": terms},
        {"type": "uniform", "low": -0.01, "high": 0.01, "hold": 0.05},
    ]


def analysed(config: dict[str, Any]) -> tuple[Findings, Transient | None]:
    analysis = analyze(Experiment(config), ASKED)
    return analysis.observers["observer"], analysis.transients.get("observer")


def promised(config: dict[str, Any], factor: float, span: float) -> tuple[Findings, Transient | None]:
    """What is found at theta = factor theta_bound, for a time of span/theta."""
    limit = 1.0
    for _ in range(6):  # theta_bound depends on the box of the run, and that on theta
        theta = factor * limit
        config["observers"]["observer"]["theta"] = theta
        config["time"] = {"end": span / theta, "output_step": span / theta / 1000}
        found, transient = analysed(config)
        if transient is not None and transient.holds:
            break
        limit = max(limit, said(found)["theta_bound"])
    return found, transient


def assert_bounded(found: Findings, transient: Transient | None) -> None:
    assert transient is not None
    assert transient.holds, found.reasons
    assert np.all(transient.error <= transient.sharp)
    assert np.all(transient.sharp <= transient.bound)
    assert np.all(np.diff(transient.bound, axis=0) <= 0)
    assert np.all(transient.bound[-1] < transient.bound[0])
    for column, name in zip(transient.bound.T, transient.names, strict=True):
        law, since = said(found)["peaking_law"][name], transient.time - transient.time[0]
        assert np.allclose(column, law["start"] * np.exp(-law["rate"] * since) + law["rest"], rtol=1e-9)


def assert_near(found: Findings, transient: Transient | None) -> None:
    """Without noise: (3.34) to the letter, and the sharp bound no wall far away."""
    values = said(found)
    assert transient is not None
    theta, span = values["theta"], transient.time[-1] - transient.time[0]
    start = np.linalg.norm(transient.error[0])
    powers = theta ** np.arange(len(transient.names))
    assert np.allclose(transient.bound[0], values["chi"] * powers * start, rtol=1e-6)
    left = np.exp(-values["beta"] * theta * span)
    assert np.allclose(transient.bound[-1] / transient.bound[0], left, rtol=1e-4)
    error = np.where(transient.error > 0, transient.error, np.nan)
    assert np.nanmin(transient.sharp / error) < 100


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "r"), OBSERVERS)
@settings(max_examples=5 if ALL_CASES else 3)
@given(seed=seeds, n=st.integers(2, 4), noisy=st.booleans())
def test_no_error_is_above_its_bound(kind: str, r: int, seed: int, n: int, noisy: bool) -> None:
    rng = np.random.default_rng(seed)
    n = min(n, 3) if kind == "treangle" else n  # its beta gets so small that theta_bound is 1e7
    config = experiment(rng, kind, r, n)
    if noisy:
        with_noise(config, n)
    found, transient = promised(config, rng.uniform(1.001, 3), 40)
    assert_bounded(found, transient)
    if not noisy:
        assert_near(found, transient)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "r"), [("shgo", 0), ("fhgo2", 1)])
@settings(max_examples=4 if ALL_CASES else 3)
@given(seed=seeds, noisy=st.booleans(), sampled=st.booleans())
def test_no_error_is_above_its_bound_with_late_outputs(
    kind: str, r: int, seed: int, noisy: bool, sampled: bool
) -> None:
    rng = np.random.default_rng(seed)
    config = experiment(rng, kind, r, 2)
    if kind == "fhgo2":  # other poles take shorter delays, and more steps
        config["observers"]["observer"]["poles"] = -1
    if noisy:
        with_noise(config, 2)
    found, _ = promised(config, 1.5, 2)
    late = 0.9 * said(found)["delay_bound"]
    config["measurement"] |= {"sampling": {"period": 0.6 * late}, "delay": 0.4 * late} if sampled else {"delay": late}
    found, transient = analysed(config)
    assert said(found)["delay_max"] == pytest.approx(late, rel=1e-6)
    assert 0 < said(found)["eta_theta"] < said(found)["beta"] * said(found)["theta"]
    assert_bounded(found, transient)


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "r"), [("shgo", 0), ("fhgo2", 2), ("treangle", 0)])
@settings(max_examples=5 if ALL_CASES else 3)
@given(seed=seeds, noisy=st.booleans())
def test_a_coarse_output_grid_hides_no_slope(kind: str, r: int, seed: int, noisy: bool) -> None:
    """The peak lies between two points: the box is that of the bound, which holds the peak."""
    rng = np.random.default_rng(seed)
    config = experiment(rng, kind, r, 2)
    if noisy:
        with_noise(config, 2)
    fine, fine_transient = promised(config, 1.5, 40)
    config["time"]["output_step"] = config["time"]["end"] / 4
    coarse, coarse_transient = analysed(config)
    assert coarse_transient is not None
    assert fine_transient is not None
    assert said(coarse)["lipschitz"] >= said(fine)["lipschitz_reached"] * (1 - 1e-9)
    assert any("too coarse" in remark for remark in coarse.remarks)
    if coarse_transient.holds:
        assert np.all(fine_transient.error[::250] <= coarse_transient.sharp)
    else:
        assert "below theta_bound" in coarse.reasons["peaking_bound"]


def test_slopes_that_grow_are_found_beyond_a_coarse_grid() -> None:
    """phi = -x2^3/20: the peak of xhat_2 decides on the slope."""
    config = {
        "time": {"end": 1, "output_step": 0.5},
        "plant": {
            "states": ["x1", "x2"],
            "dynamics": {"x1": "x2", "x2": "-x1 - x2**3/20"},
            "output": "x1",
            "initial": {"x1": 1, "x2": 0},
        },
        "observers": {"observer": {"type": "shgo", "theta": 50}},
    }
    coarse = said(analysed(config)[0])
    config["time"] = {"end": 1, "output_step": 0.001}
    fine = said(analysed(config)[0])
    assert fine["lipschitz_reached"] > 10
    assert coarse["lipschitz"] >= fine["lipschitz"]
