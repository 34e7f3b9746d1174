"""Runs with default settings against closed forms and scipy: right to the accuracy, or said not to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment, inline, load
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hgorun import Experiment, Result, simulate
from hgorun.errors import ConfigError
from hgorun.result.records.status import Verdict
from hgorun.simulation.error_control.control import _when
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.timeline.steps import part_of_difference, uneven_steps

Right = Callable[[float, float, float], float]


def chain_of_two(phi: str, x0: Sequence[float], xhat0: Sequence[float], *, end: float, **more: Any) -> Experiment:
    """x1' = x2, x2' = phi, with a standard observer."""
    theta, noise = more.pop("theta", 2), more.pop("noise", None)
    plant = inline({"x1": "x2", "x2": phi}, "x1", initial={"x1": x0[0], "x2": x0[1]})
    observer = {"type": "shgo", "theta": theta, "initial": {"x1": xhat0[0], "x2": xhat0[1]}}
    measurement = {} if noise is None else {"noise": [{"type": "expression", "value": noise}]}
    return experiment(plant, {"S": observer}, end=end, output_step=end / 200, measurement=measurement, **more)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A chain of two, and the same for scipy."""

    phi: str
    right: Right
    end: float
    start: tuple[float, float] = (1.0, 0.0)
    estimate: tuple[float, float] = (0.0, 0.0)
    theta: float = 2.0
    noise: str | None = None
    measured: Callable[[float], float] = lambda t: 0.0
    breaks: tuple[float, ...] = ()
    method: str = "DOP853"
    longest: float = np.inf

    def experiment(self, **solver: Any) -> Experiment:
        return chain_of_two(
            self.phi, self.start, self.estimate, end=self.end, theta=self.theta, noise=self.noise, solver=solver
        )

    def exact(self, grid: np.ndarray) -> np.ndarray:
        """(x, xhat) by scipy, piece by piece."""

        def flow(t: float, z: np.ndarray) -> list[float]:
            e = z[2] - z[0] - self.measured(t)
            correction = 2 * self.theta * e, self.theta**2 * e
            return [z[1], self.right(t, z[0], z[1]), z[3] - correction[0], self.right(t, z[2], z[3]) - correction[1]]

        found, z = np.zeros((grid.size, 4)), np.array([*self.start, *self.estimate])
        edges = [0.0, *self.breaks, self.end]
        for a, b in pairwise(edges):
            inside = (grid >= a) & (grid <= b)
            longest = min(self.longest, (b - a) / 50)
            times = np.unique(np.append(grid[inside], b))
            solution = solve_ivp(
                flow, (a, b), z, method=self.method, rtol=1e-9, atol=1e-12, t_eval=times, max_step=longest
            )
            found[inside], z = solution.y.T[: inside.sum()], solution.y[:, -1]
        return found


def gauss(t: float, at: float, width: float) -> float:
    return float(np.exp(-(((t - at) / width) ** 2)))


CASES = {
    "a wrong first estimate": Case(
        phi="(1 - x1**2)*x2 - x1", right=lambda t, a, b: (1 - a**2) * b - a, end=20, estimate=(20, 0), theta=1
    ),
    "a pulse of 10 ms in 1000 s": Case(
        phi="-x1 - 0.2*x2 + 50*exp(-((t - 500)/0.01)**2)",
        right=lambda t, a, b: -a - 0.2 * b + 50 * gauss(t, 500, 0.01),
        end=1000, estimate=(1, 0), breaks=(499.9, 500.1),
    ),
    "two pulses": Case(
        phi="-x1 - 0.2*x2 + 50*exp(-((t - 50)/0.003)**2) - 80*exp(-((t - 73.3)/0.005)**2)",
        right=lambda t, a, b: -a - 0.2 * b + 50 * gauss(t, 50, 0.003) - 80 * gauss(t, 73.3, 0.005),
        end=100, breaks=(49.98, 50.02, 73.25, 73.35),
    ),
    "a pulse of noise": Case(
        phi="-x1 - 0.2*x2", right=lambda t, a, b: -a - 0.2 * b, end=100, estimate=(1, 0), theta=5,
        noise="5*exp(-((t - 60.123)/0.003)**2)", measured=lambda t: 5 * gauss(t, 60.123, 0.003), breaks=(60.1, 60.15),
    ),
    "fast late": Case(
        phi="-where(t < 8, 1, 10000)*x1 - 0.3*x2", right=lambda t, a, b: -(1 if t < 8 else 10000) * a - 0.3 * b,
        end=10, theta=4, breaks=(8,),
    ),
    "fast from some state on": Case(
        phi="-tanh(1e4*x2) - x1", right=lambda t, a, b: -np.tanh(1e4 * b) - a, end=5, start=(3, 0), estimate=(2, 0),
        theta=3, method="Radau",
    ),
    "expression noise": Case(
        phi="-x1 - 0.2*x2", right=lambda t, a, b: -a - 0.2 * b, end=2, estimate=(1, 0), noise="0.5*sin(1000*t)",
        measured=lambda t: 0.5 * np.sin(1000 * t), longest=1e-3,
    ),
    "relaxation": Case(
        phi="30*(1 - x1**2)*x2 - x1", right=lambda t, a, b: 30 * (1 - a**2) * b - a, end=60, start=(2, 0),
        estimate=(2, 0.1), method="Radau",
    ),
    "periapsis": Case(
        phi="-1/x1**2 + 0.02/x1**3", right=lambda t, a, b: -1 / a**2 + 0.02 / a**3, end=10, estimate=(1, 0.01), theta=5,
    ),
    "kinks in the state": Case(
        phi="-x1 - 0.2*x2 - 20*max(0, x1 - 0.5)", right=lambda t, a, b: -a - 0.2 * b - 20 * max(0, a - 0.5), end=10,
        theta=3,
    ),
}  # fmt: skip


