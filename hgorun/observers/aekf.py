"""The high-gain Kalman filter whose gain adapts to what its own predictions have cost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import casadi as ca
import numpy as np
from pydantic import Field, ModelWrapValidatorHandler, model_validator

from hgorun.config.types import Number, Positive
from hgorun.errors import Problem
from hgorun.observers.base import Arrival, CorrectedObserver, DecidedObserver, Flow, Role, observer
from hgorun.observers.capabilities import NoiseInformed, OneGain, SeveralGains
from hgorun.observers.extension import with_unknown_inputs
from hgorun.observers.gaussian import linear_update
from hgorun.observers.intervals import mean_intervals, usual_periods
from hgorun.observers.scaled_filter import ScaledFilter
from hgorun.observers.whole_periods import UNEVEN, off_period
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form
from hgorun.symbolic.scaled import ScaledCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_WINDOW, _GROWTH, _RETURN = 5.0, 0.1, 0.1  # d theta_1, dT theta_1, lam d
_STEEP, _LEAST = 10.0, 5.0  # beta m
_ABOVE_NOISE = 4.0  # m, in what the noise alone costs
_ROUNDING = 1e-9  # relative, of sums of steps


class AdaptiveFilter(NoiseInformed, ScaledFilter):
    """The keys of an adaptive high-gain Kalman filter, and its theta and I."""

    reference = "Boizot, Busvelle, Gauthier 2010; N copies in place of a delayed innovation: our own"

    theta_1: Number = Field(gt=1, description="theta moves between 1 and 2 theta_1, theta_1 > 1")
    window: Positive | None = Field(
        default=None, description="update: flow, time d of a prediction; 5/theta_1 by default"
    )
    copies: int = Field(default=5, ge=1, le=20, strict=True, description="N: predictions that run at a time")
    dT: Positive | None = Field(default=None, description="time in which theta doubles or so; 0.1/theta_1 by default")
    lam: Positive | None = Field(default=None, description="rate at which theta returns to 1; 0.1/d by default")
    m: Positive | None = Field(
        default=None, description="I from which theta grows, in y^2 time; by default 4 times what the noise alone costs"
    )
    beta: Positive | None = Field(default=None, description="steepness, beta m >= 5; 10/m by default")
    update: Literal["flow", "jump"] = Field(
        default="flow",
        description="flow: as for continuous outputs, samples enter the innovation; jump: corrected at samples, with d "
        "= N T",
    )
    interval: Positive | None = Field(
        default=None, description="update: jump, time T between two samples; from the measurement by default"
    )

    @model_validator(mode="wrap")
    @classmethod
    def _by_update(cls, data: Any, check: ModelWrapValidatorHandler[AdaptiveFilter]) -> AdaptiveFilter:
        """A block with ``update: jump`` is an observer of another kind."""
        found = check(data)
        jumps = found.update == "jump"
        unused = "window" if jumps else "interval"
        if getattr(found, unused) is not None:
            raise Problem(
                (unused,), f"{unused} is not a key of update: {found.update}" + ("; d = N T" if jumps else "")
            )
        if not jumps or isinstance(found, CorrectedObserver):
            return found
        return with_unknown_inputs(SampledAdaptiveFilter.model_construct(found.model_fields_set, **dict(found)))

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"theta_1": 2.0, "m": 0.05}

    def design(self, form: Form) -> dict[str, np.ndarray]:
        if self.coordinates == "canonical":
            raise Problem(("coordinates",), "the copies are in the plant's coordinates: leave this key out")
        if form.plant.transform is not None and not isinstance(form, CanonicalForm):
            message = "the plant is triangular in coordinates of its own, where no copy can begin: take hg_ekf"
            raise Problem(("type",), message)
        for name in self.internal:
            if name in ("predictions", "J", "turn", "waited"):
                raise Problem(("internal", name), "the copies begin at the estimate, one after the other")
        start = self.internal.get("theta", 1.0)
        if not (isinstance(start, float | int) and 1 <= start <= 2 * self.theta_1):
            raise Problem(("internal", "theta"), f"expected a number from 1 to 2 theta_1 = {2 * self.theta_1:g}")
        d, m = self.horizon(form), self._threshold(form)
        beta = _STEEP / m if self.beta is None else self.beta
        if beta * m < _LEAST * (1 - 1e-12):
            message = f"beta m = {beta * m:.4g} is below 5: theta would leave 1 without any innovation"
            raise Problem(("beta",), message)
        numbers = {
            "theta_1": self.theta_1,
            "dT": _GROWTH / self.theta_1 if self.dT is None else self.dT,
            "lam": _RETURN / d if self.lam is None else self.lam,
            "m": m,
            "beta": beta,
        }
        return {**super().design(form), **{name: np.array(value) for name, value in numbers.items()}}

    def horizon(self, form: Form) -> float:
        """d."""
        return _WINDOW / self.theta_1 if self.window is None else self.window

    def _threshold(self, form: Form) -> float:
        """m."""
        if self.m is not None:
            return self.m
        powers = [sensor.power for sensor in self._sensors] or [None]
        known = [power for power in powers if power is not None]
        if len(known) < len(powers):
            raise Problem(("m",), "m does not follow from the noise of the measurement: give m")
        return float(_ABOVE_NOISE * sum(known) * self.horizon(form))

    def states(self, form: Form) -> Mapping[str, np.ndarray | Symmetric]:
        n, N = form.plant.n, self.copies
        start = np.array([self.initial.get(name, 0.0) for name in form.plant.states])
        return {
            "P": Symmetric(np.eye(n)),
            "theta": np.array(1.0),
            "I": np.array(0.0),
            "predictions": np.tile(start, (N, 1)),
            "J": np.zeros(N),
            "turn": np.array(0.0),
        }

    def roles(self, form: Form) -> Mapping[str, Role]:
        return {name: "signal" if name == "predictions" else "gain" for name in self.states(form)}

    def adapting(self, s: Symbols, k: Symbols) -> ca.SX:
        """theta'."""
        share = 1 / (1 + ca.exp(-k.beta * (s.I - k.m)))
        small = s.theta <= k.theta_1
        growth = ca.if_else(small, s.theta, s.theta - 2 * k.theta_1) ** 2 / k.dT
        return share * growth + (1 - share) * k.lam * (1 - s.theta)

    def begun_again(self, s: Symbols, xhat: ca.SX, J: ca.SX, due: ca.SX) -> dict[str, ca.SX]:
        """The prediction whose turn it is begins at the estimate again, where ``due``; its cost becomes I.

        ``turn`` counts to 2N and goes back to N: below N a prediction begins for the first time, and has no cost yet.
        """
        N = self.copies
        place = ca.if_else(s.turn >= N, s.turn - N, s.turn)
        chosen = [due * (place == j) for j in range(N)]
        cost = sum((one * J[j] for j, one in enumerate(chosen)), ca.SX(0))
        turn = s.turn + due
        return {
            "I": ca.if_else(due * (s.turn >= N), cost, s.I),
            "predictions": ca.vertcat(*[ca.if_else(one, xhat.T, s.predictions[j, :]) for j, one in enumerate(chosen)]),
            "J": ca.vertcat(*[ca.if_else(one, 0, J[j]) for j, one in enumerate(chosen)]),
            "turn": ca.if_else(turn >= 2 * N, turn - N, turn),
        }

    def still(self, s: Symbols) -> dict[str, ca.SX]:
        """What only moves when a prediction begins."""
        return {"I": ca.SX(0), "turn": ca.SX(0)}

    def predicted(self, plant: ScaledCopy, s: Symbols) -> tuple[ca.SX, ca.SX]:
        """The predictions' derivatives, shape (N, n), and outputs, shape (q, N)."""
        rows = [row.T for row in ca.vertsplit(s.predictions)]
        return ca.horzcat(*map(plant.copy, rows)).T, ca.horzcat(*map(plant.output, rows))

    def fastest_rate(self, form: Form) -> float:
        return self.rate(form, 2 * self.theta_1)

    def error_rate(self, form: Form) -> float:
        """At theta = 1, where it is after the transient."""
        return self.rate(form, 1.0)


