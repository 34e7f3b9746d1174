"""What Kalman filters have in common: their keys, the noise that they reckon with, P between samples."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

import casadi as ca
import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, ModelWrapValidatorHandler, Tag, model_validator

from hgorun.config.nearest import among
from hgorun.config.types import Name, NonNegative, Number, Positive, describe
from hgorun.errors import Problem
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import NoiseInformed
from hgorun.observers.covariance import KnownCovariance
from hgorun.observers.gaussian import spread_along
from hgorun.observers.intervals import UNKNOWN
from hgorun.observers.riccati import require_positive_definite
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.smooth import smooth_form
from hgorun.symbolic.states import StateBlock, Symmetric
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.unseen import unseen_states

_SYMMETRIC = 1e-12  # relative


def _kind(value: object) -> str:
    """Which of two forms a key has, so that errors speak of that one."""
    return "by name" if isinstance(value, dict) else "as a whole"


def _rows(value: object) -> object:
    """Refuse what is neither a diagonal nor rows with all the forms that a density has."""
    if isinstance(value, (list, tuple)) and all(isinstance(row, (list, tuple)) for row in value):
        return value
    raise ValueError(
        f"expected a number for each state, found {describe(value)}: write {{state: 0.1, ...}} (the diagonal) or the "
        "rows of a matrix, [[0.1, 0], [0, 0.1]]; one number for the ends of chains is the key q"
    )


_Rows = Annotated[tuple[tuple[Number, ...], ...], BeforeValidator(_rows)]
ProcessNoise = Annotated[
    Annotated[dict[Name, NonNegative], Tag("by name")] | Annotated[_Rows, Tag("as a whole")],
    Discriminator(_kind),
]
SensorNoise = Annotated[
    Annotated[dict[Name, Positive], Tag("by name")] | Annotated[Positive, Tag("as a whole")], Discriminator(_kind)
]


def by_output(given: dict[str, float] | float, form: Form, key: str = "R") -> np.ndarray:
    """One number an output, shape (q,), from one for all or one each.

    Raises
    ------
    Problem
        Where a name is unknown or missing.
    """
    outputs = form.plant.outputs
    if not isinstance(given, dict):
        return np.full(len(outputs), given)
    for name in given:
        if name not in outputs:
            raise Problem((key, name), f"unknown output {name!r}; the plant's outputs are {', '.join(outputs)}")
    missing = [name for name in outputs if name not in given]
    if missing:
        raise Problem((key,), f"{key} of output {', '.join(missing)} is missing")
    return np.array([given[name] for name in outputs])


def require_covariance(rows: Sequence[Sequence[float]], n: int, instead: str) -> np.ndarray:
    """Q as a matrix, shape (n, n), from its rows.

    Raises
    ------
    Problem
        Where they are no covariance.
    """
    if [len(row) for row in rows] != [n] * n:
        raise Problem(("Q",), f"expected {n} rows of {n} numbers, or {instead}")
    Q = np.array(rows)
    size = float(np.max(np.abs(Q)))
    if np.max(np.abs(Q - Q.T)) > _SYMMETRIC * size or np.min(np.linalg.eigvalsh(Q)) < -_SYMMETRIC * size:
        raise Problem(("Q",), "expected a symmetric matrix without negative eigenvalues")
    return Q


class KalmanFilter(KnownCovariance, NoiseInformed, ContinuousObserver[Form, ModelCopy]):
    """The keys of a Kalman filter, and P between samples.

    F = df/dx and H = dh/dx are those of the filter's own copy of the plant, saturation and all. The noise of the
    process has the density Q given in the plant's coordinates; or q, see :class:`ChainNoise`.
    """

    lacks = {"extend": "it takes any model: give the plant a state for the unknown input, with noise in Q"}

    form = staticmethod(smooth_form)
    of_samples: ClassVar[bool]
    """Whether R is the variance of a sample, and not the density R_c of the noise."""

    Q: ProcessNoise | None = Field(
        default=None,
        description="density of the process noise: state: number, or the rows of a matrix, in x_i x_j/time",
    )
    q: Positive | None = Field(
        default=None, description="in place of Q: density of the noise at the end of every chain, q > 0"
    )
    theta: Positive | None = Field(
        default=None, description="in place of q: q = R_c theta^(2n), so that theta is the speed of the filter"
    )
    R: SensorNoise | None = Field(
        default=None,
        description="of all outputs, or output: number; from the noise of the measurement by default",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _on_chains(cls, data: Any, check: ModelWrapValidatorHandler[KalmanFilter]) -> KalmanFilter:
        """A block with q or theta is an observer for another class of plants: chains."""
        found = check(data)
        given = [key for key in ("Q", "q", "theta") if getattr(found, key) is not None]
        if len(given) != 1:
            raise ValueError(
                "the noise of the process is given by one of Q, q and theta; found "
                + (" and ".join(given) if given else "none of them")
            )
        if found.Q is not None or isinstance(found, ChainNoise):
            return found
        return found.on_chains().model_construct(found.model_fields_set, **dict(found))

    @classmethod
    @abstractmethod
    def on_chains(cls) -> type[KalmanFilter]:
        """The same filter, its process noise at the ends of chains."""

    def design(self, form: Form) -> Mapping[str, np.ndarray]:
        for name, default in self.states(form).items():
            if name in self.internal:
                require_positive_definite(name, self.internal[name], default)
        variance, relative = self._sensor_noise(form)
        numbers = {"R": variance, **self.process_noise(form)}
        return numbers | ({"R_relative": relative} if relative.any() else {})

    def states(self, form: Form) -> dict[str, Symmetric]:
        return {"P": Symmetric(np.eye(form.plant.n))}

    def start_of(self, form: Form) -> dict[str, np.ndarray]:
        """The matrices at the start."""
        return {
            name: StateBlock.of(0, default).initial(self.internal[name], default.values)
            if name in self.internal
            else default.values
            for name, default in self.states(form).items()
        }

    def remarks(self, form: Form) -> tuple[str, ...]:
        """States whose errors no sample tells: the filter carries them along all the same."""
        unseen = ", ".join(unseen_states(form.plant))
        return (f"nothing that is measured depends on {unseen}: samples cannot tell errors there",) if unseen else ()

    def process_noise(self, form: Form) -> dict[str, np.ndarray]:
        """The numbers of the process noise."""
        states = form.plant.states
        if isinstance(self.Q, dict):
            for name in self.Q:
                if name not in states:
                    raise Problem(("Q", name), f"unknown state {name!r}; known here: {among(name, states)}")
            Q = np.diag([self.Q.get(name, 0.0) for name in states])
        else:
            assert self.Q is not None
            Q = require_covariance(self.Q, len(states), "state: number")
        if not np.any(Q):
            raise Problem(("Q",), "a filter without process noise stops correcting: expected a number above 0")
        return {"Q": Q}

    def density(self, plant: ModelCopy, xhat: ca.SX, k: Symbols) -> ca.SX:
        """Q at the estimate, shape (n, n)."""
        return k.Q

    def variance(self, y: ca.SX, k: Symbols) -> ca.SX:
        """R at the outputs of the estimate, shape (q,)."""
        return k.R + k.R_relative * y**2 if "R_relative" in vars(k) else k.R

    def spread(self, plant: ModelCopy, xhat: ca.SX, P: ca.SX, k: Symbols) -> ca.SX:
        """F P + P F^T + Q: P' where nothing is measured."""
        return spread_along(ca.jacobian(plant.copy(xhat), xhat), P, self.density(plant, xhat, k))

    def _sensor_noise(self, form: Form) -> tuple[np.ndarray, np.ndarray]:
        """R of every output: a number, and what it is relative to h^2; shapes (q,)."""
        outputs = form.plant.outputs
        numbers, relative = np.zeros(len(outputs)), np.zeros(len(outputs))
        given = self.R if isinstance(self.R, dict) else {} if self.R is None else dict.fromkeys(outputs, self.R)
        for name in given:
            if name not in outputs:
                raise Problem(("R", name), f"unknown output {name!r}; the plant's outputs are {', '.join(outputs)}")
        for i, name in enumerate(outputs):
            if name in given:
                numbers[i] = given[name]
                continue
            sensor = self._sensors[i] if self._sensors else UNKNOWN
            strength = sensor.variance if self.of_samples else sensor.density
            why = sensor.why
            if sensor.multiplicative and not self.of_samples:
                strength, why = None, "its noise is in proportion to it"
            if strength is None:
                right = f"give R, or std of the noise, of recorded data as data.outputs.{name}.std"
                raise Problem(("R",), f"R of output {name} does not follow from the measurement: {why}; {right}")
            (relative if sensor.multiplicative else numbers)[i] = strength
        return numbers, relative

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        return {"Q": dict.fromkeys(states, 1.0), "R": 0.1}


