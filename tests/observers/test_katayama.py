"""The reduced-order observers of sampled plants, against plain loops on the exact plant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, simulated
from scipy.integrate import solve_ivp

import hgorun
from hgorun.errors import ConfigError
from hgorun.result.records.observer import ObserverResult

BOTH: dict[str, dict[str, Any]] = {"reduced": {"type": "reduced_sampled", "H": 0.5}, "deadbeat": {"type": "deadbeat"}}


def noise(T: float, amplitude: float = 0.2) -> list[dict[str, Any]]:
    return [{"type": "sinusoids", "terms": [{"amplitude": amplitude, "omega": 10}]}] if amplitude else []


def simulate(plant: dict[str, Any], observers: dict[str, Any], T: float, end: float, **more: Any) -> hgorun.Result:
    """With one row at every sample."""
    more = {"step": 0.005, "measurement": {"sampling": {"period": T}}, **more}
    return simulated(plant, observers, end=end, output_step=T, **more)


def sampled(f: Callable[[float, np.ndarray], Any], x0: list[float], t: np.ndarray) -> np.ndarray:
    """The exact plant at the samples, shape (len(t), n)."""
    return np.asarray(solve_ivp(f, (t[0], t[-1]), x0, "DOP853", t, rtol=1e-12, atol=1e-13).y).T


def van_der_pol(T: float, amplitude: float, end: float = 20) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z, z^ by (8) with H = 0.5 and z^ by (9), at the samples."""
    t = np.arange(round(end / T) + 1) * T
    x = sampled(lambda _, x: [x[1], -x[0] + 0.5 * (1 - x[0] ** 2) * x[1]], [1, 0.5], t)
    y = x[:, 0] + amplitude * np.sin(10 * t)
    reduced, deadbeat = np.zeros((2, t.size))
    for k in range(t.size - 1):
        Psi = (y[k + 1] - y[k]) / T
        f_2 = -y[k] + 0.5 * (1 - y[k] ** 2) * Psi
        reduced[k + 1] = (1 - 0.5 * T) * reduced[k] + T * (0.5 * Psi + f_2)
        deadbeat[k + 1] = Psi + T * f_2
    return x[:, 1], reduced, deadbeat


@pytest.mark.parametrize("T", [0.2, 0.05])
@pytest.mark.parametrize("amplitude", [0, 0.2])
def test_van_der_pol_is_the_plain_loop(T: float, amplitude: float) -> None:
    r = simulate(VAN_DER_POL, BOTH, T, 20, measurement={"sampling": {"period": T}, "noise": noise(T, amplitude)})
    z, *expected = van_der_pol(T, amplitude)
    np.testing.assert_allclose(r.x[:, 1], z, atol=1e-6)
    for label, estimate in zip(BOTH, expected, strict=True):
        np.testing.assert_allclose(r.observers[label].xhat[:, 1], estimate, atol=1e-6)


def test_errors_of_the_example() -> None:
    """Over the samples in [10, 20]: z^, z^_n, z^_2d, z^_2dn."""
    found = {}
    for amplitude in (0, 0.2):
        r = simulate(
            VAN_DER_POL,
            BOTH,
            0.2,
            20,
            metrics={"window": [10, 20]},
            measurement={"sampling": {"period": 0.2}, "noise": noise(0.2, amplitude)},
        )
        for label in BOTH:
            found[label, amplitude] = r.observers[label].metrics["rmse"][1]
    expected = {
        ("reduced", 0): 0.1821,
        ("reduced", 0.2): 0.3168,
        ("deadbeat", 0): 0.1390,
        ("deadbeat", 0.2): 1.0787,
    }
    for case, value in expected.items():
        assert found[case] == pytest.approx(value, rel=1e-3), case


