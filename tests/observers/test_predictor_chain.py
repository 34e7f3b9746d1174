"""The chain of predictors, against its limits, a trajectory computed elsewhere, and Euler's method in a few lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from examples import VAN_DER_POL, Block, chain, experiment, findings, inline, simulated

import hgorun
from hgorun.errors import ConfigError
from hgorun.export.prepared import exported
from hgorun.observers.predictor_chain import PredictorChain, copy_limit
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.simulate import prepare
from hgorun.testing import check_observer

VDP: Block = VAN_DER_POL | {"parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}


def of(m: int | None = None, theta: float = 2.0, **keys: object) -> Block:
    return {"type": "predictor_chain", "theta": theta, **({} if m is None else {"m": m}), **keys}


@pytest.mark.slow
def test_contract() -> None:
    check_observer(PredictorChain)


@pytest.mark.parametrize(
    ("gain", "limit", "plain"),
    [
        ((2, 1), 2.7425, 0.6474),
        ((3, 3, 1), 0.9273, 0.4071),
        ((4, 6, 4, 1), 0.5237, 0.2968),
        ((1,), np.inf, np.pi / 2),
    ],
)
def test_limits_of_a_copy(gain: tuple[float, ...], limit: float, plain: float) -> None:
    assert copy_limit(np.array(gain), corrected=True) == pytest.approx(limit, abs=6e-5)
    assert copy_limit(np.array(gain), corrected=False) == pytest.approx(plain, abs=6e-5)


@pytest.mark.costly
@pytest.mark.parametrize("corrected", [True, False])
def test_stable_below_the_limit_and_unstable_above(corrected: bool) -> None:
    """Two copies on three integrators, 3 % to each side."""
    limit = copy_limit(np.array([3.0, 3, 1]), corrected=corrected)
    for share in (0.97, 1.03):
        delta = share * limit
        block = of(2, 1.0, corrected=corrected)
        result = simulated(
            chain(3, "0", [1, 0, 0]), {"K": block}, end=900, output_step=300, step=delta / 10,
            measurement={"delay": 2 * delta}, solver={"method": "rk4", "step": delta / 10, "divergence": 1e300},
        )  # fmt: skip
        size = np.max(np.abs(result.observers["K"].xhat - result.x), axis=1)
        assert (size[-1] < size[-2]) == (share < 1)


def test_error_on_a_chain() -> None:
    """Maximum norm of the last copy's error at 100, 200, 300, as another program found it."""
    result = simulated(
        chain(3, "0", [1, 0, 0]), {"K": of(2, 1.0)}, end=300, output_step=100, step=0.01, measurement={"delay": 1.7}
    )
    size = np.max(np.abs(result.observers["K"].xhat - result.x), axis=1)
    np.testing.assert_allclose(size[1:], [1.939, 0.0432, 7.54e-4], rtol=3e-3)


# an independent simulator, RK4 with steps of 0.01
TRAJECTORY = {
    0: (0, 0),
    1: (1.22790, 0.66101),
    2: (0.41915, -1.54393),
    5: (1.01060, 0.91911),
    10: (-1.38628, 1.13167),
    20: (0.93641, -1.44660),
}


def test_trajectory_computed_elsewhere() -> None:
    found = simulated(VDP, {"K": of(3)}, end=20, output_step=1, step=0.01, measurement={"delay": 1.5}).observers["K"]
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(found.xhat[t], expected, rtol=0, atol=6e-6)


@pytest.mark.parametrize(("d", "errors"), [(1.0, (1.1e-3, 4e-9)), (1.5, (0.35, 2.7e-5)), (2.0, (2.1, 0.026, 3.8e-5))])
def test_longer_delays_take_more_copies(d: float, errors: tuple[float, ...]) -> None:
    """Maximum error at t = 40."""
    for m, expected in enumerate(errors, 1):
        result = simulated(VDP, {"K": of(m)}, end=40, output_step=10, step=d / m / 50, measurement={"delay": d})
        found = float(np.max(np.abs(result.observers["K"].xhat - result.x)[-1]))
        assert found == pytest.approx(expected, rel=0.1)


def test_without_delay_it_is_the_standard_observer() -> None:
    blocks = {"K": of(), "S": {"type": "shgo", "theta": 2}}
    found = simulated(VDP, blocks, end=4, step=0.01).observers
    assert np.array_equal(found["K"].xhat, found["S"].xhat)
    assert not found["K"].internal


DRIVEN = {
    "states": ["a", "b"],
    "dynamics": {"a": "b", "b": "-a + u"},
    "inputs": {"u": "sin(3*t)"},
    "output": "a",
    "initial": {"a": 1, "b": 0},
}


