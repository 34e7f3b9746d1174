"""Critical periods and delays: known numbers, and runs a little below and above them."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from examples import ACADEMIC, VAN_DER_POL, Block, chain, experiment, inline

import hgorun
from hgorun.analysis.linear.error_system import ErrorSystem, error_system
from hgorun.analysis.linear.nominal import nominal
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.stability.critical import (
    Limit,
    chain_system,
    critical_delay,
    critical_period,
    critical_together,
    declared_limit,
    timing_of,
)
from hgorun.analysis.stability.growth import growth
from hgorun.observers.base import OBSERVERS, Flow, SampledObserver
from hgorun.observers.shgo import StandardObserver
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.symbols import Symbols

CHAIN = chain(3, start=0)
SHGO = {"type": "shgo", "theta": 1}


def prepared(observers: dict[str, Block], plant: Block = CHAIN, end: float = 5, **more: Any) -> PreparedRun:
    return prepare(experiment(plant, observers, end=end, output_step=end / 1000, **more))


def chain_period(run: PreparedRun, label: str) -> float:
    return critical_period(timing_of(run), chain_system(run, label)).value


def chain_delay(run: PreparedRun, label: str) -> float:
    return critical_delay(timing_of(run), chain_system(run, label)).value


def own_period(run: PreparedRun, label: str) -> float:
    """What an observer that jumps at the samples declares."""
    observer = run.experiment.observers[label]
    assert isinstance(observer, SampledObserver)
    return declared_limit(observer.longest_period(run.forms[label])).value


def along(limit: Callable[[Any, Any], Limit], run: PreparedRun, label: str) -> float:
    """A limit along the nominal run."""
    return limit(timing_of(run), error_system(run, label, nominal(run))).value


def decay(run: PreparedRun, label: str) -> float:
    """Logarithm of the error's growth over the second half of a run, envelope against envelope."""
    result = simulate_prepared(run)
    xhat = result.observers[label].xhat
    e = np.linalg.norm(xhat - result.x, axis=1)
    if not np.all(np.isfinite(e)):
        return np.inf
    quarter = e.size // 4
    return float(np.log(np.max(e[-quarter:]) / np.max(e[quarter : 2 * quarter])))


@pytest.mark.slow
def test_periods_of_three_integrators() -> None:
    """theta T_e, computed independently of this project."""
    known: dict[str, tuple[dict[str, Any], float]] = {
        "shgo": ({"type": "shgo"}, 2.896),
        **{f"r={r}": ({"type": "fhgo2", "r": r}, T) for r, T in ((1, 2.855), (2, 2.968), (3, 3.014), (4, 3.163))},
        **{
            f"delta={delta}": ({"type": "fhgo1", "delta": delta}, T)
            for delta, T in ((1, 0.698), (2, 1.079), (3, 1.307), (5, 1.785), (7, 2.028), (10, 2.241), (100, 2.820))
        },
    }
    run = prepared({name: {**block, "theta": 4} for name, (block, _) in known.items()})
    for label, (_, T) in known.items():
        assert 4 * chain_period(run, label) == pytest.approx(T, abs=6e-4), label


def test_delays_of_three_integrators() -> None:
    run = prepared({f"r={r}": {"type": "fhgo2", "theta": 3, "r": r} for r in range(4)})
    for r, d in enumerate((0.927, 1.103, 1.255, 1.400)):
        assert 3 * chain_delay(run, f"r={r}") == pytest.approx(d, abs=6e-4)


def test_a_blend_has_the_limit_of_the_observer_near_the_truth() -> None:
    """w = 1 where the error is zero, so that direct has the limit of shgo, whatever its differentiator does."""
    blend = {"type": "direct", "theta": 2, "mu": 5, "phi": 40, "G": 1}
    run = prepared({"shgo": {"type": "shgo", "theta": 2}, "blend": blend}, solver={"method": "euler", "step": 0.01})
    assert chain_period(run, "blend") == pytest.approx(chain_period(run, "shgo"))


def test_one_integrator_in_closed_form() -> None:
    """x' = 0, poles at -1: e(t) = e_k exp(-theta t) for ever; with a delay the same."""
    run = prepared({"o": SHGO}, chain(1, start=0))
    with pytest.raises(NoValue, match=r"stable at every period up to [0-9.e+]+ s$"):
        chain_period(run, "o")
    with pytest.raises(NoValue, match="stable at every delay"):
        chain_delay(run, "o")


