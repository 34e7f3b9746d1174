"""hybrid_red, filtering, tracking: recursions written out, limits that are other observers, and what noise becomes."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from examples import Block, chain, experiment, simulated

from hgorun.errors import ConfigError
from hgorun.observers.filtering import filtering_gains
from hgorun.observers.hybrid_red import MU, hybrid_corrections, hybrid_gains
from hgorun.observers.red import red_gains
from hgorun.observers.roots import signed_powers
from hgorun.simulation.simulate import prepare

SIGNAL = chain(3, "-cos(t) + 0.0625*sin(0.5*t)", [0.5, 1, -0.125])  # sin t + 0.5 cos 0.5 t
TWO = chain(2, "-sin(t) - 0.125*cos(0.5*t)", [0.5, 1])  # the same with one derivative
NOISE = [{"type": "expression", "value": "0.01*sqrt(2)*sin(12.9898*(k + 1)**1.5 + k + 1)"}]
SAMPLED: Block = {"sampling": {"period": 0.01, "offset": 0.01}, "noise": NOISE}


def samples(count: int) -> np.ndarray:
    """y_1..y_count of the signal with its noise, 0.01 apart."""
    k = np.arange(1, count + 1)
    t = 0.01 * k
    return np.asarray(np.sin(t) + 0.5 * np.cos(0.5 * t) + 0.01 * np.sqrt(2) * np.sin(12.9898 * k**1.5 + k))


def test_filtering_trajectory_computed_elsewhere() -> None:
    """Listed in the row of the sample that a step begins with: taken on a period later."""
    block = {"type": "filtering", "n_f": 2, "L": 1.2}
    found = simulated(TWO, {"D": block}, end=10.01, output_step=0.01, step=0.01, measurement=SAMPLED)
    expected = {0.1: (0.04372, 0.10560), 1: (1.55266, 1.29360), 5: (-1.36996, 0.0), 10: (-0.39986, -0.55440)}
    for t, z in expected.items():
        np.testing.assert_allclose(found.observers["D"].xhat[round(100 * t) + 1], z, rtol=0, atol=6e-6)


def test_filtering_of_a_higher_order_with_taylor_terms() -> None:
    block = {"type": "filtering", "n_d": 2, "n_f": 1, "L": 1.2, "discretisation": "proper"}
    found = simulated(TWO, {"D": block}, end=2, output_step=0.01, step=0.01, measurement=SAMPLED).observers["D"]
    lt, L, h = [1.1, 3.0595, 4.1602, 3], 1.2, 0.01
    w, z = 0.0, np.zeros(3)
    for k, y in enumerate(samples(199)):
        at = found.internal["w"][k + 1], *found.xhat[k + 1], found.internal["more"][k + 1]
        np.testing.assert_allclose(np.hstack(at), [w, *z], rtol=0, atol=2e-4)
        root = [abs(w) ** (p / 4) * np.sign(w) for p in (3, 2, 1, 0)]
        w, z = (
            w + h * (z[0] - y - lt[3] * L**0.25 * root[0]),
            np.array([z[0] + h * z[1] + h**2 / 2 * z[2], z[1] + h * z[2], z[2]])
            - h * np.array([lt[2] * L**0.5 * root[1], lt[1] * L**0.75 * root[2], lt[0] * L * root[3]]),
        )


def test_filtering_without_a_filter_is_the_exact_differentiator() -> None:
    np.testing.assert_array_equal(filtering_gains(3, 0, 1.7), red_gains(3, 1.7))
    blocks: dict[str, Block] = {
        "F": {"type": "filtering", "n_f": 0, "L": 1.2},
        "R": {"type": "red", "L": 1.2, "discretisation": "explicit"},
    }
    found = simulated(SIGNAL, blocks, end=2, step=0.01, measurement=SAMPLED).observers
    np.testing.assert_array_equal(found["F"].xhat, found["R"].xhat)


def test_filters_reduce_noise_of_high_frequency() -> None:
    """Errors of z_j like omega^(-n_f (n_d+1-j)/(N+1)); Euler steps of 2e-4, the signal with cos(omega t)."""
    errors: dict[int, list[np.ndarray]] = {0: [], 1: [], 2: []}
    for omega in (500, 1000):
        blocks = {str(n_f): {"type": "filtering", "n_f": n_f, "L": 1.2} for n_f in errors}
        noise = [{"type": "sinusoids", "terms": [{"amplitude": 1, "omega": omega, "phase": np.pi / 2}]}]
        run = simulated(TWO, blocks, end=10, output_step=0.01, step=2e-3,
                        measurement={"sampling": {"period": 2e-4}, "noise": noise})  # fmt: skip
        for n_f, found in errors.items():
            found.append(np.abs(run.observers[str(n_f)].xhat - run.x)[700:].max(axis=0))
    assert np.all(np.array(errors[0])[:, 0] > 0.5)
    np.testing.assert_allclose(errors[1], [[0.0276, 0.2266], [0.0174, 0.1797]], rtol=0.15)
    np.testing.assert_allclose(errors[2], [[7.27e-3, 0.1166], [3.62e-3, 0.0822]], rtol=0.15)
    for n_f in (1, 2):
        slopes = np.log2(errors[n_f][0] / errors[n_f][1])
        np.testing.assert_allclose(slopes, n_f * np.array([2, 1]) / (n_f + 2), atol=0.12)


def test_hybrid_without_linear_terms_is_the_exact_differentiator() -> None:
    """To rounding: one is recursive, the other has powers of the first error."""
    w = ca.SX.sym("w")
    for n in range(5):
        linear, sliding = hybrid_gains(n, 1.7, 0.0)
        both = ca.Function("both", [w], [hybrid_corrections(w, ca.SX(linear), ca.SX(sliding)),
                                         ca.SX(red_gains(n, 1.7)) * signed_powers(w, n + 1)])  # fmt: skip
        for value in (-3.0, -1e-3, 0.0, 0.2, 50.0):
            recursive, direct = (np.asarray(one).ravel() for one in both(value))
            np.testing.assert_allclose(recursive, direct, rtol=1e-14)


def test_hybrid_without_a_sliding_mode_is_the_linear_observer() -> None:
    """G = (mu_n, mu_n mu_(n-1), ...) theta^i."""
    w, M = ca.SX.sym("w"), 3.0
    for n in range(8):
        linear, _ = hybrid_gains(n, 1.0, M)
        found = ca.Function("w", [w], [hybrid_corrections(w, ca.SX(linear), ca.SX.zeros(n + 1))])(0.5)
        expected = np.cumprod([MU[n - j] * M for j in range(n + 1)]) * 0.5
        np.testing.assert_allclose(np.asarray(found).ravel(), expected, rtol=1e-14)
    np.testing.assert_allclose(np.roots([1, 4, 12, 24]), [-2.785, -0.607 + 2.872j, -0.607 - 2.872j], atol=1e-3)


@pytest.mark.parametrize("discretisation", ["explicit", "proper"])
def test_a_hybrid_run_is_the_recursion(discretisation: str) -> None:
    block = {"type": "hybrid_red", "L": 1.2, "discretisation": discretisation, "initial": {"x1": 4}}
    found = simulated(SIGNAL, {"D": block}, end=1, output_step=0.01, step=0.01, measurement=SAMPLED).observers["D"]
    h, z, M = 0.01, np.array([4.0, 0, 0]), 2 * 1.2 ** (1 / 3)
    for k, y in enumerate(samples(99)):
        np.testing.assert_allclose(found.xhat[k + 1], z, rtol=0, atol=1e-4)
        w, corrections = z[0] - y, []
        for lam, mu, p in ((2, 4, 2), (1.5, 3, 1), (1.1, 2, 0)):
            w = lam * 1.2 ** (1 / (p + 1)) * abs(w) ** (p / (p + 1)) * np.sign(w) + mu * M * w
            corrections.append(w)
        taylor = h**2 / 2 * z[2] if discretisation == "proper" else 0
        z = np.array([z[0] + h * z[1] + taylor, z[1] + h * z[2], z[2]]) - h * np.array(corrections)


def fhan(x_1: float, x_2: float, r: float, h_0: float) -> float:
    """As it is printed."""
    d, a_0 = r * h_0**2, h_0 * x_2
    y = x_1 + a_0
    a_1 = np.sqrt(d * (d + 8 * abs(y)))
    a = a_0 + y if abs(y) <= d else a_0 + np.sign(y) * (a_1 - d) / 2
    return float(-r * a / d if abs(a) <= d else -r * np.sign(a))


@pytest.mark.parametrize("given", [{}, {"h_0": 0.02}])
def test_a_tracking_run_is_the_recursion(given: Block) -> None:
    block = {"type": "tracking", "r": 5, **given}
    found = simulated(TWO, {"D": block}, end=3, output_step=0.01, step=0.01, measurement=SAMPLED).observers["D"]
    h, h_0, x = 0.01, given.get("h_0", 0.05), np.zeros(2)
    for k, y in enumerate(samples(299)):
        np.testing.assert_allclose(found.xhat[k + 1], x, rtol=0, atol=1e-6)
        x = x + h * np.array([x[1], fhan(x[0] - y, x[1], 5, h_0)])


def test_tracking_follows_a_step_in_the_shortest_time() -> None:
    """2 sqrt(1/r), hardly an overshoot; and a ramp 2 h_0 late."""
    block = {"type": "tracking", "r": 10, "h_0": 0.01}
    still = chain(2, "0", [1, 0])
    run = simulated(still, {"D": block}, end=1, output_step=0.01, step=0.01, measurement={"sampling": {"period": 0.01}})
    x = run.observers["D"].xhat[:, 0]
    settled = run.time[max(np.flatnonzero(np.abs(x - 1) > 1e-3)) + 1]
    assert settled == pytest.approx(2 / np.sqrt(10), abs=0.02)
    assert 0 <= x.max() - 1 < 2e-4
    ramp = simulated(chain(2, "0", [0, 1]), {"D": {**block, "h_0": 0.1}}, end=4, output_step=0.01, step=0.01,
                     measurement={"sampling": {"period": 0.01}})  # fmt: skip
    assert (ramp.x - ramp.observers["D"].xhat)[-1, 0] == pytest.approx(2 * 0.1, abs=0.011)


@pytest.mark.costly
def test_a_continuous_output_is_measured_at_the_steps() -> None:
    blocks: dict[str, Block] = {
        "F": {"type": "filtering", "L": 1.2}, "H": {"type": "hybrid_red", "L": 1.2}, "T": {"type": "tracking", "r": 5},
    }  # fmt: skip
    runs = [
        simulated(TWO, blocks, end=1, output_step=0.01, step=0.01, measurement=measurement).observers
        for measurement in ({}, {"sampling": {"period": 0.01}})
    ]
    for label in blocks:
        first, second = (run[label].xhat for run in runs)
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-9)


REFUSED: list[tuple[Block, Block, str]] = [
    ({"type": "filtering", "L": 1, "n_d": 1}, {}, "take derivatives up to 2: expected that order or more"),
    ({"type": "filtering", "L": 1, "n_f": 11}, {}, "n_d \\+ n_f up to 12; found n_d = 2, n_f = 11"),
    ({"type": "hybrid_red", "L": 1, "M": 0}, {}, "expected a number above 0"),
    ({"type": "tracking", "r": 1}, {}, "for two states; this plant has 3"),
    ({"type": "filtering", "L": 1}, {"delay": 0.05}, "takes outputs without delay"),
    ({"type": "hybrid_red", "L": 1}, {"delay": 0.05}, "takes outputs without delay"),
]


@pytest.mark.parametrize(("block", "late", "message"), REFUSED)
def test_what_does_not_fit_is_refused(block: Block, late: Block, message: str) -> None:
    measurement = {"sampling": {"period": 0.1}, **late}
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(SIGNAL, {"D": block}, measurement=measurement, step=0.01))


def test_more_of_what_is_refused() -> None:
    sampled: Block = {"sampling": {"period": 0.1}}
    with pytest.raises(ConfigError, match=r"must not be below the time between samples, 0\.1; found 0\.05"):
        prepare(experiment(TWO, {"D": {"type": "tracking", "r": 1, "h_0": 0.05}}, measurement=sampled))
    with pytest.raises(ConfigError, match="ends of steps, which must not be longer than"):
        prepare(experiment(TWO, {"D": {"type": "tracking", "r": 1, "h_0": 0.05}}, step=0.1))
    with pytest.raises(ConfigError, match="up to 8 states; this plant has 9"):
        prepare(experiment(chain(9), {"D": {"type": "hybrid_red", "L": 1}}, measurement=sampled, step=0.01))
    with pytest.raises(ConfigError, match="takes outputs without delay"):
        prepare(experiment(TWO, {"D": {"type": "tracking", "r": 1}}, measurement={"delay": 0.1}, step=0.01))


def test_times_between_samples_may_change() -> None:
    times = [0.1, 0.15, 0.4, 0.5]
    run = simulated(TWO, {"D": {"type": "tracking", "r": 5, "h_0": 0.3}}, end=0.5, output_step=0.05, step=0.01,
                    measurement={"sampling": {"times": times}})  # fmt: skip
    x = np.zeros(2)
    for begin, end in pairwise(times):
        y = np.sin(begin) + 0.5 * np.cos(0.5 * begin)
        x = x + (end - begin) * np.array([x[1], fhan(x[0] - y, x[1], 5, 0.3)])
        np.testing.assert_allclose(run.observers["D"].xhat[round(end / 0.05)], x, rtol=1e-7)


def test_phases_of_continuous_and_of_sampled_outputs() -> None:
    """The step is the solver's while the output is continuous, and the period while it is sampled."""
    phases = {"phases": [{"until": 1}, {"until": 2, "sampling": {"period": 0.05}}, {"until": 3}]}
    blocks: dict[str, Block] = {"F": {"type": "filtering", "L": 1.2, "n_f": 0}, "T": {"type": "tracking", "r": 5}}
    run = simulated(TWO, blocks, end=3, output_step=0.01, step=0.01, measurement=phases)
    for found in run.observers.values():
        moved = np.abs(np.diff(found.xhat, axis=0)).max(axis=1) > 0
        assert np.all(moved[20:99])
        assert 18 <= np.count_nonzero(moved[102:200]) <= 21
        assert np.all(moved[202:299])