@pytest.mark.parametrize("period", [None, 0.2])
def test_inputs_of_each_copys_time_and_late_samples(period: float | None) -> None:
    """Euler's method in a few lines, with the copies' past in a list; of samples the innovation follows e' = -c."""
    d, m, theta, h, end = 0.6, 2, 2.0, 0.02, 3.0
    measurement: Block = {"delay": d} if period is None else {"delay": d, "sampling": {"period": period}}
    solver = {"method": "euler", "step": h}
    result = simulated(DRIVEN, {"K": of(m, theta)}, end=end, output_step=h, measurement=measurement, solver=solver)
    x = naive(result.x, d, m, theta, h, period)
    np.testing.assert_allclose(result.observers["K"].xhat, x, rtol=0, atol=1e-12)


def naive(plant: np.ndarray, d: float, m: int, theta: float, h: float, period: float | None) -> np.ndarray:
    """x_m along Euler's steps."""
    late, lag = round(d / h), round(d / m / h)
    x, alpha, past, e_0 = np.zeros((m + 1, 2)), np.zeros(m + 1), [], 0.0
    K = np.array([2 * theta, theta**2])
    found = []
    for i in range(len(plant)):
        past.append((x[:, 0] - alpha).copy())
        found.append(x[m].copy())
        y = plant[max(i - late, 0), 0]
        before = past[max(i - lag, 0)]
        if period is None or i % round(period / h) == 0:
            e_0 = x[0, 0] - y
        e = np.concatenate([[e_0], before[1:] + alpha[1:] - x[:-1, 0]])
        t = i * h - d + np.arange(m + 1) * d / m
        rate = np.column_stack([x[:, 1], -x[:, 0] + np.sin(3 * t)]) - e[:, None] * K
        x = x + h * rate
        alpha[1:] -= h * K[0] * e[1:]
        e_0 -= h * K[0] * e_0
    return np.array(found)


@pytest.mark.slow
def test_two_outputs() -> None:
    """Two plants side by side are two observers."""
    two = inline({"a": "b", "b": "-a", "c": "d", "d": "-2*c"}, {"y": "a", "z": "c"})
    both = simulated(two, {"K": of(2)}, end=4, step=0.01, measurement={"delay": 1})
    for first, w in (("a", "1"), ("c", "2")):
        one = inline({"a": "b", "b": f"-{w}*a"}, "a")
        alone = simulated(one, {"K": of(2)}, end=4, step=0.01, measurement={"delay": 1}).observers["K"].xhat
        at = both.states.index(first)
        np.testing.assert_allclose(both.observers["K"].xhat[:, at : at + 2], alone, rtol=0, atol=1e-12)


def test_through_the_observability_map() -> None:
    """A plant that is no chain: corrections are lifted, and the estimate arrives."""
    plant = inline({"a": "-a + b", "b": "-2*b + sin(a)"}, "a + b/4", 0.5)
    result = simulated(plant, {"K": of(theta=3)}, end=12, output_step=1, step=0.01, measurement={"delay": 1.5})
    error = np.max(np.abs(result.observers["K"].xhat - result.x), axis=1)
    assert np.max(error[:3]) > 0.1
    assert np.max(error[-3:]) < 1e-4


def test_number_of_copies_follows_theta_and_the_delay() -> None:
    """The smallest with theta d/m up to 0.6 of 2.7425."""
    for d, m in ((0.5, 1), (1.6, 2), (1.7, 3)):
        found = simulated(VDP, {"K": of()}, end=2, step=0.01, measurement={"delay": d}).observers["K"]
        assert found.internal["copies"].shape[1] == m


def test_analysis() -> None:
    blocks = {"K": of(2), "S": {"type": "shgo", "theta": 2}}
    run = experiment(chain(3), blocks, end=3, step=0.01, measurement={"delay": 0.3})
    found = hgorun.analyze(run, findings("stability", "decay", "noise", "convergence")).observers
    assert found["K"].values["delay_critical_chain"] == pytest.approx(2 * 0.9273 / 2, rel=1e-4)
    assert found["S"].values["delay_critical"] == pytest.approx(0.9273 / 2, rel=1e-3)
    for name in ("poles", "h2", "period_critical", "delay_critical", "theta_bound"):
        assert "looks back" in found["K"].reasons[name]


