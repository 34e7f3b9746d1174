"""Trajectories against DOP853, which makes steps of its own."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import run
from naive import Vector, binomial_gains
from plain_trajectories import CONTOIS, CURVED_OUTPUT, END, SINE, THETA, VAN_DER_POL, Model, configuration, sine
from scipy.integrate import solve_ivp

from hgorun import Result


class Exact:
    """The observer's equations by DOP853, with all of the past kept: also for phases of measurement."""

    def __init__(self, model: Model, r: int) -> None:
        self.model, self.r, self.n = model, r, len(model.x0)
        self.gain = np.array(binomial_gains(r + self.n))
        self.t, self.z = 0.0, np.concatenate([model.x0, model.xhat0, np.zeros(r + 1)])
        self.pieces: list[Any] = []
        self.start = self.z

    def split(self, z: Vector) -> tuple[Vector, Vector, Vector, Any]:
        return z[: self.n], z[self.n : 2 * self.n], z[2 * self.n : -1], z[-1]

    def rates(self, t: float, z: Vector, e: float) -> Vector:
        model, r = self.model, self.r
        x, xhat, eta, _ = self.split(z)
        kappa = THETA ** np.arange(1, self.n + 1) * self.gain[r:] * (eta[0] if r else e)
        correction = kappa if model.jinv is None else model.jinv(xhat) @ kappa
        eta_rate = THETA * (np.append(eta[1:], e) - self.gain[:r] * eta[0]) if r else []
        return np.concatenate([model.f(t, x), model.copy(t, xhat) - correction, eta_rate, [-kappa[0]]])

    def past(self, t: float) -> Vector:
        """z(t), constant before the start."""
        if t <= 0 or not self.pieces:
            return self.start
        return next(p for p in reversed(self.pieces) if p.t_min <= t or p is self.pieces[0])(t)

    def s_minus_y(self, t: float) -> float:
        x, xhat, _, alpha = self.split(self.past(t))
        return self.model.h(xhat) - alpha - self.model.h(x)

    def go(self, end: float, innovation: Callable[[float, Vector], float]) -> None:
        """On to ``end`` with e = innovation(t, z)."""
        piece = solve_ivp(
            lambda t, z: self.rates(t, z, innovation(t, z)),
            (self.t, end),
            self.z,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
        )
        self.pieces.append(piece.sol)
        self.t, self.z = end, piece.y[:, -1]

    def hold(self, end: float, held: float) -> None:
        self.go(end, lambda t, z: held + z[-1])

    def continuous(self, end: float, v: Callable[[float], float]) -> None:
        def innovation(t: float, z: Vector) -> float:
            x, xhat, _, _ = self.split(z)
            return self.model.h(xhat) - self.model.h(x) - v(t)

        self.go(end, innovation)

    def sampled(self, end: float, period: float, delay: float, v: Callable[[float], float]) -> None:
        """Samples from now on."""
        count = round((end - self.t) / period)
        for arrival in self.t + period * np.arange(count):
            held = self.s_minus_y(arrival - delay) - v(arrival)
            self.hold(min(arrival + period, end), held)

    def delayed(self, end: float, delay: float, v: Callable[[float], float], stops: Sequence[float]) -> None:
        """Constant delay; ``stops`` are no further apart than it."""
        for stop in [*stops, end]:
            self.go(stop, lambda t, z: self.s_minus_y(t - delay) + z[-1] - v(t))

    def at(self, times: Vector) -> tuple[Vector, Vector, Vector]:
        x, xhat, eta, _ = self.split(np.array([self.past(t) for t in times]).T)
        return x.T, xhat.T, eta.T


def assert_near(result: Result, exact: Exact, label: str, tolerance: float) -> None:
    x, xhat, eta = exact.at(result.time)
    found = result.observers[label]
    np.testing.assert_allclose(result.x, x, rtol=0, atol=tolerance)
    np.testing.assert_allclose(found.xhat, xhat, rtol=0, atol=tolerance)
    if exact.r:
        np.testing.assert_allclose(found.internal["eta"], eta, rtol=0, atol=tolerance)


PRECISE = {"method": "dopri5", "rtol": 1e-10, "atol": 1e-12}