def sizes(x: np.ndarray, xhat: np.ndarray, time: np.ndarray, end: float) -> dict[str, np.ndarray]:
    """rmse, sup and peak, written out."""
    e = np.abs(xhat - x)
    late, early = e[time >= end / 3 * (1 - 1e-12)], e[time <= end / 3 * (1 + 1e-12)]
    return {"rmse": np.sqrt(np.mean(late**2, axis=0)), "sup": late.max(axis=0), "peak": early.max(axis=0)}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_default_settings_are_right(name: str) -> None:
    case = CASES[name]
    result = simulate(case.experiment())
    exact = case.exact(result.time)
    size = np.abs(exact[:, :2]).max(axis=0)
    assert result.status == "ok"
    assert np.all(np.abs(result.x - exact[:, :2]) <= 1e-3 * size)
    for metric, value in sizes(exact[:, :2], exact[:, 2:], result.time, case.end).items():
        found = result.observers["S"].metrics[metric]
        # scipy's own errors are some 1e-8
        assert np.all(np.abs(found - value) <= 1e-3 * np.maximum(value, 1e-6 * size) + 1e-7 * size), metric
    assert result.integration_error is not None
    assert max(result.integration_error.values()) <= 1e-3


@pytest.mark.costly
def test_the_accuracy_can_be_chosen() -> None:
    case = CASES["a wrong first estimate"]
    errors, evaluations = [], []
    for accuracy in (1e-2, 1e-5, 1e-8):
        result = simulate(case.experiment(accuracy=accuracy))
        exact = case.exact(result.time) if accuracy > 1e-6 else simulate(case.experiment(step=1e-4)).x
        errors.append(float(np.max(np.abs(result.x - exact[:, :2]))))
        assert errors[-1] <= accuracy * 2
        assert result.integration is not None
        assert result.integration.evaluations is not None
        evaluations.append(result.integration.evaluations)
    assert evaluations[0] < min(evaluations[1:])


HEATER = inline(
    {"T": "(20 - T)/tau + P/C"}, "T", start=20,
    parameters={"tau": 120, "C": 500, "P0": 1000}, inputs={"P": "P0*sin(2*pi*50*t)**2"},
)  # fmt: skip


def test_mains_power_is_not_seen_at_its_zeros_alone() -> None:
    """Steps of 1 s, and their halves, meet sin(2 pi 50 t)^2 where it is zero."""
    result = simulate(experiment(HEATER, {}, end=1000, output_step=10, measurement={"sampling": {"period": 10}}))
    assert result.x[-1, 0] == pytest.approx(20 + 120 * (1 - np.exp(-1000 / 120)), rel=1e-4)


@pytest.mark.parametrize("step", [1.0, 0.5])
@pytest.mark.parametrize("finer", [False, True])
def test_a_given_step_at_the_zeros_of_the_power_is_told(step: float, finer: bool) -> None:
    result = simulate(experiment(HEATER, {}, end=1000, output_step=10, step=step), check_step=finer)
    assert result.x[-1, 0] == pytest.approx(20)
    assert result.integration_error is not None
    assert result.integration_error["plant"] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize("frequencies", [[1024], [1000, 1024], [4096, 5000, 720], [10240], [997]])