class ChainNoise(KalmanFilter):
    """Process noise where the model knows least: at the end of every chain z_i' = z_(i+1) + phi_i.

    Q = q B B^T in the coordinates z = Phi(x), and q (J^-1 B)(J^-1 B)^T in the plant's, J = dPhi/dx at the estimate.
    """

    form = canonical_form

    def process_noise(self, form: Form) -> dict[str, np.ndarray]:
        assert isinstance(form, CanonicalForm)
        if not form.square:
            raise Problem(
                ("q",) if self.theta is None else ("theta",),
                "outputs that measure the same are driven by one noise between them, and this has one for each: give Q",
            )
        if self.theta is None:
            return {"q": np.full(len(form.chains), self.q)}
        numbers, relative = self._sensor_noise(form)
        if relative.any():
            raise Problem(("theta",), "q does not follow from noise in proportion to the output: give q")
        density = [self._area(i, name, R) for i, (name, R) in enumerate(zip(form.plant.outputs, numbers, strict=True))]
        return {"q": np.array([R_c * self.theta ** (2 * n) for R_c, n in zip(density, form.chains, strict=True)])}

    def _area(self, output: int, name: str, R: float) -> float:
        """R_c of an output whose R is known."""
        sensor = self._sensors[output] if self._sensors else UNKNOWN
        if not self.of_samples:
            return R
        if sensor.interval is None:
            raise Problem(("theta",), f"q does not follow: the time between samples of {name} is not known; give q")
        return R * sensor.interval

    def density(self, plant: ModelCopy, xhat: ca.SX, k: Symbols) -> ca.SX:
        assert isinstance(plant, PlantCopy)
        Q, count = ca.SX.zeros(plant.n, plant.n), len(plant.chains)
        for i in range(count):
            driven = plant.lift(xhat, plant.at_ends(ca.SX(np.eye(count)[:, i])))
            Q += k.q[i] * driven @ driven.T
        return Q

    @classmethod
    def on_chains(cls) -> type[KalmanFilter]:
        return cls
