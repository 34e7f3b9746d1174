"""Observers that do not peak, against trajectories computed elsewhere, exact errors, and slopes of peaks in theta."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, chain, experiment, findings, inline, said, simulated, sinusoid

import hgorun
from hgorun.analysis.finding import Finding
from hgorun.analysis.report import analyze
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.preparation.preparation import prepare
from hgorun.testing import check_observer

JERK = chain(3, "-0.6*x3 - x2 - sin(x1)", [1, 0, 0])
NOISE: Block = {"noise": sinusoid(0.05, 40)}
Rows = dict[float, tuple[float, ...]]

# an independent simulator, RK4 with the steps below; t: xhat
NESTED: Rows = {
    0.1: (0.99558, 1.54330, 0.32339),
    0.5: (0.98520, -0.03464, -0.64286),
    1: (0.91675, -0.00259, -0.48476),
    2: (0.30370, -0.97938, -0.45463),
    5: (-0.20023, 0.59716, 0.19377),
}
PEAKING_FREE: Rows = {
    0.1: (1.12936, 1.82713, 2.0),
    0.5: (0.96465, -0.64133, -2.0),
    1: (0.90506, -0.33835, -0.54501),
    2: (0.31294, -0.69785, -0.09317),
    5: (-0.18870, 0.93463, 0.42523),
}
CASCADE: Rows = {
    0.1: (0.99995, 2.0, 2.0),
    0.2: (1.13469, 2.0, 2.0),
    0.5: (1.01312, 0.29489, -2.0),
    1: (0.88973, -0.21719, -0.60549),
    5: (-0.17658, 0.81006, 0.65860),
}
CONTOIS: Rows = {0.1: (1.31874, 16.11287), 0.5: (1.69820, 29.71331), 1: (1.89576, 20.72283), 5: (3.18453, 16.30849)}

KINDS: dict[str, Block] = {
    "shgo": {"type": "shgo"},
    "nested": {"type": "shgo", "nested": {"M": [2, 2]}},
    "nested fhgo2": {"type": "fhgo2", "r": 2, "nested": {"M": [2, 2]}},
    "low_power": {"type": "low_power"},
    "peaking-free": {"type": "low_power", "saturate": [2, 2]},
    "cascade": {"type": "cascade", "M": [2, 2]},
}
# the same simulator, RK4 with steps of 0.005/theta, every step looked at; theta: peaks of x2 and x3
PEAKS: dict[int, dict[str, tuple[float, float]]] = {
    10: {"shgo": (7.967, 22.24), "nested": (1.805, 1.134), "nested fhgo2": (2.011, 0.815)},
    100: {"shgo": (79.93, 2300), "nested": (3.013, 1.243), "nested fhgo2": (2.441, 1.639)},
}
PEAKS[10] |= {"low_power": (6.235, 12.15), "peaking-free": (2.153, 2.194), "cascade": (2.026, 2.188)}
PEAKS[100] |= {"low_power": (62.85, 1300), "peaking-free": (2.165, 2.082), "cascade": (2.001, 2.038)}


def agrees(found: ObserverResult, rows: Rows) -> None:
    places = [round(10 * t) for t in rows]
    np.testing.assert_allclose(found.xhat[places], list(rows.values()), atol=6e-6)


@pytest.mark.costly
def test_trajectories_computed_elsewhere() -> None:
    blocks = {name: {**KINDS[name], "theta": 10} for name in ("nested", "peaking-free")}
    found = simulated(JERK, blocks, end=5, step=2.5e-4, measurement=NOISE).observers
    agrees(found["nested"], NESTED)
    agrees(found["peaking-free"], PEAKING_FREE)
    alone = simulated(JERK, {"C": {**KINDS["cascade"], "theta": 10}}, end=5, step=1e-3).observers["C"]
    agrees(alone, CASCADE)


def test_trajectory_computed_elsewhere_through_the_map() -> None:
    plant = {"type": "contois", "inputs": {"D": "0.5"}, "initial": {"x1": 1.5, "x2": 15}}
    block = {"type": "shgo", "theta": 4, "nested": {"M": [1]}, "initial": {"x1": 1, "x2": 14}}
    agrees(simulated(plant, {"N": block}, end=5, step=5e-4, measurement=NOISE).observers["N"], CONTOIS)


def peaks(theta: float) -> Result:
    blocks = {name: {**block, "theta": theta} for name, block in KINDS.items()}
    return simulated(JERK, blocks, end=40 / theta, output_step=0.005 / theta, step=0.005 / theta)


def largest(result: Result) -> dict[str, np.ndarray]:
    return {name: np.abs(o.xhat - result.x).max(axis=0)[1:] for name, o in result.observers.items()}


@pytest.mark.costly
def test_peaks_grow_with_theta_or_do_not() -> None:
    """Slopes of log peak in log theta, and the peaks themselves."""
    results = {theta: peaks(theta) for theta in (10, 50, 100, 1000)}
    found = {theta: largest(result) for theta, result in results.items()}
    for theta, expected in PEAKS.items():
        for name, values in expected.items():
            np.testing.assert_allclose(found[theta][name], values, rtol=6e-4, err_msg=f"{name}, theta = {theta}")
    slopes = {name: np.log2(found[100][name] / found[50][name]) for name in KINDS}
    np.testing.assert_allclose(slopes["shgo"], [1, 2], rtol=0.05)
    np.testing.assert_allclose(slopes["low_power"], [1, 2], rtol=0.05)
    assert np.all(np.abs(slopes["peaking-free"]) < 0.03)
    assert np.all(slopes["cascade"] <= 0)
    for name in ("nested", "nested fhgo2", "peaking-free", "cascade"):
        assert found[1000][name].max() < 5
    nested = (found[100]["nested"] - found[50]["nested"])[0], (found[1000]["nested"] - found[100]["nested"])[0]
    assert nested[0] == pytest.approx(0.385, abs=0.01)  # a doubling of theta
    assert nested[1] == pytest.approx(nested[0] * np.log2(10), rel=0.05)
    inner = [
        np.abs(r.observers["peaking-free"].internal["e"] + r.observers["peaking-free"].xhat[:, 1:2]).max()
        for r in (results[50], results[100])
    ]
    assert np.log2(inner[1] / inner[0]) == pytest.approx(1, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("measurement", [NOISE, {"sampling": {"period": 0.02}, "delay": 0.01}])
def test_without_limits_they_are_the_linear_observers_to_the_last_bit(measurement: Block) -> None:
    far = [1e9, 1e9]
    for linear, more in (
        ({"type": "shgo", "poles": [-1, -2, -1.5]}, {"nested": {"M": far}}),
        ({"type": "fhgo2", "r": 2}, {"nested": {"M": far}}),
        ({"type": "low_power"}, {"saturate": far}),
    ):
        blocks = {"linear": {**linear, "theta": 10}, "limited": {**linear, "theta": 10, **more}}
        found = simulated(JERK, blocks, end=2, step=1e-3, measurement=measurement).observers
        assert np.array_equal(found["linear"].xhat, found["limited"].xhat)


def test_with_two_states_a_lyapunov_function_does_not_grow() -> None:
    """V = int_0^e (g_2/g_1) theta sat(theta g_1 s) ds + e_2^2/2."""
    theta, M, (g_1, g_2) = 3.0, 0.4, (2.0, 1.0)
    block = {"type": "shgo", "theta": theta, "nested": {"M": [M]}, "initial": {"x1": 8, "x2": -9}}
    result = simulated(chain(2), {"N": block}, end=60, output_step=0.01, step=0.01)
    e = result.observers["N"].xhat - result.x
    edge, size = M / (theta * g_1), np.abs(e[:, 0])
    integral = np.where(size < edge, theta * g_1 * size**2 / 2, M * edge / 2 + M * (size - edge))
    V = g_2 / g_1 * theta * integral + e[:, 1] ** 2 / 2
    assert np.all(np.diff(V) <= 1e-9 * V[0])
    assert V[-1] < 1e-9 * V[0]


@pytest.mark.costly
@pytest.mark.parametrize(
    ("n", "block", "factors"),
    [
        (2, {"type": "shgo"}, (1, np.exp(-1))),
        (3, {"type": "shgo"}, (1, 0.79951, 0.23058)),
        (4, {"type": "shgo"}, (1, 1.25431, 0.72488, 0.16818)),
        (3, {"type": "fhgo2", "r": 1}, (1, 0.62886, 0.13060)),
        (3, {"type": "fhgo2", "r": 2}, (1, 0.55060, 0.09022)),
        (3, {"type": "low_power"}, (1, 0.62886, 0.13060)),
    ],
)
def test_peaks_of_a_chain_are_powers_of_theta_times_a_number(n: int, block: Block, factors: tuple[float, ...]) -> None:
    """p_i theta^(i-1), exactly, from the error (1, 0, ..., 0), at any theta: filters lower p_i, not the power."""
    thetas = (4, 8)
    blocks = {str(theta): {**block, "theta": theta, "initial": {"x1": 1}} for theta in thetas}
    found = simulated(chain(n, start=0), blocks, end=3, output_step=1e-3, step=2e-3).observers
    for theta in thetas:
        peak = np.abs(found[str(theta)].xhat).max(axis=0)
        np.testing.assert_allclose(peak / theta ** np.arange(n), factors, rtol=1e-4)


def test_small_errors_decay_like_those_of_the_linear_observer() -> None:
    """With |v_i| < M_i all the time: the same correction, of the same noise; rounded differently."""
    start = {"x1": 1.003, "x2": 0.002}
    blocks: dict[str, Block] = {
        "linear": {"type": "shgo", "theta": 10, "initial": start},
        "nested": {"type": "shgo", "theta": 10, "nested": {"M": [2, 2]}, "initial": start},
    }
    found = simulated(JERK, blocks, end=5, step=2e-3, measurement={"noise": sinusoid(0.005, 40)}).observers
    np.testing.assert_allclose(found["nested"].xhat, found["linear"].xhat, rtol=0, atol=1e-12)


def test_a_saturated_correction_is_slow() -> None:
    """e_2 changes by theta (g_2/g_1) M per time while theta g_1 |e_1| > M."""
    theta, M = 5.0, 0.8
    block = {"type": "shgo", "theta": theta, "nested": {"M": [M]}, "initial": {"x1": 20, "x2": 3}}
    result = simulated(chain(2, start=0), {"N": block}, end=4, output_step=0.01, step=2e-3)
    xhat = result.observers["N"].xhat
    saturated = theta * 2 * xhat[:, 0] > M
    end = int(np.argmin(saturated))
    assert 20 < end < result.time.size
    np.testing.assert_allclose(np.diff(xhat[:end, 1]) / 0.01, -theta / 2 * M, rtol=1e-9)


@pytest.mark.costly
def test_the_missing_model_leaves_the_error_of_the_formula() -> None:
    """-(alpha_1/alpha_2 + sum 1/alpha_j) x_i'/theta where x_i' is constant: x_3 = 0.6 t here."""
    plant = inline({"x1": "x2", "x2": "x3", "x3": "0.6"}, "x1", 0.0)
    block = {"type": "cascade", "theta": 20, "alpha": [3, 2, 0.8], "M": [1e3, 1e3]}
    result = simulated(plant, {"C": block}, end=5)
    error = (result.observers["C"].xhat - result.x)[-1, 2]
    assert error == pytest.approx(-(3 / 2 + 1 / 0.8) * 0.6 / 20, rel=1e-9)


def test_the_cascade_is_a_chain_of_filters() -> None:
    """Of y = exp(0.5 t): alpha_2 s/(mu^2 s^2 + alpha_1 mu s + alpha_2), then s/(1 + mu s/alpha_3), at s = 0.5."""
    s, mu, alpha = 0.5, 1 / 8, (3.0, 2.0, 0.8)
    plant = inline({"x1": "x2", "x2": "x3", "x3": "0.5*x3"}, "x1", initial={"x1": 1, "x2": s, "x3": s**2})
    block = {"type": "cascade", "theta": 1 / mu, "alpha": list(alpha), "M": [1e3, 1e3], "initial": {"x1": 1, "x2": 0.4}}
    found = simulated(plant, {"C": block}, end=6).observers["C"]
    np.testing.assert_allclose(found.xhat[0], [1, 0.4, 0], atol=1e-15)
    second = alpha[1] * s / (mu**2 * s**2 + alpha[0] * mu * s + alpha[1])
    expected = np.exp(s * 6) * np.array([second, second * s / (1 + mu * s / alpha[2])])
    np.testing.assert_allclose(found.xhat[-1, 1:], expected, rtol=1e-7)


def test_estimates_are_clipped_where_they_are_shown_and_nowhere_else() -> None:
    bounds = {"x2": [-0.5, 0.5]}
    blocks = {
        "raw": {"type": "shgo", "theta": 5, "saturation": bounds},
        "shown": {"type": "shgo", "theta": 5, "saturation": bounds, "clip_estimate": True},
        "sliding": {"type": "levant", "G": 3},
        "sliding, shown": {"type": "levant", "G": 3, "saturation": bounds, "clip_estimate": True},
    }
    run = experiment(JERK, blocks, end=2, solver={"method": "euler", "step": 1e-3}, measurement=NOISE)
    found = hgorun.simulate(run).observers
    for raw, shown in (("raw", "shown"), ("sliding", "sliding, shown")):
        low, high = np.array([-np.inf, -0.5, -np.inf]), np.array([np.inf, 0.5, np.inf])
        assert np.abs(found[raw].xhat[:, 1]).max() > 0.5
        assert np.array_equal(found[shown].xhat, np.clip(found[raw].xhat, low, high))
        assert found[shown].metrics["peak"][1] <= found[raw].metrics["peak"][1]


def test_what_is_shown_of_z_is_clipped_in_z() -> None:
    """phytoplankton is triangular in coordinates of its own, whose names the saturation has."""
    plant = {"type": "phytoplankton", "inputs": {"u": "0.5"}, "initial": {"x1": 0.5, "x2": 6, "x3": 0.7}}
    block = {"type": "shgo_riccati", "theta": 2, "initial": {"x1": 0.5, "x2": 5, "x3": 1}}
    clipped = {**block, "saturation": {"z2": [0.1, 0.15]}, "clip_estimate": True}
    x2 = simulated(plant, {"O": clipped}, step=0.01).observers["O"].xhat[:, 1]
    assert x2[0] == pytest.approx(1 / 0.15, rel=1e-12)
    assert np.all((x2 >= 1 / 0.15 - 1e-9) & (x2 <= 10 + 1e-9))


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"type": "shgo", "nested": {"M": [1]}}, "expected 2 numbers for the chain of"),
        ({"type": "shgo", "nested": {"M": {"other": [1, 1]}}}, "expected bounds for each output"),
        ({"type": "shgo", "nested": {"M": [1, 1]}, "gains": [-1, 3, 1]}, "need gains > 0"),
        ({"type": "low_power", "saturate": [1]}, "expected 2 bounds, of x_2..x_3; found 1"),
        ({"type": "cascade", "M": [1]}, "expected 2 bounds"),
        ({"type": "cascade", "M": [1, 1], "alpha": [1, 2]}, "expected 3 numbers; found 2"),
        ({"type": "cascade", "M": [1, -1]}, "expected a number above 0"),
        ({"type": "shgo", "clip_estimate": True}, "nothing to clip to"),
    ],
)
def test_keys_that_do_not_fit(block: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(JERK, {"O": {"theta": 2, **block}}))


def test_plants_that_do_not_fit() -> None:
    with pytest.raises(ConfigError, match="needs n >= 2"):
        prepare(experiment(chain(1), {"O": {"type": "cascade", "theta": 2, "M": []}}))
    bent = inline({"a": "b + b**3/3", "b": "-a"}, "a", 0.3)
    with pytest.raises(ConfigError, match=r"computes in z = Phi\(x\): this plant gives no inverse"):
        prepare(experiment(bent, {"O": {"type": "low_power", "theta": 2, "saturate": [2]}}))


def test_long_chains_are_warned_of() -> None:
    run = prepare(experiment(chain(4), {"O": {"type": "shgo", "theta": 2, "nested": {"M": [1, 1, 1]}}}))
    assert any("initial errors larger than M" in remark for remark in run.remarks)
    assert not prepare(experiment(JERK, {"O": {**KINDS["nested"], "theta": 2}})).remarks


def test_every_output_has_bounds_of_its_own() -> None:
    plant = inline({"a": "b", "b": "-a", "c": "d", "d": "f", "f": "-c - d"}, ["a", "c"])
    free = {"type": "shgo", "theta": 4}
    blocks = {
        "free": free,
        "first": {**free, "nested": {"M": {"a": [0.3], "c": [1e9, 1e9]}}},
        "wide": {**free, "nested": {"M": {"a": [1e9], "c": [1e9, 1e9]}}},
    }
    found = simulated(plant, blocks, end=1, step=0.01).observers
    assert np.array_equal(found["wide"].xhat, found["free"].xhat)
    assert np.array_equal(found["first"].xhat[:, 2:], found["free"].xhat[:, 2:])
    assert np.abs(found["first"].xhat[:, 1]).max() < np.abs(found["free"].xhat[:, 1]).max()


def named(*names: str) -> list[Finding]:
    return [one for one in findings("saturation", "noise", "convergence", "decay") if one.name in names]


def test_linear_theory_holds_inside_the_saturations_and_says_so() -> None:
    blocks = {name: {**KINDS[name], "theta": 10} for name in ("shgo", "nested", "low_power", "peaking-free", "cascade")}
    loud = experiment(JERK, blocks, end=6, output_step=0.01, step=5e-3, measurement=NOISE)
    found = analyze(loud, named("h2", "beta", "theta_bound", "peaking", "nonlinear_share")).observers
    for linear, limited in (("shgo", "nested"), ("low_power", "peaking-free")):
        one, other = said(found[linear]), said(found[limited])
        assert other["h2"] == pytest.approx(one["h2"], rel=1e-6)
        assert other["beta"] == one["beta"]
        assert "linear in the innovation" in found[limited].reasons["theta_bound"]
        assert other["peaking"]["x3"] < one["peaking"]["x3"]
        assert "nonlinear_share" not in one
    assert 0.8 < said(found["nested"])["nonlinear_share"] < 1
    assert said(found["peaking-free"])["nonlinear_share"] == 0
    quiet = loud.varied({"measurement.noise.0.terms.0.amplitude": 1e-3})
    for each in analyze(
        quiet, named("noise_rms_predicted", "noise_rms_measured", "nonlinear_share")
    ).observers.values():
        values = said(each)
        assert values["noise_rms_measured"]["x3"] == pytest.approx(values["noise_rms_predicted"]["x3"], rel=0.02)
        assert values.get("nonlinear_share", 0) == 0


@pytest.mark.costly
@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("shgo", {"nested": {"M": [1.0]}}),
        pytest.param("fhgo2", {"r": 2, "nested": {"M": [1.0]}}, marks=pytest.mark.slow),
        ("low_power", {"saturate": [5.0]}),
    ],
)
def test_they_keep_the_contract(name: str, more: Block) -> None:
    check_observer(OBSERVERS.find(name), more)


@pytest.mark.slow
def test_the_cascade_keeps_the_contract_on_a_longer_chain() -> None:
    check_observer(OBSERVERS.find("cascade"), {"M": [3.0, 3.0]}, plants=[JERK])