@observer("aekf")
class AdaptiveKalmanFilter(SeveralGains, AdaptiveFilter, DecidedObserver[Form, ScaledCopy]):
    """Adaptive high-gain extended Kalman filter, for plants that are chains or triangular block by block.

    It is ``hg_ekf`` with a theta(t), which is 1, an ordinary Kalman filter, as long as the filter's predictions are
    right, and grows to a high gain when they are not: after a wrong start, or when the plant jumps. With Q_theta and
    R_theta of ``hg_ekf`` at the present theta, theta(0) = 1,

        theta' = mu(I) F_0(theta) + (1 - mu(I)) lam (1 - theta),    mu(I) = 1/(1 + exp(-beta (I - m)))
        F_0    = theta^2/dT for theta <= theta_1, (theta - 2 theta_1)^2/dT above
        I(t)   = int_(t-d)^t |y(s) - yhat_(t-d)(s)|^2 ds

    yhat_(t-d) the output of the plant's copy that started from xhat(t - d) and was not corrected since. theta stays
    between 1 and 2 theta_1. I takes N copies: one of them begins at the estimate again every d/N, and after d its cost
    J, J' = |y - yhat|^2, is I, which is held until the next one is done; before the first is done I = 0. Copies begin
    at the ends of the solver's steps: a step that divides d/N keeps d exact, longer ones than d/N are refused.

    theta_1: half of a suitable constant theta. m: 3 to 5 times what the noise alone costs, sigma^2 d, 4 by default.
    beta m >= 5, since with less theta sits above 1 without any innovation. dT: how fast theta grows (0.01 to 0.1).
    lam: slow against the plant; at I = 0 theta sits at about 1 + mu(0)/(lam dT). Choose it over ``hg_ekf`` where the
    noise matters and large errors are rare; the copies cost N times the plant. A copy that diverges within d makes
    the observer diverge: shorten d.

    Samples and late outputs enter by the common innovation e, J' with y = h(xhat) - e. ``update: jump`` corrects and
    begins copies at samples of a constant period T: d = N T, J = T sum |y - yhat|^2 over N samples, with the
    variance R/(theta T) of a sample; late samples are replayed. A sample that is lost adds nothing to J, and where all
    outputs lose theirs no copy begins, so that N samples take longer than d.

    Structure and I are those of the publication as read in Boizot's thesis, (3.3); F_0 and mu are quoted from memory.
    That N copies give I exactly at the times j d/N is our own design.
    """

    def design(self, form: Form) -> dict[str, np.ndarray]:
        return {**super().design(form), "pause": np.array(self.horizon(form) / self.copies)}

    def states(self, form: Form) -> Mapping[str, np.ndarray | Symmetric]:
        """The first prediction begins at the start."""
        return {**super().states(form), "turn": np.array(1.0), "waited": np.array(0.0)}

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        rates, outputs = self.predicted(plant, s)
        y = plant.output(s.xhat) - e
        costs = [ca.sumsqr(y - one) for one in ca.horzsplit(outputs)]
        return Flow(
            {
                **self.flow(plant, s, e, k, s.theta),
                **self.still(s),
                "theta": self.adapting(s, k),
                "predictions": rates,
                "J": ca.vertcat(*costs),
                "waited": ca.SX(1),
            }
        )

    def decide(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Mapping[str, ca.SX]:
        due = s.waited >= (1 - _ROUNDING) * k.pause
        return {**self.begun_again(s, s.xhat, s.J, due), "waited": s.waited - due * k.pause}

    def longest_step(self, form: Form) -> float:
        return self.horizon(form) / self.copies

    def alone(self) -> list[OneGain]:
        """hg_ekf with the largest theta, to which it grows and where it stays while errors are large."""
        own = {name for name in AdaptiveFilter.model_fields if name not in ScaledFilter.model_fields}
        block = self.model_dump(exclude_unset=True, exclude={*own, "type", "internal"})
        theta = {"type": "hg_ekf", "theta": 2 * self.theta_1}
        return [OneGain({**block, **theta}, "theta_1", 0.5, "as long as theta is 2 theta_1, which they keep it at")]


class SampledAdaptiveFilter(AdaptiveFilter, CorrectedObserver[Form, ScaledCopy]):
    """The filter that is corrected at samples; see :class:`AdaptiveKalmanFilter`."""

    def design(self, form: Form) -> dict[str, np.ndarray]:
        numbers = super().design(form)
        intervals = mean_intervals(self.interval, self._sensors, form, "interval")
        return numbers | {"R": numbers["R"] / intervals, "T": np.array(self.whole_periods(form))}

    def whole_periods(self, form: Form) -> float:
        periods = usual_periods(self.interval, self._sensors, form, "interval")
        if np.ptp(periods) > UNEVEN * periods[0]:
            raise Problem(("update",), "jump needs all outputs sampled with one period")
        return float(periods[0])

    def horizon(self, form: Form) -> float:
        return self.copies * self.whole_periods(form)

    def check_times(self, form: Form, times: Mapping[str, np.ndarray], origin: float) -> None:
        why = off_period(times, self.whole_periods(form), origin)
        if why is not None:
            raise Problem(
                ("update",), f"jump is for one period of all outputs, but {why}: take update: flow, or hg_ekf"
            )

    def equations(self, plant: ScaledCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        rates, _ = self.predicted(plant, s)
        return Flow(
            {
                **self.still(s),
                "xhat": plant.copy(s.xhat),
                "P": self.spread(plant, s, k, s.theta),
                "theta": self.adapting(s, k),
                "predictions": rates,
                "J": ca.SX.zeros(self.copies),
            }
        )

    def correct(self, plant: ScaledCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        y, (_, outputs) = plant.output(s.xhat), self.predicted(plant, s)
        shift, P = linear_update(s.P, arrival.y - y, ca.jacobian(y, s.xhat), k.R / s.theta, arrival.fresh)
        J = s.J + ca.vertcat(*[k.T * ca.sumsqr(arrival.fresh * (arrival.y - one)) for one in ca.horzsplit(outputs)])
        return {**self.begun_again(s, s.xhat + shift, J, ca.mmax(arrival.fresh)), "xhat": s.xhat + shift, "P": P}