def test_measured_part_is_the_newest_sample() -> None:
    """And the initial estimate until the second sample."""
    block = {"initial": {"x1": 7, "x2": 3}}
    r = simulate(
        VAN_DER_POL,
        {label: o | block for label, o in BOTH.items()},
        0.2,
        2,
        measurement={"sampling": {"period": 0.2}, "noise": noise(0.2)},
        time={"end": 2, "output_step": 0.1},
    )
    y = np.repeat(r.measurements.y[:, 0], 2)[:21]
    for label in BOTH:
        xhat = r.observers[label].xhat
        np.testing.assert_array_equal(xhat[:2], [[7, 3], [7, 3]])
        np.testing.assert_array_equal(xhat[2:, 0], y[2:])
        np.testing.assert_array_equal(xhat[2::2][:9, 1], xhat[3::2, 1])


# Two outputs, their states between the others, an input; plant order z1, x1, z2, x2.
TWO = {
    "states": ["a", "th", "b", "al"],
    "dynamics": {
        "th": "-th + (1 + 0.3*al**2)*a + 0.2*b + u",
        "al": "sin(th) + 0.5*a*cos(th) - b*(2 + u)",
        "a": "-a + cos(b) - 0.3*th*a + u*al",
        "b": "-2*b + a*th + 0.1*sin(3*t)",
    },
    "output": ["al", "th"],
    "inputs": {"u": "sin(2*t)"},
    "initial": {"a": 0.5, "th": 0.3, "b": -0.4, "al": 1},
}
# Two outputs and one unmeasured state: Psi is a least-squares fit.
ONE = {
    "states": ["x1", "z", "x2"],
    "dynamics": {
        "x1": "-x1 + (1 + 0.3*x2**2)*z + u",
        "x2": "sin(x1) + u*x1*z - x2",
        "z": "-z + cos(x1*z) - x2 + u",
    },
    "output": ["x1", "x2"],
    "inputs": {"u": "cos(t)"},
    "initial": {"x1": 0.2, "z": 0.7, "x2": -0.1},
}


def two(t: float, x: np.ndarray) -> list[float]:
    a, th, b, al = x
    u = np.sin(2 * t)
    return [
        -a + np.cos(b) - 0.3 * th * a + u * al,
        -th + (1 + 0.3 * al**2) * a + 0.2 * b + u,
        -2 * b + a * th + 0.1 * np.sin(3 * t),
        np.sin(th) + 0.5 * a * np.cos(th) - b * (2 + u),
    ]


def one(t: float, x: np.ndarray) -> list[float]:
    x1, z, x2 = x
    u = np.cos(t)
    return [-x1 + (1 + 0.3 * x2**2) * z + u, -z + np.cos(x1 * z) - x2 + u, np.sin(x1) + u * x1 * z - x2]


