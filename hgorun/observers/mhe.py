"""The moving-horizon estimator."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.errors import Problem
from hgorun.observers.base import Arrival, CorrectedObserver, Flow, Role, observer
from hgorun.observers.capabilities import NotExported, NotLinear, RecallsInputs
from hgorun.observers.horizon import Carried, Flight, Window
from hgorun.observers.kalman import ChainNoise, KalmanFilter, ProcessNoise, require_covariance
from hgorun.symbolic.canonical import PlantCopy
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.smooth import SmoothCopy
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

_OWN = ("xbar", "Pbar", "nodes", "y", "fresh", "intervals")  # which only samples change


@observer("mhe")
class MovingHorizonEstimator(RecallsInputs, NotExported, NotLinear, KalmanFilter, CorrectedObserver[Form, ModelCopy]):
    """Moving-horizon estimator, for any smooth plant with sampled outputs.

    At a sample t_k the states x_i at the last N samples, i = s..k, and what the model does not know in between are
    those that minimise, with the plant of ``ekf``,

        |x_s - xbar|^2_(Pbar^-1) + sum_(i=s..k) |y_i - h(x_i)|^2_(R^-1) + sum_(i=s..k-1) |w_i|^2_(Qd^-1)
        x_(i+1) = phi_T(x_i) + w_i

    phi_T the flow of the plant over the time T to the next sample: ``iterations`` full Gauss-Newton steps, from the
    last solution with its end continued by f. A step is carried out as the smoother of the linearised problem, a filter
    forwards and back, which is the same and takes no inverse of Qd. phi_T and its slope are ``substeps`` steps of RK4.

    What was known before the window is the arrival cost: when the window moves on, (xbar, Pbar) takes in sample s,
    linearised at x_s, and is carried to the next one, xbar <- phi(x_s) + Phi (xbar+ - x_s), Pbar <- Phi P+ Phi^T + Qd.
    At the first sample xbar is the initial estimate, carried there by f, and Pbar is P(0) (``internal: {P: ...}``, the
    identity by default). Between samples xhat follows f, and P, the covariance of the newest state, F P + P F^T + Q.

    On a linear plant this is the Kalman filter with the noise Qd, whatever N and with one iteration. On others a
    longer window corrects linearisations that were wrong, at N times the cost of ``ekf``, and more than N times the
    time to compile: choose it for a wrong start or strong curvature, and N a few time constants. Outputs may be
    sampled at different times, and samples may be missing. Late samples are replayed. Qd = Q T by default, T the time
    between the samples; Q or q or theta, R as for ``ekf``. Inputs have to be functions of time; a law or recorded
    inputs are refused.
    """

    reference = "Rao, Rawlings, Mayne 2003; arrival cost in the filtering form: textbook"
    of_samples = True

    window: int = Field(default=10, ge=1, le=100, strict=True, description="N: samples in the window, n or more")
    iterations: int = Field(default=3, ge=1, le=10, strict=True, description="Gauss-Newton steps at every sample")
    substeps: int = Field(default=5, ge=1, le=100, strict=True, description="steps of RK4 from a sample to the next")
    Qd: ProcessNoise | None = Field(
        default=None,
        description="covariance of what the model does not know from a sample to the next: state: number, or the rows "
        "of a matrix, positive definite; Q T by default",
    )

    @property
    def not_exported(self) -> str:
        return "mhe is not exported: its code would be that of all samples of the window"

    @property
    def not_linear(self) -> str | None:
        return "its state is a window of samples; on a linear plant its error is that of the Kalman filter with Qd"

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {**super().example(states), "window": len(states), "iterations": 1, "substeps": 2}

    @classmethod
    def on_chains(cls) -> type[KalmanFilter]:
        return ChainMovingHorizonEstimator

    def design(self, form: Form) -> Mapping[str, np.ndarray]:
        n = form.plant.n
        if self.window < n:
            raise Problem(("window",), f"expected n = {n} samples or more, which {n} states take; found {self.window}")
        for name in self.internal:
            if name != "P":
                raise Problem(("internal", name), "the window begins empty: P alone can be given")
        numbers = dict(super().design(form))
        if self.Qd is not None:
            numbers["Qd"] = self._discrete(self.Qd, form)
        return numbers

    def _discrete(self, given: ProcessNoise, form: Form) -> np.ndarray:
        """Qd, shape (n, n)."""
        states = form.plant.states
        if isinstance(given, dict):
            if set(given) != set(states):
                raise Problem(("Qd",), f"expected a number for each state: {', '.join(states)}")
            matrix = np.diag([given[name] for name in states])
        else:
            try:
                matrix = require_covariance(given, len(states), "state: number")
            except Problem as problem:
                raise Problem(("Qd",), problem.message) from problem
        if np.min(np.linalg.eigvalsh(matrix)) <= 0:
            raise Problem(("Qd",), "expected a positive definite matrix")
        return np.asarray(matrix)

    def states(self, form: Form) -> dict[str, Symmetric]:
        n, N, q = form.plant.n, self.window, len(form.plant.outputs)
        rows: dict[str, np.ndarray] = {
            "xbar": np.zeros(n),
            "nodes": np.zeros((N, n)),
            "y": np.zeros((N, q)),
            "fresh": np.zeros((N, q)),
            "intervals": np.zeros(N),
            "age": np.zeros(1),
        }
        return {"P": Symmetric(np.eye(n)), "Pbar": Symmetric(np.eye(n)), **rows}  # type: ignore[dict-item]  # see above

    def roles(self, form: Form) -> Mapping[str, Role]:
        of: dict[str, Role] = {"xbar": "signal", "nodes": "signal", "y": "signal"}
        return {name: of.get(name, "gain") for name in self.states(form)}

    def equations(self, plant: ModelCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        still = {name: ca.SX.zeros(*vars(s)[name].shape) for name in _OWN}
        begun = ca.SX(_taken(s.fresh))
        return Flow(
            {**still, "xhat": plant.copy(s.xhat), "P": begun * self.spread(plant, s.xhat, s.P, k), "age": begun}
        )

    def correct(self, plant: ModelCopy, s: Symbols, arrival: Arrival, k: Symbols) -> Mapping[str, ca.SX]:
        # places in the window that no sample has taken yet have no time and no output: they leave xbar and Pbar as
        # they are, so that the equations are the same while the window fills
        first = ca.logic_not(_taken(s.fresh))
        nodes = [ca.if_else(_taken(row), x, s.xhat) for x, row in zip(_rows(s.nodes), _rows(s.fresh), strict=True)]
        before = self._window(plant, s, k, [*_rows(s.y)], [*_rows(s.fresh)], ca.vertcat(s.intervals[:-1], s.age))
        mean, P = before.updated(0, nodes[0], ca.if_else(first, s.xhat, s.xbar), ca.if_else(first, s.P, s.Pbar))
        xbar, Pbar, _ = before.predicted(0, nodes[0], mean, P)
        y, fresh = [*_rows(s.y)[1:], arrival.y], [*_rows(s.fresh)[1:], arrival.fresh]
        intervals = ca.vertcat(s.intervals[1:-1], s.age, 0) if self.window > 1 else ca.SX(0)
        now = self._window(plant, s, k, y, fresh, intervals, xbar, Pbar)
        nodes = [*nodes[1:], s.xhat]
        for _ in range(self.iterations):
            nodes, P = now.improved(nodes)
        return {
            "xhat": nodes[-1],
            "P": P,
            "xbar": xbar,
            "Pbar": Pbar,
            "nodes": ca.horzcat(*nodes).T,
            "y": ca.horzcat(*y).T,
            "fresh": ca.horzcat(*fresh).T,
            "intervals": intervals,
            "age": ca.SX(0),
        }

    def _window(
        self,
        plant: ModelCopy,
        s: Symbols,
        k: Symbols,
        y: list[ca.SX],
        fresh: list[ca.SX],
        intervals: ca.SX,
        xbar: ca.SX | None = None,
        Pbar: ca.SX | None = None,
    ) -> Window:
        """A window that ends now, with the times to the next sample."""
        assert isinstance(plant, SmoothCopy | PlantCopy)
        t, x = plant.t, ca.SX.sym("x", s.xhat.numel())
        flight = Flight(plant.copy(x), t, x, self.substeps)
        ages = [ca.sum1(intervals[i:]) for i in range(intervals.numel())]
        output = plant.output(x)
        parts = [output, ca.jacobian(output, x), self.variance(output, k)]

        def carry(i: int, at: ca.SX) -> Carried:
            return flight.carried(t - ages[i], at, intervals[i])

        def noise(i: int, at: ca.SX) -> ca.SX:
            if "Qd" in vars(k):
                return (intervals[i] > 0) * k.Qd
            return intervals[i] * self.density(plant, at, k)

        def measured(at: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
            h, H, R = ca.substitute(parts, [x], [at])
            return h, H, R

        own = s.xbar if xbar is None else xbar, s.Pbar if Pbar is None else Pbar
        return Window(y, fresh, *own, carry, noise, measured)


class ChainMovingHorizonEstimator(ChainNoise, MovingHorizonEstimator):
    """The estimator with its process noise at the ends of chains; see :class:`MovingHorizonEstimator`."""


def _taken(fresh: ca.SX) -> ca.SX:
    """Whether some sample has come."""
    return ca.mmax(fresh) > 0.5


def _rows(matrix: ca.SX) -> list[ca.SX]:
    """The rows of a matrix as columns."""
    return [row.T for row in ca.vertsplit(matrix)]
