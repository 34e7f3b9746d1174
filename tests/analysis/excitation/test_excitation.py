"""Excitation of plants that are observable under some inputs only."""

from typing import Any

import numpy as np
import pytest
from examples import ACADEMIC, experiment

from hgorun import ConfigError
from hgorun.analysis.excitation.excitation import Excitation, excitation, links_along, plant_excitation
from hgorun.analysis.excitation.gramian import gramians
from hgorun.analysis.reasons import NoValue
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared

OBSERVERS = {
    "S": {"type": "shgo_riccati", "theta": 5},
    "L": {"type": "shgo_riccati", "theta": 5, "equation": "lyapunov"},
    "I": {"type": "fhgo1", "theta": 5, "delta": 3},
    "F": {"type": "fhgo2_nuos", "theta": 5, "r": 2, "gain": "full"},
}


def finished(
    plant: dict[str, Any], observers: dict[str, Any], end: float = 30, step: float | None = None
) -> tuple[PreparedRun, Result]:
    run = prepare(experiment(plant, observers, end=end, output_step=0.01, step=step))
    return run, simulate_prepared(run)


@pytest.fixture(scope="module")
def academic() -> tuple[PreparedRun, Result]:
    return finished(ACADEMIC, OBSERVERS, end=60, step=1e-3)


def looked(run: PreparedRun, label: str, result: Result, horizon: float | None = None) -> Excitation:
    found = excitation(run, label, result, horizon)
    assert isinstance(found, Excitation), found
    return found