def two_parts(t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f_1 and g, outputs al and th."""
    al, th = y
    u = np.sin(2 * t)
    return np.array([np.sin(th), -th + u]), np.array([[0.5 * np.cos(th), -(2 + u)], [1 + 0.3 * al**2, 0.2]])


def one_parts(t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    x1, x2 = y
    u = np.cos(t)
    return np.array([-x1 + u, np.sin(x1) - x2]), np.array([[1 + 0.3 * x2**2], [u * x1]])


@pytest.mark.parametrize(
    ("plant", "f", "parts", "measured", "H"),
    [
        (TWO, two, two_parts, [3, 1], [0.8, 3]),
        (TWO, two, two_parts, [3, 1], 2),
        (ONE, one, one_parts, [0, 2], 1.5),
    ],
)
def test_two_outputs_and_an_input(plant: dict[str, Any], f: Any, parts: Any, measured: list[int], H: Any) -> None:
    T, start = 0.1, {"initial": {plant["states"][1 if plant is ONE else 0]: 0.3}}
    observers = {"r": {"type": "reduced_sampled", "H": H, **start}, "d": {"type": "deadbeat"}}
    disturbed = [{"type": "expression", "value": "0.05*cos(7*k)"}]
    r = simulate(plant, observers, T, 6, measurement={"sampling": {"period": T}, "noise": disturbed})
    hidden = [i for i in range(len(plant["states"])) if i not in measured]
    t = np.arange(61) * T
    x = sampled(f, list(plant["initial"][s] for s in plant["states"]), t)
    y = x[:, measured] + 0.05 * np.cos(7 * np.arange(61))[:, None]
    reduced, deadbeat = np.zeros((2, 61, len(hidden)))
    reduced[0, 0] = 0.3
    rate = np.diag(np.full(len(hidden), H) if np.isscalar(H) else H)
    for k in range(60):
        f_1, g = parts(t[k], y[k])
        Psi = np.linalg.lstsq(g, (y[k + 1] - y[k]) / T - f_1)[0]
        whole = np.zeros(len(plant["states"]))
        whole[measured], whole[hidden] = y[k], Psi
        f_2 = np.array(f(t[k], whole))[hidden]
        reduced[k + 1] = (np.eye(len(hidden)) - T * rate) @ reduced[k] + T * (rate @ Psi + f_2)
        deadbeat[k + 1] = Psi + T * f_2
    np.testing.assert_allclose(r.observers["r"].xhat[:, hidden], reduced, atol=1e-6)
    np.testing.assert_allclose(r.observers["d"].xhat[:, hidden], deadbeat, atol=1e-6)
    np.testing.assert_allclose(r.observers["d"].xhat[1:][:, measured], y[1:], atol=1e-8)


@pytest.mark.parametrize("plant", [VAN_DER_POL, TWO, ONE])
@pytest.mark.parametrize("T", [0.125, 0.1])
def test_rate_1_over_T_is_the_deadbeat_observer(plant: dict[str, Any], T: float) -> None:
    r = simulate(plant, {"r": {"type": "reduced_sampled", "H": 1 / T}, "d": {"type": "deadbeat"}}, T, 5)
    one, two = (o.xhat for o in r.observers.values())
    assert np.abs(one - two).max() <= 1e-14 * np.abs(two).max()


def test_errors_shrink_with_the_period() -> None:
    """The observer of the exact plant is practical: of first order in T."""
    errors = []
    for T in (0.1, 0.05, 0.025):
        r = simulate(VAN_DER_POL, BOTH, T, 20, metrics={"window": [10, 20]})
        errors.append([r.observers[label].metrics["rmse"][1] for label in BOTH])
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(order[-1], 1, atol=0.1)


def test_plant_by_differences_is_observed_exactly() -> None:
    """Lemma 3.1: with the Euler model as plant the error is (I - T H)^k of the first, and gone for (9)."""
    T = 0.1
    r = simulate(
        TWO | {"discretise": "euler"},
        {"r": {"type": "reduced_sampled", "H": [0.8, 3]}, "d": {"type": "deadbeat"}},
        T,
        4,
    )
    error = (r.observers["r"].xhat - r.x)[:, [0, 2]]
    k = np.arange(error.shape[0])[:, None]
    np.testing.assert_allclose(error, (1 - T * np.array([0.8, 3])) ** k * error[0], atol=1e-12)
    np.testing.assert_allclose(r.observers["d"].xhat[1:], r.x[1:], atol=1e-12)


def test_rates_beyond_2_over_T_diverge() -> None:
    """A3."""

    def last(H: float) -> ObserverResult:
        return simulate(VAN_DER_POL, {"o": {"type": "reduced_sampled", "H": H}}, 0.2, 60).observers["o"]

    assert last(12).diverged_at is not None
    assert np.isnan(last(12).xhat[-1]).all()
    assert last(9).diverged_at is None


@pytest.mark.parametrize("divergence", [1e6, None])
def test_the_deadbeat_observer_comes_back_unless_a_bound_is_given(divergence: float | None) -> None:
    """At t = 1 g vanishes, and Psi is huge; the deadbeat observer knows nothing of it afterwards."""
    plant = {
        "states": ["x", "z"],
        "dynamics": {"x": "cos(pi*t/2)*z", "z": "-x"},
        "output": "x",
        "initial": {"x": 1, "z": 1},
    }
    solver = {"step": 0.005} | ({} if divergence is None else {"divergence": divergence})
    r = simulate(plant, {"d": {"type": "deadbeat"}}, 0.25, 3, solver=solver)
    o = r.observers["d"]
    if divergence is None:
        assert o.status == "ok"
        assert np.max(np.abs(o.xhat)) > 1e12
        np.testing.assert_allclose(o.xhat[-1], r.x[-1], rtol=0.5)
        return
    assert o.diverged_at is not None
    assert o.reason == "a state is beyond solver.divergence = 1e+06, or not a number"
    assert 1.25 <= o.diverged_at <= 1.26
    assert np.isfinite(o.xhat[r.time < 1.25]).all()
    assert np.isnan(o.xhat[r.time > 1.26]).all()


def test_samples_at_one_time_are_one() -> None:
    """Jitter over an end of the run puts several samples there; the last one is taken."""
    sampling = {"period": 0.2, "jitter": 0.5}
    r = simulate(VAN_DER_POL, BOTH, 0.1, 6, measurement={"sampling": sampling}, seed=17)
    t, y = r.measurements.time, r.measurements.y[:, 0]
    assert t.size <= 29  # of 31
    assert t[0] == 0
    assert t[-1] == 6
    estimate = np.zeros(t.size)
    for k in range(t.size - 1):
        T = t[k + 1] - t[k]
        Psi = (y[k + 1] - y[k]) / T
        estimate[k + 1] = Psi + T * (-y[k] + 0.5 * (1 - y[k] ** 2) * Psi)
    newest = np.searchsorted(t, r.time + 1e-12, side="right") - 1
    np.testing.assert_allclose(r.observers["deadbeat"].xhat[:, 1], estimate[newest], atol=1e-6)
    assert np.isfinite(r.observers["reduced"].xhat).all()


PLANT = {"states": ["x", "z"], "initial": {"x": 1, "z": 1}, "output": "x"}


@pytest.mark.measured("dynamics5-output5-state x is measured twice")
@pytest.mark.costly
@pytest.mark.parametrize(
    ("dynamics", "output", "words"),
    [
        ({"x": "z**2", "z": "-x"}, "x", "x' is not affine in z"),
        ({"x": "-x + sin(z)", "z": "-x"}, "x", "x' is not affine in z"),
        ({"x": "-x", "z": "-z"}, "x", r"shows 0 of the 1 unmeasured states z \(rank of g, assumption A2\)"),
        ({"x": "z", "z": "-x"}, "x + z", "output y1 is not one of the states"),
        ({"x": "z", "z": "-x"}, ["x", "z"], "all states are measured"),
        ({"x": "z", "z": "-x"}, {"p": "x", "q": "x"}, "state x is measured twice"),
    ],
)
def test_plants_outside_the_class_are_refused(dynamics: dict[str, str], output: Any, words: str) -> None:
    plant = PLANT | {"dynamics": dynamics, "output": output}
    with pytest.raises(ConfigError, match=words) as error:
        simulate(plant, {"d": {"type": "deadbeat"}}, 0.1, 1)
    assert error.value.key == "plant"


def test_more_unmeasured_states_than_outputs_are_refused() -> None:
    plant = {
        "states": ["x", "v", "w"],
        "dynamics": {"x": "v + w", "v": "-x", "w": "-v"},
        "output": "x",
        "initial": {"x": 1, "v": 1, "w": 0},
    }
    with pytest.raises(ConfigError, match="shows 1 of the 2 unmeasured states v, w"):
        simulate(plant, {"d": {"type": "deadbeat"}}, 0.1, 1)


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"H": [1, 2]}, "H", "expected one number for all or 1, for x2; found 2"),
        ({"H": 0}, "H", "every h must be positive, found 0"),
        ({"H": []}, "H", "expected a number or a list"),
        ({"H": "fast"}, "H", "fast"),
        ({"saturation": {"x2": [0, 1]}}, "saturation", "no state that could be given"),
        ({"initial": {"z": 1}}, "initial", "unknown state 'z'"),
    ],
)
def test_wrong_blocks_are_refused(change: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        simulate(VAN_DER_POL, {"o": {"type": "reduced_sampled", "H": 0.5} | change}, 0.2, 2)
    assert error.value.key == f"observers.o.{key}"


def test_outputs_come_together() -> None:
    with pytest.raises(ConfigError, match="at the same times"):
        simulate(
            ONE,
            {"d": {"type": "deadbeat"}},
            0.1,
            1,
            measurement={"outputs": {"x1": {"sampling": {"period": 0.1}}, "x2": {"sampling": {"period": 0.2}}}},
        )