SWITCHING: dict[str, Block] = {
    "P": {"type": "red", "L": 1.2, "discretisation": "proper"},
    "E": {"type": "red", "L": 1.2, "discretisation": "explicit"},
    "H": {"type": "hybrid_red", "L": 1.2},
    "F": {"type": "filtering", "L": 1.2},
}


def test_recursions_of_samples_need_no_given_step() -> None:
    """Their step is the period: found by error control, or given, whatever it is, the numbers are the same."""
    measurement = {"sampling": {"period": 0.02}}
    free, given = (
        simulated(TWO, SWITCHING, end=2, output_step=0.02, measurement=measurement, **more)
        for more in ({}, {"solver": {"method": "rk4", "step": 0.001}})
    )
    for label in SWITCHING:
        np.testing.assert_allclose(free.observers[label].xhat, given.observers[label].xhat, rtol=0, atol=1e-5)
    assert set(given.integration_error or {}) >= set(SWITCHING)
    for block in SWITCHING.values():
        with pytest.raises(ConfigError, match="give a number, as in solver"):
            prepare(experiment(TWO, {"O": block}))


@pytest.mark.parametrize("size", [1.0, 1e6])
def test_hybrid_in_other_units_of_y_with_the_documented_bandwidth(size: float) -> None:
    """M = 2 (L/|y|)^(1/(n+1)) is the same rate in every unit of y: so is the estimate."""
    plant = chain(2, f"-{size}*sin(t)", [0, size])
    block = {"type": "hybrid_red", "L": 1.2 * size, "M": 2 * 1.2**0.5}
    found = simulated(plant, {"D": block}, end=2, step=0.01, measurement={"sampling": {"period": 0.01}})
    assert np.abs(found.observers["D"].xhat - found.x)[-5:].max() < 0.1 * size


def test_implicit_red_says_what_uneven_samples_cost() -> None:
    """z_2 = nabla(nabla y/h)/h is y'' on even samples only."""
    block = {"type": "red", "L": 5, "initial": {"x1": 1, "x2": 0.3, "x3": -0.4}}
    errors, remarks = [], []
    for jitter in (0.0, 0.006):
        measurement = {"sampling": {"period": 0.02, "jitter": jitter}}
        found = simulated(chain(3, "0", [1, 0.3, -0.4]), {"D": block}, end=2, measurement=measurement, seed=1)
        errors.append(np.abs(found.observers["D"].xhat - found.x)[-5:, 2].max())
        remarks.append(" ".join(found.remarks))
    assert errors[0] < 1e-9
    assert errors[1] > 1e-3
    assert "samples are not even" not in remarks[0]
    assert "samples are not even" in remarks[1]