@pytest.mark.costly
@pytest.mark.parametrize("r", [0, 2])
def test_the_gramian_as_it_is_printed(academic: tuple[PreparedRun, Result], r: int) -> None:
    """(3.86), (3.101) with the transition matrix of solve_ivp: theta Delta^-1 integral Delta^-1."""
    from scipy.integrate import solve_ivp

    run, result = academic
    theta, horizon = 5.0, 3.0
    n = 3 + r

    def F(s: float) -> np.ndarray:
        matrix = np.eye(n, k=1)
        matrix[r, r + 1], matrix[r + 1, r + 2] = np.sin(0.5 * s), np.sin(2.7 * s)
        return matrix

    inverse = np.diag(theta ** np.arange(n))
    links = links_along(run, "S", result.time, result.x).behind_integrators(r)
    for t in (6.4, 9.0, 31.9):

        def rate(s: float, z: np.ndarray) -> np.ndarray:
            Phi = z[: n * n].reshape(n, n)
            return np.concatenate([(F(s) @ Phi).ravel(), np.outer(Phi[0], Phi[0]).ravel()])

        start = np.concatenate([np.eye(n).ravel(), np.zeros(n * n)])
        end = solve_ivp(rate, (t, t - horizon / theta), start, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        printed = -theta * inverse @ end[n * n :].reshape(n, n) @ inverse
        W = gramians(links, np.array([t]), theta, np.array([horizon]))[0, 0]
        np.testing.assert_allclose(W, printed, rtol=2e-4, atol=2e-4 * np.abs(printed).max())
        assert np.linalg.eigvalsh(W)[0] == pytest.approx(np.linalg.eigvalsh(printed)[0], rel=0.02)


@pytest.mark.costly
def test_unbroken_links_in_closed_form(academic: tuple[PreparedRun, Result]) -> None:
    """integral_0^T (1, -s, s^2/2)^T (1, -s, s^2/2) ds."""
    run, result = academic
    found = looked(run, "S", result, horizon=2.0)
    powers = np.array([1.0, -1.0, 0.5])
    i = np.arange(3)
    W = np.outer(powers, powers) * 2.0 ** (i[:, None] + i + 1) / (i[:, None] + i + 1)
    assert found.reference == pytest.approx(np.linalg.eigvalsh(W)[0], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("horizon", [None, 1.0, 3.0])
def test_what_it_promises_for_the_observers_own_matrix(
    academic: tuple[PreparedRun, Result], horizon: float | None
) -> None:
    """S >= exp(-T*) delta* I once a window has passed, (3.96), in the observers' own equations."""
    run, result = academic
    for label in OBSERVERS:
        found = looked(run, label, result, horizon)
        own = found.eigenvalues
        assert own is not None
        assert 0 < found.rho_bound <= own.rho, label
        assert found.rho_bound == pytest.approx(np.exp(-found.horizon) * found.delta)
    after = result.time >= found.horizon / 5
    S = np.asarray(result.observers["L"].internal["S"])[after]
    seen = looked(run, "L", result, horizon).eigenvalues
    assert seen is not None
    assert seen.rho == pytest.approx(np.min(np.linalg.eigvalsh(S)), rel=1e-9)


def test_where_the_academic_example_is_weak(academic: tuple[PreparedRun, Result]) -> None:
    """x2 just after f_1 = sin 0.5 t has been zero; x3 where f_2 = sin 2.7 t was zero too."""
    run, result = academic
    found = looked(run, "S", result, horizon=1.0)
    assert found.condition == "(2.43)"
    assert {w.state for w in found.weak} == {"x2", "x3"}
    zeros = {"x2": 2 * np.pi * np.arange(10), "x3": np.pi * np.arange(60) / 2.7}
    for w in found.weak:
        if w.state == "x2":
            # 1 % is reached where |f_1| = 0.1, 0.2 before and after a zero, and the window is as long again
            z = zeros["x2"]
            assert np.any((z - 0.2 < w.start) & (w.start < z + 0.21) & (w.end < z + 0.5)), w
        else:  # through both links: the stretches of both, run together
            z = np.concatenate(list(zeros.values()))
            assert np.any((w.start - 0.21 < z) & (z < w.end)), w
    assert "x2 is hardly seen in the output" in found.words
    assert np.sin(0.5 * found.at) == pytest.approx(0, abs=0.15)
    assert sum(w.state == "x2" for w in found.weak) == 10  # the zeros of sin 0.5 t in [0, 60]
    # (3.86) is along the plant's state, (2.43) along the estimate: here F depends on time alone
    same = plant_excitation(run, "F", result, horizon=1.0)
    assert isinstance(same, Excitation)
    assert same.delta == pytest.approx(found.delta, rel=1e-9)
    assert looked(run, "F", result, horizon=1.0).condition == "(3.101), r = 2"


@pytest.mark.costly
def test_the_smallest_eigenvalue_is_found_between_the_points(academic: tuple[PreparedRun, Result]) -> None:
    run, result = academic
    found = looked(run, "S", result, horizon=1.0)
    links = links_along(run, "S", result.time, result.x)
    at = np.linspace(0.2, 60, 60_001)
    everywhere = np.linalg.eigvalsh(gramians(links, at, 5.0, np.array([1.0]))[0])[:, 0]
    assert found.delta == pytest.approx(everywhere.min(), rel=0.01)


def test_a_link_that_is_zero_for_a_while() -> None:
    plant = {
        "type": "inline",
        "states": ["level", "leak"],
        "dynamics": {"level": "valve*leak - level", "leak": "-0.1*leak"},
        "output": "level",
        "inputs": {"valve": "max(0, sin(t))"},
        "initial": {"level": 1, "leak": 1},
    }
    run, result = finished(plant, {"o": {"type": "shgo_riccati", "theta": 4}}, end=12)
    found = looked(run, "o", result, horizon=1.0)
    assert found.delta == pytest.approx(0, abs=1e-12)
    assert found.state == "leak"
    (w, *_) = found.weak
    assert w.state == "leak"
    # from the valve's closing, as long as the window of 1/4 still holds what was there before, to its opening
    assert np.pi < w.start < np.pi + 0.25
    assert 2 * np.pi < w.end < 2 * np.pi + 0.25
    assert "leak is hardly seen in the output" in found.words
    assert f"{w.start:.4g}" in found.words
    assert found.eigenvalues is not None
    # nothing corrects P_22 there: it grows like exp(theta t)
    assert found.eigenvalues.largest > 0.05 * np.exp(4 * (np.pi - 0.25))


def misprint(link: str) -> dict[str, Any]:
    """(2.84) with what the thesis prints in the second equation."""
    return {
        "type": "inline",
        "states": ["x1", "x2", "x3"],
        "dynamics": {
            "x1": "sin(0.5*t)*x2 - 0.1*x1",
            "x2": f"{link} - 0.1*x2 + tanh(x1*x2)",
            "x3": "-0.1*x3 + tanh(x1*x2) + 5*sin(0.5*pi*t)",
        },
        "output": "x1",
        "parameters": {"k": 0} if "k*" in link else {},
        "initial": {"x1": 1, "x2": 1, "x3": 1},
    }


def test_the_plant_as_it_is_printed() -> None:
    with pytest.raises(ConfigError, match="state x3 does not appear"):
        finished(misprint("sin(2.7*t)"), {"o": OBSERVERS["S"]}, end=5)
    # the same with a link in the model that is zero in numbers
    run, result = finished(misprint("sin(2.7*t) + k*x3"), {"o": OBSERVERS["S"]}, end=5)
    found = looked(run, "o", result)
    assert found.delta == 0
    assert found.state == "x3"
    assert found.words == "x3 is not seen in the output at any time"
    assert found.weights["x3"] == pytest.approx(1)


def test_where_none_is_needed() -> None:
    run, result = finished(
        {"type": "integrator_chain", "n": 2, "initial": {"x1": 0, "x2": 0}},
        {"o": {"type": "shgo", "theta": 2}, "short": {"type": "shgo_riccati", "theta": 0.01}},
        end=1,
    )
    for condition in (excitation, plant_excitation):
        with pytest.raises(NoValue, match="uniformly observable: no excitation needed"):
            condition(run, "o", result)
    with pytest.raises(NoValue, match="shorter than the window of the Gramian"):
        excitation(run, "short", result)


def test_several_outputs_and_blocks() -> None:
    """Two independent chains of two: each as the chain alone."""
    plant = {
        "type": "inline",
        "states": ["a", "b", "va", "vb"],
        "dynamics": {"a": "va", "b": "0.5*vb", "va": "0", "vb": "0"},
        "output": ["a", "b"],
        "initial": {"a": 0, "b": 0, "va": 0, "vb": 0},
    }
    run, result = finished(plant, {"o": {"type": "shgo_riccati", "theta": 2}}, end=10)
    found = looked(run, "o", result, horizon=2.0)
    f = 0.5
    W = np.array([[2, -f * 2], [-f * 2, f**2 * 8 / 3]])
    assert found.delta == pytest.approx(np.linalg.eigvalsh(W)[0], rel=1e-4)
    assert found.state == "vb"