@pytest.mark.slow
@pytest.mark.parametrize("model", [VAN_DER_POL, CONTOIS, CURVED_OUTPUT], ids=["vdp", "contois", "curved"])
@pytest.mark.parametrize("is_sampled", [False, True])
def test_adaptive_steps_against_dop853(model: Model, is_sampled: bool, tmp_path: Path) -> None:
    measurement = {"sampling": {"period": 0.5}, "noise": SINE} if is_sampled else {"noise": SINE}
    result = run(tmp_path, configuration(model, measurement, solver=PRECISE))
    for label, r in [("S", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
        exact = Exact(model, r)
        if is_sampled:
            exact.sampled(END, 0.5, 0.0, sine)
        else:
            exact.continuous(END, sine)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [PRECISE, {"step": 0.002}], ids=["dopri5", "rk4"])
@pytest.mark.parametrize("model", [VAN_DER_POL, CONTOIS], ids=["vdp", "contois"])
def test_phases(model: Model, solver: dict[str, Any], tmp_path: Path) -> None:
    """Continuous, then sampled and late, then continuous and late, then sampled again: the past is one."""
    phases = [
        {"until": 0.8, "sampling": "continuous", "delay": 0},
        {"until": 1.6, "sampling": {"period": 0.2}, "delay": 0.3},
        {"until": 2.4, "sampling": "continuous", "delay": 0.3},
        {"until": END, "sampling": {"period": 0.2}, "delay": 0.5},
    ]
    result = run(tmp_path, configuration(model, {"noise": SINE, "phases": phases}, solver=solver))
    for label, r in [("S", 0), ("F1", 1), ("F3", 3)]:
        exact = Exact(model, r)
        exact.continuous(0.8, sine)
        exact.sampled(1.6, 0.2, 0.3, sine)
        exact.delayed(2.4, 0.3, sine, [1.7, 1.9, 2.0, 2.1, 2.2, 2.3])
        exact.sampled(END, 0.2, 0.5, sine)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.costly
def test_phases_begin_in_silence(tmp_path: Path) -> None:
    """A sampled phase after a continuous one has no innovation until its first sample."""
    phases = [{"until": 1, "noise": SINE}, {"until": END, "sampling": {"times": [1.5, 2.0]}, "noise": SINE}]
    result = run(tmp_path, configuration(VAN_DER_POL, {"phases": phases}, solver={"step": 0.002}))
    for label, r in [("S", 0), ("F2", 2)]:
        exact = Exact(VAN_DER_POL, r)
        exact.continuous(1.0, sine)
        exact.go(1.5, lambda t, z: 0.0)
        exact.sampled(2.5, 0.5, 0.0, sine)
        held = exact.s_minus_y(2.0) - sine(2.0)
        exact.hold(END, held)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [PRECISE, {"step": 0.005}], ids=["dopri5", "rk4"])
def test_delay_that_grows_from_zero(solver: dict[str, Any], tmp_path: Path) -> None:
    """d = 0.2 t looks into the step being made. The reference: passes, each told the past by the last."""
    config = configuration(VAN_DER_POL, {"delay": "0.2*t", "noise": SINE}, solver=solver)
    config["time"] = {"end": 1.5, "output_step": 0.037}
    result = run(tmp_path, config)

    def told_by(earlier: Exact) -> Callable[[float, Vector], float]:
        return lambda t, z: earlier.s_minus_y(0.8 * t) + z[-1] - sine(t)

    for label, r in [("S", 0), ("F2", 2)]:
        earlier = Exact(VAN_DER_POL, r)
        earlier.continuous(1.5, sine)
        for _ in range(14):
            exact = Exact(VAN_DER_POL, r)
            exact.go(1.5, told_by(earlier))
            earlier = exact
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "delay",
    ["0.1*(1 - cos(2*t))", "0.15 + 0.15*sin(2*t)", "0.3*abs(sin(2*t))", "max(0, 0.3*sin(2*t))", "0.0004"],
)
def test_vanishing_delay_against_a_finer_step(delay: Any, tmp_path: Path) -> None:
    config = configuration(VAN_DER_POL, {"delay": delay, "noise": SINE})
    coarse = run(tmp_path, config, "solver.step=0.01")
    fine = run(tmp_path, config, "solver.step=0.001")
    precise = run(tmp_path, config | {"solver": PRECISE})
    for label, found in fine.observers.items():
        assert found.diverged_at is None
        np.testing.assert_allclose(coarse.observers[label].xhat, found.xhat, rtol=0, atol=1e-6)
        np.testing.assert_allclose(precise.observers[label].xhat, found.xhat, rtol=0, atol=1e-8)