@pytest.mark.parametrize("period", [None, 0.1, 0.125])
def test_frequencies_that_alias_on_several_grids(frequencies: list[int], period: float | None) -> None:
    """x' = -x + sum sin(2 pi f t)^2, in closed form."""
    power = " + ".join(f"sin(2*pi*{f}*t)**2" for f in frequencies)
    measurement = {} if period is None else {"sampling": {"period": period}}
    result = simulate(
        experiment(inline({"x": f"-x + {power}"}, "x", start=0), {}, end=1, output_step=0.125, measurement=measurement)
    )
    t = result.time
    exact = np.zeros(t.size)
    for f in frequencies:
        w = 4 * np.pi * f
        swing = (np.cos(w * t) + w * np.sin(w * t) - np.exp(-t)) / (1 + w**2)
        exact += 0.5 * (1 - np.exp(-t)) - 0.5 * swing
    assert result.status == "ok"
    assert np.abs(result.x[:, 0] - exact).max() <= 1e-3 * exact.max()


def test_one_step_a_gap_is_looked_at() -> None:
    """Samples closer than the nominal step, with an input that is zero at all of them."""
    plant = inline({"x": "-0.01*x + sin(2*pi*100*t)**2"}, "x", start=0)
    found = simulate(experiment(plant, {}, end=10, output_step=1, measurement={"sampling": {"period": 0.005}}))
    exact = 0.5 / 0.01 * (1 - np.exp(-0.01 * found.time))
    assert np.abs(found.x[:, 0] - exact).max() <= 1e-3 * exact.max()


def test_doses_of_ten_seconds_every_hour_for_thirty_days() -> None:
    k10, k12, k21 = 2e-5, 1e-5, 5e-6
    plant = inline(
        {"c": "u + k21*p - (k10 + k12)*c", "p": "k12*c - k21*p"}, "c", start=0,
        parameters={"k10": k10, "k12": k12, "k21": k21}, inputs={"u": "t - 3600*floor(t/3600) < 10"},
    )  # fmt: skip
    sampling = {"sampling": {"period": 3600, "offset": 1800}}
    observer = {"type": "shgo", "theta": 1e-4}
    result = simulate(experiment(plant, {"S": observer}, end=30 * 86400, output_step=3600, measurement=sampling))
    A = np.array([[-k10 - k12, k21, 1], [k12, -k21, 0], [0, 0, 0]])
    hour = expm(np.diag([1, 1, 0]) @ A * 3590) @ np.diag([1, 1, 0]) @ expm(A * 10)
    z = np.array([0.0, 0, 1])
    for _ in range(720):
        z = hour @ np.array([z[0], z[1], 1])
    assert result.x[-1] == pytest.approx(z[:2], rel=1e-3)
    assert result.x[-1] == pytest.approx([133.98, 277.66], rel=1e-4)


def test_robertson() -> None:
    dynamics = {"a": "-0.04*a + 1e4*b*c", "b": "0.04*a - 1e4*b*c - 3e7*b**2", "c": "3e7*b**2"}
    plant = inline(dynamics, "a", initial={"a": 1, "b": 0, "c": 0})
    result = simulate(experiment(plant, {}, end=40, output_step=1))
    assert result.x[-1] == pytest.approx([0.7158271, 9.185535e-6, 0.2841637], rel=1e-3)