def test_an_unstable_first_order_plant_in_closed_form() -> None:
    """x' = a x, g the gain.

    xi' = a xi - g e, e' = -g e with e(0) = xi(0), so that xi(T) = e^(aT) - g (e^(aT) - e^(-gT))/(a + g).
    Radius 1: e^(aT) a/(a + g) + g e^(-gT)/(a + g) = 1 where T > 0; e^(aT) a + g e^(-gT) = a + g.
    """
    from scipy.optimize import brentq

    a, g = 0.5, 2.0
    run = prepared({"o": {"type": "shgo", "theta": 1, "poles": -g}}, inline({"x": f"{a}*x"}, "x", start=0))
    T = brentq(lambda T: np.exp(a * T) * a + g * np.exp(-g * T) - a - g, 0.1, 10)
    assert along(critical_period, run, "o") == pytest.approx(T, rel=1e-3)
    # the root that passes through zero: alpha(t) - alpha(t - d) = -d g e, xi = g e/a
    assert along(critical_delay, run, "o") == pytest.approx(1 / a - 1 / g, rel=1e-9)


@pytest.mark.measured("block2-2.0")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("block", "delay"),
    [
        (SHGO, 0.0),
        (SHGO, 0.35),
        (SHGO, 2.0),
        ({"type": "fhgo2", "theta": 1, "r": 2}, 0.2),
        ({"type": "low_power", "theta": 1}, 0.1),
        ({"type": "treangle", "theta": 1}, 0.0),
    ],
)
def test_runs_beside_the_critical_period(block: dict[str, Any], delay: float) -> None:
    """2 % below it the error decays, 2 % above it grows."""

    def at(period: float, end: float = 5) -> PreparedRun:
        block_ = {**block, "initial": {"x1": 1, "x2": -1, "x3": 1}}
        return prepared({"o": block_}, end=end, measurement={"sampling": {"period": period}, "delay": delay})

    if delay == 2.0:  # later than the observer bears at any period
        with pytest.raises(NoValue, match="unstable already at the shortest period that is tried"):
            chain_period(at(0.5), "o")
        return
    T = chain_period(at(0.5), "o")
    assert decay(at(0.98 * T, 300 * T), "o") < 0 < decay(at(1.02 * T, 300 * T), "o")


@pytest.mark.parametrize("sampling", ["continuous", {"period": 0.3}])
def test_runs_beside_the_critical_delay(sampling: Any) -> None:
    def at(delay: float, end: float = 5) -> PreparedRun:
        block = {"type": "fhgo2", "theta": 1, "r": 1, "initial": {"x1": 1, "x2": -1, "x3": 1}}
        return prepared({"o": block}, end=end, step=0.02, measurement={"sampling": sampling, "delay": delay})

    d = chain_delay(at(0.0), "o")
    assert decay(at(0.98 * d, 300), "o") < 0 < decay(at(1.02 * d, 300), "o")


def test_sampling_ever_faster_is_the_continuous_output() -> None:
    """A held sample is period/2 old in the mean."""
    run = prepared({"o": SHGO})
    fast = prepared({"o": SHGO}, measurement={"sampling": {"period": 0.01}})
    continuous, sampled = (chain_delay(r, "o") for r in (run, fast))
    assert sampled + 0.005 == pytest.approx(continuous, abs=2e-4)


def test_two_chains_have_the_limit_of_the_slower_one() -> None:
    """Two outputs that do not know of each other: as much as each alone."""
    dynamics = {"a1": "a2", "a2": "0", "b1": "b2", "b2": "b3", "b3": "0"}
    run = prepared({"o": SHGO}, inline(dynamics, ["a1", "b1"], start=0))
    assert chain_period(run, "o") == pytest.approx(2.896, abs=6e-4)
    assert chain_delay(run, "o") == pytest.approx(0.9273, abs=6e-4)
    assert along(critical_period, run, "o") == pytest.approx(2.896, abs=6e-4)


@pytest.mark.slow
def test_a_time_varying_plant_against_its_own_run() -> None:
    """The small error's growth over [20, 60], from runs that sample a little below and above the limit."""

    def at(period: float) -> PreparedRun:
        observer = {"type": "shgo_riccati", "theta": 5, "initial": {"x1": 1.001, "x2": 0.999, "x3": 1.001}}
        measurement = {"sampling": {"period": period}}
        return prepare(experiment(ACADEMIC, {"o": observer}, end=60, output_step=0.01, measurement=measurement))

    run = at(0.1)
    system = error_system(run, "o", nominal(run))
    T = critical_period(timing_of(run), system).value
    assert not system.constant
    for factor in (0.9, 1.1):
        period = factor * T
        finished = simulate_prepared(at(period))
        e = np.linalg.norm(finished.observers["o"].xhat - finished.x, axis=1)
        if factor < 1:
            samples = finished.measurements.time
            first, last = (np.searchsorted(finished.time, samples[np.searchsorted(samples, t)]) for t in (20, 55))
            measured = np.log(e[last] / e[first]) / (finished.time[last] - finished.time[first])
            assert measured < 0
            assert growth(system, period) == pytest.approx(measured, abs=0.25)
        else:
            assert e[-1] > 1e3 * e[0] or finished.observers["o"].diverged_at is not None