@pytest.mark.slow
@pytest.mark.parametrize("sampling", [{"sampling": {"period": 0.1}}, {}], ids=["sampled", "continuous"])
def test_alone_in_company_and_in_lanes(sampling: Block) -> None:
    held: Block = {} if sampling else {"hold": 0.1}
    late: Block = {"delay": 0.4, **sampling, "noise": [{"type": "gaussian", "std": 0.1, **held}]}
    shgo: Block = {"type": "shgo", "theta": 2}
    blocks = {"K": of(2), "S": shgo, "D": shgo | ({"late": "drop"} if sampling else {"theta": 1}), "L": of(1)}
    keep: Block = {"end": 2, "step": 0.01, "measurement": late}
    company = simulated(VDP, blocks, **keep).observers
    for label, block in blocks.items():
        assert np.array_equal(simulated(VDP, {label: block}, **keep).observers[label].xhat, company[label].xhat)
    runs = [prepare(experiment(VDP, {"K": of(2, initial={"x1": 0.1 * k})}, **keep)) for k in range(4)]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, one in enumerate(runs):
        assert np.array_equal(together.rows[..., lane], integrate(one, as_given(one)).rows[..., 0])


@pytest.mark.costly
def test_a_sweep_of_theta(tmp_path: Path) -> None:
    """Of which the number of copies follows: members of two structures."""
    base = experiment(VDP, {"K": of()}, end=3, step=0.01, measurement={"delay": 1})
    swept = hgorun.sweep(base, {"observers.K.theta": [1.5, 2, 3]}, output=f"{tmp_path}/swept.h5")
    rmse = swept.to_xarray()["rmse"].sel(observer="K").values
    for i, theta in enumerate((1.5, 2, 3)):
        alone = hgorun.simulate(base.varied({"observers.K.theta": theta})).observers["K"]
        assert np.array_equal(rmse[i], alone.metrics["rmse"])


def test_automatic_steps() -> None:
    result = simulated(VDP, {"K": of(3)}, end=20, output_step=1, measurement={"delay": 1.5})
    assert result.observers["K"].verdict.status == "ok"
    np.testing.assert_allclose(result.observers["K"].xhat[20], TRAJECTORY[20], atol=1e-4)


TWO = inline({"a": "b", "b": "-a", "c": "-c"}, {"y": "a", "z": "c"})
REPLAYED: Block = {"type": "ekf", "Q": {"x2": 1}, "R": 1}


@pytest.mark.parametrize(
    ("blocks", "plant", "measurement", "message"),
    [
        ({"K": of()}, VDP, {"delay": "0.5 + 0.1*sin(t)"}, "the delay changes"),
        ({"K": of(0)}, VDP, {"delay": 0.5}, "a delay of 0.5 takes a copy or more; found 0"),
        ({"K": of(2)}, VDP, {}, "a delay of 0 takes m: 0, which is shgo; found 2"),
        ({"K": of(theta=500)}, VDP, {"delay": 0.5}, "more than 50"),
        ({"K": of(-1)}, VDP, {"delay": 0.5}, "K.m"),
        ({"K": of(50)}, VDP, {"delay": 0.1}, "0.002 apart, less than the step 0.01"),
        ({"K": of(coordinates="canonical")}, VDP, {"delay": 0.5}, "in the plant's coordinates"),
        ({"K": of(late="replay")}, VDP, {"delay": 0.5, "sampling": {"period": 0.1}}, "crosses the delay itself"),
        ({"K": of()}, TWO, {"delay": 0.5, "outputs": {"z": {"delay": 0.4}}}, "the outputs have several"),
        ({"K": of(), "E": REPLAYED}, VDP, {"delay": 0.5, "sampling": {"period": 0.1}}, "E goes back in time"),
        ({"K": of()}, inline({"a": "b", "b": "-a"}, {"y": "a", "z": "2*a"}), {"delay": 1}, "one chain between them"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(blocks: dict[str, Block], plant: Block, measurement: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(plant, blocks, step=0.01, measurement=measurement))


def test_history_needs_memory() -> None:
    config: Block = {"time": {"end": 1e4, "output_step": 1e3, "max_memory": 1e5}}
    late: Block = {"delay": 1000, "sampling": {"period": 100}}
    with pytest.raises(ConfigError, match=r"observers.K: .* the history of a delay of 1e\+03 takes"):
        hgorun.simulate(experiment(VDP, {"K": of(1, 1e-3)}, step=0.01, measurement=late, **config))


def test_it_does_not_follow_a_stream() -> None:
    with pytest.raises(ConfigError, match="kept in simulations alone"):
        hgorun.Estimator(experiment(VDP, {"K": of()}))


def test_it_is_not_exported() -> None:
    run = prepare(experiment(VDP, {"K": of()}, step=0.01, measurement={"delay": 0.5}))
    with pytest.raises(ConfigError, match="kept in simulations alone"):
        exported(run)