def chaotic(end: float, **solver: Any) -> Result:
    dynamics = {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8/3*z"}
    plant = inline(dynamics, "x", initial={"x": 1, "y": 1, "z": 20})
    return simulate(experiment(plant, {}, end=end, output_step=end / 100, solver=solver))


def test_a_chaotic_plant_over_a_long_time_is_said_to_be_inaccurate() -> None:
    assert chaotic(5).status == "ok"
    result = chaotic(100, max_evaluations=2e6)
    assert result.status == "inaccurate"
    assert result.verdict.reason is not None
    assert "size of the numbers" in result.verdict.reason
    assert "solver.accuracy allows 0.001" in result.verdict.reason


def test_a_budget_that_is_too_small_is_said() -> None:
    case = CASES["expression noise"]
    result = simulate(case.experiment(max_evaluations=16000))
    assert result.status == "inaccurate"
    assert result.integration is not None
    assert result.integration.evaluations is not None
    assert result.integration.evaluations <= 16000
    assert "16000" in (result.observers["S"].reason or "")
    with pytest.raises(ConfigError, match=r"solver\.max_evaluations: 800 evaluations"):
        simulate(case.experiment(max_evaluations=800))


def test_company_changes_no_more_than_the_accuracy() -> None:
    """A fast observer beside a slow one makes the steps of both shorter."""
    slow = {"type": "shgo", "theta": 1, "initial": {"x1": 0, "x2": 0}}
    fast = {"type": "shgo", "theta": 200, "initial": {"x1": 3, "x2": 0}}
    alone, beside = (
        simulate(experiment(VAN_DER_POL, observers, end=10)).observers["S"].metrics["rmse"]
        for observers in ({"S": slow}, {"S": slow, "F": fast})
    )
    assert alone == pytest.approx(beside, rel=1e-3)
    assert not np.array_equal(alone, beside)


def test_the_same_run_has_the_same_bits() -> None:
    case = CASES["fast from some state on"]
    first, second = (simulate(case.experiment()).observers["S"].xhat for _ in range(2))
    assert np.array_equal(first, second)


SWITCHING: dict[str, dict[str, Any]] = {
    "levant": {"G": 10},
    "direct": {"theta": 2, "mu": 5, "phi": 40, "G": 10},
    "direct_dynamic": {"a": 1, "b": 2.5, "q": 0.15, "gamma": "y**2", "mu_0": 5, "phi": 40, "G": 10},
}


@pytest.mark.parametrize("name", SWITCHING)
def test_observers_without_a_limit_need_a_given_step(tmp_path: Path, name: str) -> None:
    config = {
        "time": {"end": 1, "output_step": 0.1},
        "plant": VAN_DER_POL,
        "observers": {"L": {"type": name, **SWITCHING[name], "initial": {"x1": 1, "x2": 0}}},
    }
    with pytest.raises(ConfigError, match=rf"experiment.yaml:\d+: solver.step: observer L \({name}\) switches"):
        prepare(load(tmp_path, config))
    given = simulate(load(tmp_path, config, "solver.step=1e-3"))
    assert given.integration_error == pytest.approx({"plant": 0.0}, abs=1e-6)


def test_observers_that_do_not_switch_have_a_limit(tmp_path: Path) -> None:
    """Without differentiator, and with implicit steps at the samples, which do not depend on the solver's."""
    observers = {
        "D": {"type": "direct", "theta": 2, "poles": -1},
        "L": {"type": "levant", "G": 10, "discretisation": "implicit"},
    }
    sampled = {"sampling": {"period": 0.05}}
    found, given = (
        simulate(experiment(VAN_DER_POL, observers, end=5, measurement=sampled, solver=solver))
        for solver in ({}, {"method": "dopri5", "step": 1e-3})
    )
    assert found.status == "ok"
    for label in observers:
        assert np.allclose(found.observers[label].xhat, given.observers[label].xhat, rtol=1e-4, atol=1e-4)


def test_extremes_are_events_of_automatic_steps_only() -> None:
    case = CASES["two pulses"]
    events = prepare(case.experiment()).schedule.events
    assert np.any(np.abs(events - 50) < 1e-9)
    assert np.any(np.abs(events - 73.3) < 1e-9)
    assert prepare(case.experiment(step=0.01)).schedule.events.size == 2


def test_a_pulse_is_met_whenever_the_clock_began() -> None:
    """x' = exp(-((t - 730)/0.01)^2): x grows by 0.01 sqrt(pi), on a clock that starts at 1e6 too."""
    origin = 1e6
    plant = inline({"x": "u"}, "x", inputs={"u": f"exp(-((t - {origin + 730})/0.01)**2)"}, initial={"x": 0})
    e = experiment(plant, {"S": {"type": "shgo", "theta": 0.1}}, end=1000, output_step=10)
    result = simulate(e.varied({"time.start": origin, "time.end": origin + 1000}))
    assert result.x[-1, 0] == pytest.approx(0.01 * np.sqrt(np.pi), rel=1e-3)
    assert result.status == "ok"


@pytest.mark.slow
@pytest.mark.parametrize("end", [500, 2000])
def test_a_pulse_among_many_extremes_is_met(end: float) -> None:
    """x' = 200 cos(200 t) + pulse: 30,000 or 120,000 extremes, and a pulse of a millisecond at t = 333.3."""
    u = "200*cos(200*t) + 1000*exp(-((t - 333.3)/1e-3)**2)"
    plant = inline({"x": "u"}, "x", inputs={"u": u}, initial={"x": 0})
    result = simulate(experiment(plant, {"S": {"type": "shgo", "theta": 0.1}}, end=end, output_step=1))
    assert result.x[-1, 0] == pytest.approx(np.sin(200 * end) + np.sqrt(np.pi), abs=4e-3)
    assert result.remarks == ()


@pytest.mark.costly
def test_pulses_that_cannot_all_be_found_are_said() -> None:
    """Fifteen thousand narrow pulses: their slope is lost in underflow between them."""
    plant = inline({"x": "u - x"}, "x", inputs={"u": "3e4*exp(-(sin(50*pi*t)/1e-3)**2)"}, initial={"x": 0})
    result = simulate(experiment(plant, {"S": {"type": "shgo", "theta": 0.1}}, end=300, output_step=1))
    assert result.status == "inaccurate"
    for verdict in (result.verdict, result.observers["S"].verdict):
        assert "pulses that are shorter than the steps may have been missed" in (verdict.reason or "")


def test_pulses_of_noise_that_cannot_all_be_found_are_said_of_the_observers() -> None:
    plant = inline({"x": "-x"}, "x", initial={"x": 1})
    noise = {"noise": [{"type": "expression", "value": "exp(-(sin(1000*pi*t)/1e-3)**2)"}]}
    result = simulate(experiment(plant, {"S": {"type": "shgo", "theta": 1}}, end=100, output_step=1, measurement=noise))
    assert (result.verdict.status, result.observers["S"].status) == ("ok", "inaccurate")


@pytest.mark.costly
def test_many_extremes_that_the_steps_see_are_not_told() -> None:
    """A hundred thousand periods of mains power: the steps of the run follow each of them."""
    plant = inline({"x": "sin(2*pi*100*t)**2 - x"}, "x", initial={"x": 0})
    result = simulate(experiment(plant, {"S": {"type": "shgo", "theta": 1}}, end=300, output_step=1))
    assert (result.status, result.remarks) == ("ok", ())
    assert result.x[-1, 0] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("size", [1e4, 1e8])
def test_a_large_initial_gain_is_followed(size: float) -> None:
    """P(0) makes the first instants fast; another method with tight tolerances knows the metrics."""
    observers = {"R": {"type": "shgo_riccati", "theta": 2, "internal": {"P": size}, "initial": {"x1": 2, "x2": 1}}}
    e = experiment(VAN_DER_POL, observers, end=10, output_step=0.05)
    found = simulate(e)
    right = simulate(e.varied({"solver": {"method": "rodas5p", "rtol": 1e-10}}))
    assert found.status == "ok"
    for name, values in right.observers["R"].metrics.items():
        accuracy = 1e-3 + (0.05 / 10 if name == "settling" else 0)
        np.testing.assert_allclose(found.observers["R"].metrics[name], values, rtol=accuracy, atol=1e-9, err_msg=name)


@pytest.mark.parametrize("delay", ["0.1", "0.1*(1 + sin(t)/2)"], ids=["constant", "varying"])
def test_delayed_outputs_are_right_with_default_settings(delay: str) -> None:
    observers = {"SHGO": {"type": "shgo", "theta": 3, "initial": {"x1": 2, "x2": 1}}}
    e = experiment(VAN_DER_POL, observers, end=10, output_step=0.05, measurement={"delay": delay})
    found, right = simulate(e), simulate(e.varied({"solver": {"method": "dopri5", "step": 2e-4}}))
    assert found.status == "ok"
    for name, values in right.observers["SHGO"].metrics.items():
        accuracy = 1e-3 + (0.05 / 10 if name == "settling" else 0)
        np.testing.assert_allclose(found.observers["SHGO"].metrics[name], values, rtol=accuracy, err_msg=name)


@pytest.mark.parametrize("ratio", [0.125, 0.62, 1.62])
def test_steps_that_are_compared_are_others(ratio: float) -> None:
    steps = np.arange(1, 2000)
    other = uneven_steps(steps, ratio)
    assert np.all(other >= 2)
    assert np.all((other != steps) | (steps <= 2))
    assert np.all(other[steps > 20] / steps[steps > 20] == pytest.approx(ratio, rel=0.3))
    for order in (1, 2, 4):
        parts = [part_of_difference(np.array([n]), ratio, order) for n in (1, 2, 3, 10, 1000)]
        assert max(parts) < 3.5


def test_an_observer_of_which_nothing_is_said_is_never_lost_and_one_without_a_time_always() -> None:
    assert _when(None) == np.inf
    assert _when(Verdict("diverged", 2.5)) == 2.5
    assert _when(Verdict("failed")) == -np.inf


def test_a_bound_that_is_given_decides_who_has_diverged() -> None:
    """Without a correction the estimate is 2 e^t, and passes 5 at ln 2.5."""
    plant = inline({"x1": "x1"}, "x1", start=1.0)
    result = simulate(
        experiment(
            plant, {"A": {"type": "shgo", "theta": 1e-9, "initial": {"x1": 2}}}, end=3.0, solver={"divergence": 5}
        )
    )
    verdict = result.observers["A"].verdict
    assert verdict.status == "diverged"
    assert verdict.at == pytest.approx(np.log(2.5), abs=0.1)
