"""Observers whose gain depends on the error or on time: trajectories computed elsewhere, limits, and laws."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, inline, simulated, sinusoid
from scipy.linalg import expm

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.homogeneous import HomogeneousObserver
from hgorun.observers.prescribed_time import PrescribedTimeObserver
from hgorun.simulation.preparation.preparation import prepare
from hgorun.symbolic.observability import canonical_form
from hgorun.testing.cases import built
from hgorun.testing.equations import Equations

VAN_DER_POL: Block = {"type": "van_der_pol", "parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
JERK = chain(3, "-0.6*x3 - x2 - sin(x1)", [1, 0, 0])
NOISE: Block = {"noise": sinusoid(0.05, 40)}
SHGO: Block = {"type": "shgo", "theta": 4}

# an independent simulator, RK4 with steps of 2.5e-4; t: xhat_1, xhat_2 and, of the dead zone, sigma
TRAJECTORIES: dict[str, tuple[Block, dict[float, tuple[float, ...]]]] = {
    "piecewise": (
        {"type": "piecewise", "theta_1": 12, "theta_2": 3, "d": 0.1},
        {0.1: (1.01662, 4.00651), 0.5: (0.96609, 0.04242), 1: (0.55957, -0.78657), 5: (0.73250, 1.94500)},
    ),
    "dead_zone": (
        {"type": "dead_zone", "theta": 5, "lam": 1, "rho": 0.2, "internal": {"sigma": 1}},
        {
            0.1: (0.02926, 0.06357, 0.92394),
            0.5: (0.11879, 0.15501, 0.66862),
            1: (0.18720, 0.11099, 0.43037),
            5: (0.68163, 2.12699, 0.01363),
        },
    ),
    "homogeneous": (
        {"type": "homogeneous", "theta": 3, "gains": [2, 1], "d0": -0.5, "dinf": 0.3},
        {0.1: (0.48828, 0.68983), 0.5: (1.00008, 0.56941), 1: (0.57048, -0.75087), 5: (0.72978, 1.92688)},
    ),
}


def test_trajectories_computed_elsewhere() -> None:
    blocks = {name: block for name, (block, _) in TRAJECTORIES.items()}
    result = simulated(VAN_DER_POL, blocks, end=5, step=2.5e-4, measurement=NOISE)
    for name, (_, rows) in TRAJECTORIES.items():
        found, places = result.observers[name], [round(10 * t) for t in rows]
        values = found.xhat if name != "dead_zone" else np.column_stack([found.xhat, found.internal["sigma"]])
        tolerance = 3e-4 if name == "homogeneous" else 6e-6  # its second computation: 3e-5
        np.testing.assert_allclose(values[places], list(rows.values()), atol=tolerance, err_msg=name)


LIMITS: list[tuple[Block, float]] = [
    ({"type": "piecewise", "theta_1": 7, "theta_2": 4, "d": 1e9}, 0),
    ({"type": "piecewise", "theta_1": 4, "theta_2": 3.9, "d": 0}, 0),
    ({"type": "updated", "theta_0": 4, "a": 0, "delta": 0.1}, 1e-12),  # a state in place of a number: other roundings
    ({"type": "dead_zone", "theta": 4, "rho": 0}, 0),
    ({"type": "stubborn", "theta": 4, "lam": 0, "rho": 1, "internal": {"sigma": 1e12}}, 0),
    ({"type": "homogeneous", "theta": 4, "d0": 0, "dinf": 0}, 0),
]


@pytest.mark.costly
@pytest.mark.parametrize("measurement", [NOISE, {"sampling": {"period": 0.02}, "delay": 0.01}])
def test_limits_in_which_they_are_the_standard_observer(measurement: Block) -> None:
    blocks = {str(i): block for i, (block, _) in enumerate(LIMITS)}
    result = simulated(JERK, {"S": SHGO, **blocks}, end=3, step=1e-3, measurement=measurement)
    for i, (block, tolerance) in enumerate(LIMITS):
        gap = np.max(np.abs(result.observers[str(i)].xhat - result.observers["S"].xhat))
        assert gap <= tolerance, block


@pytest.mark.parametrize(("n", "d"), [(2, -0.3), (2, 0.5), (3, 0.1), (3, -0.1)])
def test_of_one_degree_it_is_homogeneous(n: int, d: float) -> None:
    """From lambda^r_i e_i(0) the solution is lambda^r_i e_i(lambda^d t); d0 and dinf are never equal but for 0."""
    block = HomogeneousObserver(type="homogeneous", theta=2, gains=(3.0, 3.0, 1.0)[:n])
    plant = built({**chain(n), "initial": {f"x{i + 1}": 0 for i in range(n)}})
    form = canonical_form(plant.model, plant.initial, plant.parameters)
    equations = Equations(block.model_copy(update={"d0": d, "dinf": d}), plant, form)

    def rate(e: np.ndarray) -> np.ndarray:
        return equations.evaluate(equations.flow, 0.0, e, e[:1])[0][:, 0]

    def after(e: np.ndarray, h: float) -> np.ndarray:
        for _ in range(50):
            k_1 = rate(e)
            k_2 = rate(e + h / 2 * k_1)
            k_3 = rate(e + h / 2 * k_2)
            e = e + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + rate(e + h * k_3))
        return e

    scale, start = 3.0, np.linspace(1, 2, n)
    weights = scale ** (1 - d * np.arange(n - 1, -1, -1))
    np.testing.assert_allclose(after(weights * start, 0.01), weights * after(start, 0.01 * scale**d), rtol=1e-11)


@pytest.mark.costly
def test_time_to_come_down_is_bounded_where_large_errors_have_a_degree_above_zero() -> None:
    """From (s, 0), s = 1, 1e2, 1e4, to |e| <= 1e-6; computed elsewhere."""
    expected = {
        (-0.5, 0.5): (2.346, 5.309, 5.436),
        (0.0, 0.5): (14.46, 16.54, 16.66),
        (0.0, 0.0): (8.681, 11.11, 13.51),
    }
    plant = inline({"x1": "x2", "x2": "0"}, "x1", 0.0)
    solver = {"method": "dopri5", "rtol": 1e-9, "atol": 1e-10, "divergence": 1e9}
    for (d0, dinf), times in expected.items():
        block = {"type": "homogeneous", "theta": 2, "gains": [2, 1], "d0": d0, "dinf": dinf}
        blocks = {str(k): {**block, "initial": {"x1": 100.0**k}} for k in range(3)}
        result = simulated(plant, blocks, end=max(times) + 0.2, output_step=1e-3, solver=solver)
        for k, wanted in enumerate(times):
            error = np.abs(result.observers[str(k)].xhat).max(axis=1)
            found = result.time[np.flatnonzero(error <= 1e-6)[0]]
            assert found == pytest.approx(wanted, abs=1e-2), (d0, dinf, k)


def test_prescribed_time_has_its_closed_form() -> None:
    """e = diag(mu^(i-1)) exp(M tau) e(0), M = A - G C - diag(0..n-1)/T, tau = T ln mu."""
    T, end = 2.0, 1.5
    for n, G in ((2, (5.5, 6.25)), (3, (7.5, 15.25, 8))):
        block = {"type": "prescribed_time", "T": T, "poles": -3}
        np.testing.assert_allclose(PrescribedTimeObserver.model_validate(block).gain(n), G, rtol=1e-14)
        start = np.linspace(1, -1, n)
        initial = {f"x{i + 1}": float(v) for i, v in enumerate(start)}
        plant = inline({f"x{i + 1}": f"x{i + 2}" for i in range(n - 1)} | {f"x{n}": "0"}, "x1", 0.0)
        solver = {"method": "dopri5", "step": 1e-3}
        result = simulated(plant, {"P": {**block, "initial": initial}}, end=end, output_step=0.25, solver=solver)
        mu = T / (T - end)
        M = np.eye(n, k=1) - np.outer(G, np.eye(n)[0]) - np.diag(np.arange(n)) / T
        expected = mu ** np.arange(n) * (expm(M * T * np.log(mu)) @ start)
        np.testing.assert_allclose(result.observers["P"].xhat[-1], expected, rtol=1e-11)


def test_prescribed_time_is_the_standard_observer_afterwards() -> None:
    block = {"type": "prescribed_time", "T": 1, "mu_max": 5, "internal": {"age": 1}}
    gain = PrescribedTimeObserver.model_validate({k: v for k, v in block.items() if k != "internal"}).gain(3)
    blocks = {"P": block, "S": {"type": "shgo", "theta": 5, "gains": list(map(float, gain))}}
    found = simulated(JERK, blocks, end=3, step=1e-2, measurement=NOISE).observers
    np.testing.assert_allclose(found["P"].xhat, found["S"].xhat, atol=1e-9)


def test_theta_stays_between_its_bounds_and_falls_back() -> None:
    """While |e| <= delta, theta - theta_0 falls exactly like exp(-b t)."""
    block = {"type": "updated", "theta_0": 2, "theta_max": 8, "b": 0.7, "delta": 0.1, "internal": {"theta": 5}}
    truth = {"x1": 1, "x2": 0}
    calm = simulated(VAN_DER_POL, {"U": {**block, "initial": truth}}, end=4, step=0.005).observers["U"]
    np.testing.assert_allclose(calm.internal["theta"], 2 + 3 * np.exp(-0.7 * np.arange(41) / 10), rtol=1e-9)
    far = simulated(VAN_DER_POL, {"U": {**block, "initial": {"x1": 9, "x2": -9}}}, end=4, step=0.005, measurement=NOISE)
    theta = far.observers["U"].internal["theta"]
    assert theta.max() > 5.5
    assert np.all((theta >= 2) & (theta <= 8))


@pytest.mark.parametrize(("T", "rho", "ratio"), [(0.01, 4, 0.1354), (0.01, 1, 0.0677), (0.005, 4, 0.0950)])
def test_an_outlier_is_listened_to_in_part(T: float, rho: float, ratio: float) -> None:
    """Its effect one period later, over that on shgo: (2/3) sqrt(rho T) for theta T << 1."""
    start = {"x1": 1, "x2": 0}
    blocks = {
        "S": {"type": "shgo", "theta": 2, "initial": start},
        "B": {"type": "stubborn", "theta": 2, "lam": 1, "rho": rho, "initial": start, "internal": {"sigma": 0}},
    }
    clean: Block = {"sampling": {"period": T}}
    spoilt: Block = {**clean, "noise": [{"type": "expression", "value": "where(k == 100, 1, 0)"}]}
    runs = [
        simulated(VAN_DER_POL, blocks, end=101 * T, output_step=T, step=T / 10, measurement=measurement).observers
        for measurement in (clean, spoilt)
    ]
    effect = {name: np.abs(runs[1][name].xhat - runs[0][name].xhat)[-1] for name in blocks}
    assert effect["B"][0] / effect["S"][0] == pytest.approx(ratio, rel=0.01)
    assert ratio == pytest.approx(2 / 3 * np.sqrt(rho * T), rel=0.02)


def test_a_dead_zone_closes_without_noise_and_stays_open_with_it() -> None:
    block = {"type": "dead_zone", "theta": 5, "lam": 1, "rho": 0.2, "internal": {"sigma": 1}}
    quiet = simulated(VAN_DER_POL, {"D": block}, end=20, step=0.01).observers["D"]
    assert quiet.internal["sigma"][-1, 0] < 1e-6
    loud = simulated(VAN_DER_POL, {"D": {**block, "initial": {"x1": 1}}}, end=30, step=0.01, measurement=NOISE)
    width = np.sqrt(loud.observers["D"].internal["sigma"][-1, 0])
    assert width == pytest.approx(np.sqrt(0.2) * 0.05 / np.sqrt(2), rel=0.2)


def test_thresholds_follow_from_the_noise() -> None:
    noise = [
        *sinusoid(0.1, 3),
        {"type": "gaussian", "std": 0.2},
        {"type": "uniform", "low": -0.1, "high": 0.3},
    ]
    blocks = {
        "P": {"type": "piecewise", "theta_1": 4, "theta_2": 2},
        "U": {"type": "updated", "theta_0": 2},
        "B": {"type": "stubborn", "theta": 2},
    }
    run = prepare(experiment(JERK, blocks, measurement={"sampling": {"period": 0.1}, "noise": noise}))
    gains = {b.label: b.design for b in run.observers}
    assert gains["P"]["d"] == pytest.approx([1.5 * (0.1 + 0.4 + 0.3)])
    assert gains["U"]["delta"] == pytest.approx([1.2])
    sigma = hgorun.simulate(run.experiment).observers["B"].internal["sigma"][0]
    assert sigma == pytest.approx([9 * (0.01 / 2 + 0.04 + 0.16 / 12)])


def test_thresholds_of_several_outputs() -> None:
    plant = inline({"a": "b", "b": "-a", "c": "-c"}, ["a", "c"])
    block = {"type": "piecewise", "theta_1": 4, "theta_2": 2}
    (found,) = prepare(experiment(plant, {"P": {**block, "d": {"c": 2, "a": 1}}})).observers
    assert found.design["d"].tolist() == [1, 2]
    with pytest.raises(ConfigError, match="expected a number for each output: a, c"):
        prepare(experiment(plant, {"P": {**block, "d": {"a": 1}}}))


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"type": "piecewise", "theta_1": 2, "theta_2": 4, "d": 1}, "must be above theta_2 = 4"),
        ({"type": "piecewise", "theta_1": 4, "theta_2": 2}, "d is missing: it does not follow from the noise"),
        ({"type": "piecewise", "theta_1": 40, "theta_2": 1, "d": 1}, "the error's matrix is not Hurwitz"),
        ({"type": "updated", "theta_0": 2, "theta_max": 1, "delta": 1}, "must be above theta_0 = 2"),
        ({"type": "updated", "theta_0": 2, "delta": 1, "internal": {"theta": 1}}, "theta starts between theta_0 = 2"),
        ({"type": "dead_zone", "theta": 2, "lam": 1, "rho": 1}, "must be below lam = 1"),
        ({"type": "dead_zone", "theta": 2, "internal": {"sigma": -1}}, "starts at 0 or above"),
        ({"type": "stubborn", "theta": 2, "lam": 1, "rho": 0.5}, "must not be below lam = 1"),
        ({"type": "homogeneous", "theta": 2, "dinf": 0.5}, "must be below 1/"),
        ({"type": "homogeneous", "theta": 2, "d0": -1}, "above -1"),
        ({"type": "prescribed_time", "T": 2, "poles": -1}, "real parts must be below"),
        ({"type": "prescribed_time", "T": 2, "poles": [-3, -3]}, "expected 3 numbers"),
    ],
)
def test_keys_that_do_not_fit(block: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(JERK, {"O": block}))


@pytest.mark.parametrize("measurement", [{"sampling": {"period": 0.1}, "delay": 0.05}, {"delay": 0.05}])
def test_a_gain_that_grows_until_a_time_takes_no_late_outputs(measurement: Block) -> None:
    with pytest.raises(ConfigError, match="takes outputs without delay"):
        prepare(experiment(JERK, {"O": {"type": "prescribed_time", "T": 2}}, measurement=measurement))