def test_growth_along_a_trajectory_is_that_of_the_one_system() -> None:
    """A system that is told to vary, and does not."""
    from dataclasses import replace

    run = prepared({"o": {"type": "fhgo2", "theta": 2, "r": 1}}, end=30)
    one = error_system(run, "o", nominal(run))
    assert one.constant
    matrices: dict[str, Any] = {
        name: np.repeat(getattr(one, name), 101, axis=0) for name in ("A0", "E", "H", "K0", "K")
    }
    many = replace(one, times=np.linspace(0, 20, 101), **matrices)
    for T, d in ((0.3, 0.0), (1.0, 0.25), (0.2, 0.5), (2.0, 0.0)):
        assert growth(many, T, d) == pytest.approx(growth(one, T, d), abs=1e-6)


def test_discrete_observers() -> None:
    observers: dict[str, Block] = {"k": {"type": "reduced_sampled", "H": 0.5}, "d": {"type": "deadbeat"}}
    run = prepared(observers, VAN_DER_POL, measurement={"sampling": {"period": 0.1}})
    assert own_period(run, "k") == 4.0
    with pytest.raises(NoValue, match="no period"):
        own_period(run, "d")
    plant = {"type": "lee_second_order", "initial": {"x1": 1, "x2": 1}}
    observer = {"type": "hgo_fd", "eps": 0.01, "gains": [2, 2]}
    lee = prepared({"o": observer}, plant, 0.1, measurement={"sampling": {"period": 0.0004}})
    period = own_period(lee, "o")
    assert period == pytest.approx(0.01, rel=1e-12)
    A_0 = np.array([[-2.0, 1.0], [-2.0, 0.0]])
    radius = [np.max(np.abs(np.linalg.eigvals(np.eye(2) + f * period / 0.01 * A_0))) for f in (0.99, 1.01)]
    assert radius[0] < 1 < radius[1]


def test_reasons() -> None:
    run = prepared({"l": {"type": "levant", "G": 1}, "o": SHGO}, step=1e-3)
    with pytest.raises(NoValue, match="no slope"):
        error_system(run, "l", nominal(run))
    stepped = prepared({"o": SHGO}, CHAIN | {"discretise": "euler"}, measurement={"sampling": {"period": 0.1}})
    with pytest.raises(NoValue, match="stepped at the samples"):
        nominal(stepped)


@pytest.mark.parametrize(("period", "delay"), [(0.1, 0.1), (0.05, 0.17)])
def test_how_large_theta_may_be_with_a_period_and_a_delay(period: float, delay: float) -> None:
    """Observers with theta a little below and above: neither of the two limits alone says it."""
    measurement = {"sampling": {"period": period}, "delay": delay}

    def at(theta: float) -> tuple[PreparedRun, ErrorSystem]:
        run = prepared({"it": {"type": "shgo", "theta": theta}}, chain(2, start=0), measurement=measurement)
        return run, chain_system(run, "it")

    run, system = at(4.0)
    largest = 4.0 * critical_together(timing_of(run), system).value / period
    assert growth(at(0.99 * largest)[1], period, delay) < 0 < growth(at(1.01 * largest)[1], period, delay)
    apart = min(chain_period(run, "it") / period, chain_delay(run, "it") / delay)
    assert largest < 0.95 * 4.0 * apart


class DeadZone(StandardObserver):
    """The innovation acts where it is larger than 0.1: near the truth there is no slope of it."""

    def equations(self, plant: PlantCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        acting = ca.if_else(ca.fabs(e) > 0.1, e, 0)
        return Flow({"xhat": super().equations(plant, s, acting, k).derivatives["xhat"]})


@pytest.mark.parametrize("limit", [critical_period, critical_delay])
def test_an_error_that_does_not_move_near_the_truth_has_no_limit(limit: Callable[[Any, Any], Limit]) -> None:
    with OBSERVERS.replaced("dead_zone", DeadZone):
        run = prepared({"it": {"type": "dead_zone", "theta": 1}})
        with pytest.raises(NoValue, match="the linearised error does not move"):
            limit(timing_of(run), chain_system(run, "it"))


@pytest.mark.costly
def test_a_period_shorter_than_those_of_the_search_is_tried_where_it_is_in_use() -> None:
    """The search begins at a fifth of 1/theta, here 0.5; the observer is too slow for its plant at any period."""
    plant = inline({"x1": "x2 + 0.6*x1*cos(t)", "x2": "0.8*x2 + 0.5*sin(x1)"}, "x1", start=0.1)
    block: Block = {"type": "shgo", "theta": 0.4}
    made = experiment(plant, {"S": block}, end=20, measurement={"sampling": {"period": 0.05}})
    reasons = hgorun.analyze(made).observers["S"].reasons
    assert reasons["period_critical"] == "unstable already at the shortest period that is tried, 0.05 s"
