"""The keys of the Kazantzis-Kravaris/Luenberger observer, and its map."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Literal

import casadi as ca
import numpy as np
from pydantic import Field

from hgorun.config.types import Interval, Name, NonNegative, Positive
from hgorun.errors import Problem
from hgorun.memo import Memo, same
from hgorun.observers import kkl_map
from hgorun.observers.base import (
    Observer,
    Role,
)
from hgorun.observers.capabilities import NoiseInformed, NotExported, NotLinear, Punctual
from hgorun.observers.expressions import require_states
from hgorun.observers.orbits import Escaped
from hgorun.symbolic.drift import DriftForm, drift_form
from hgorun.symbolic.evaluate import Floats
from hgorun.symbolic.smooth import SmoothCopy
from hgorun.symbolic.symbols import Symbols

_GRID = 21  # points a state
_MOST = 200_000  # points, and numbers among the coefficients
_UNEVEN = 1e-6  # of a period
_MAPS: Memo[kkl_map.Polynomial] = Memo(32)
_STARTS: Memo[np.ndarray] = Memo(64)


class KklObserver(NoiseInformed, Punctual, NotExported, NotLinear, Observer[DriftForm, SmoothCopy]):
    """The keys of a KKL observer, and the map T: of what, its classes say."""

    because = "z lives in the time when outputs were taken"

    reference = (
        "Kazantzis, Kravaris 1998; Andrieu, Praly 2006; Brivadis, Andrieu, Bernard, Serres 2023, quoted from memory; "
        "the inverse by regression: our own"
    )
    form = staticmethod(drift_form)
    without_box: ClassVar[str] = "linear plants"

    theta: Positive = Field(default=1.0, description="speed theta > 0: the eigenvalues of z are -theta lam")
    lam: tuple[Positive, ...] | None = Field(
        default=None, description="m different numbers > 0, for each output; 1, 2, ..., m by default"
    )
    m: int | None = Field(
        default=None, ge=1, le=50, strict=True, description="components of z for each output, m >= n; 2n + 1 by default"
    )
    box: dict[Name, Interval] = Field(
        default_factory=dict,
        description="state: [low, high], where the inverse of a nonlinear plant's map is fitted; all states",
    )
    grid: int = Field(default=_GRID, ge=2, le=1001, strict=True, description="points of the box along each state")
    points: int | None = Field(
        default=None, ge=2, le=_MOST, strict=True, description="in place of grid: as many points of a Sobol sequence"
    )
    degree: int = Field(default=3, ge=1, le=5, strict=True, description="of the polynomial that is the inverse, 1..5")
    ridge: NonNegative = Field(
        default=0.0, description="weight of its squared coefficients in the fit, beside a mean square of states, >= 0"
    )
    outside: Literal["saturate"] | None = Field(
        default=None,
        description="saturate: backwards in time the plant is f and h at the state clipped to the box, for plants that "
        "escape; the map is right where the past has been inside",
    )

    def design(self, form: DriftForm) -> dict[str, np.ndarray]:
        self.require_times(form)
        values, count = self.eigenvalues(form), len(form.plant.outputs)
        numbers = {"Lam": np.tile(values, count)}
        _ = self._start(form)
        if self.is_exact(form):
            T = self._matrix(form)
            return {**numbers, "T": T, "inverse": kkl_map.left_inverse(T, values)}
        found = self.inverse(form)
        return {**numbers, "W": found.W, "center": found.center, "scale": found.scale}

    @property
    def not_exported(self) -> str:
        return "kkl is not exported: its inverse holds where it has been fitted, which code of its own does not watch"

    @abstractmethod
    def require_times(self, form: DriftForm) -> None:
        """Refuse outputs that are not as this class takes them."""

    @abstractmethod
    def eigenvalues(self, form: DriftForm) -> np.ndarray:
        """Of Lam, shape (m,)."""

    @abstractmethod
    def is_exact(self, form: DriftForm) -> bool:
        """Whether T is a matrix."""

    def at_first(self, form: DriftForm, x: np.ndarray) -> np.ndarray:
        """The estimate where z begins, shape (n,), from that at the start of the run; by default the same."""
        return x

    @abstractmethod
    def _matrix(self, form: DriftForm) -> np.ndarray:
        """T of a linear plant, shape (q m, n)."""

    @abstractmethod
    def _mapped(self, form: DriftForm, x: Floats) -> Floats:
        """T at points, shape (N, q m)."""

    def numbers(self, form: DriftForm) -> np.ndarray:
        """theta lam, shape (m,)."""
        n = form.plant.n
        m = len(self.lam) if self.lam is not None else 2 * n + 1 if self.m is None else self.m
        if self.lam is not None and self.m not in (None, m):
            raise Problem(("m",), f"lam has {m} numbers, found m = {self.m}")
        if m < n:
            raise Problem(("m",), f"expected m >= n = {n}: fewer numbers cannot tell {n} states; found {m}")
        lam = np.arange(1.0, m + 1) if self.lam is None else np.array(self.lam)
        if len(set(lam)) < m:
            raise Problem(("lam",), "expected different numbers: z with equal ones are equal")
        return np.asarray(self.theta * lam)

    def states(self, form: DriftForm) -> Mapping[str, np.ndarray]:
        return {"z": self._start(form)}

    def roles(self, form: DriftForm) -> Mapping[str, Role]:
        return {"z": "signal"}

    def _start(self, form: DriftForm) -> np.ndarray:
        """T at the estimate where z begins."""
        if not self.is_exact(form):
            self._require_box(form)
            if "z" in self.internal:
                return np.zeros(len(self.eigenvalues(form)) * len(form.plant.outputs))
        x = self.at_first(form, np.array([self.initial.get(name, 0.0) for name in form.plant.states]))
        return self.of_estimate(form, x)

    def of_estimate(self, form: DriftForm, x: np.ndarray) -> np.ndarray:
        """T at an estimate, shape (q m,)."""
        if self.is_exact(form):
            return np.asarray(self._matrix(form) @ x)
        return _STARTS.get((same(form), x.tobytes(), *self._key(form)), lambda: self._at(form, x[None], "initial")[0])

    def _at(self, form: DriftForm, x: Floats, key: str) -> Floats:
        try:
            return self._mapped(form, x)
        except Escaped as escaped:
            point = ", ".join(f"{name} = {v:.4g}" for name, v in zip(form.plant.states, escaped.x, strict=True))
            raise Problem(
                (key,),
                f"backwards in time the plant does not stay near: from {point} it is far after {escaped.after:.4g}, "
                "and T is not known there. Take a smaller box or faster lam; outside: saturate clips the state to the "
                "box",
            ) from None

    def inverse(self, form: DriftForm) -> kkl_map.Polynomial:
        """The polynomial of z that a nonlinear plant's state is."""
        self._require_box(form)
        return _MAPS.get((same(form), *self._key(form)), lambda: self._fitted(form))

    def _fitted(self, form: DriftForm) -> kkl_map.Polynomial:
        x, others = self._points(form)
        terms = len(kkl_map.monomials(len(self.eigenvalues(form)) * len(form.plant.outputs), self.degree))
        if terms * len(x) > 100 * _MOST or len(x) < terms:
            message = f"the inverse has {terms} coefficients a state, and {len(x)} points"
            raise Problem(("degree",), f"{message}: expected at least as many points, and fewer numbers than 2e7")
        return kkl_map.fitted(
            self._at(form, x, "box"), x, (self._at(form, others, "box"), others), self.degree, self.ridge
        )

    def _key(self, form: DriftForm) -> tuple[object, ...]:
        """What the map depends on beside the plant."""
        own = self.eigenvalues(form).tobytes(), tuple(self.box.items()), self.grid, self.points
        return (type(self), *own, self.degree, self.ridge, self.outside)

    def _require_box(self, form: DriftForm) -> None:
        states = form.plant.states
        require_states("box", self.box, states)
        missing = [name for name in states if name not in self.box]
        if missing:
            raise Problem(
                ("box",) if self.box else (),
                f"box of {', '.join(missing)} is missing: the inverse of the map is fitted in a box of the states, but "
                f"for {self.without_box}",
            )

    def _points(self, form: DriftForm) -> tuple[Floats, Floats]:
        """Those that the inverse is fitted to, and others in between."""
        from scipy.stats import qmc

        n = form.plant.n
        low, high = self._box(form)
        if self.points is None:
            if self.grid**n > _MOST:
                raise Problem(
                    ("grid",), f"{self.grid}^{n} points are more than {_MOST}: take points, or a coarser grid"
                )
            axes = np.meshgrid(*[np.linspace(0, 1, self.grid)] * n, indexing="ij")
            inside = np.column_stack([axis.ravel() for axis in axes])
        else:
            inside = qmc.Sobol(n, scramble=False).random_base2(int(np.ceil(np.log2(self.points))))[: self.points]
        others = qmc.Halton(n, scramble=False).random(1 + min(len(inside), 500))[1:]
        return low + (high - low) * inside, low + (high - low) * others

    def _box(self, form: DriftForm) -> tuple[np.ndarray, np.ndarray]:
        bounds = np.array([self.box[name] for name in form.plant.states])
        return bounds[:, 0], bounds[:, 1]

    def backwards(self, form: DriftForm) -> tuple[kkl_map.Field, np.ndarray]:
        """The plant that is integrated backwards, and the widths of the box."""
        low, high = self._box(form)
        if self.outside is None:
            return form.values, high - low
        return lambda x: form.values(np.clip(x, low, high)), np.full(len(low), np.inf)

    def inverted(self, z: ca.SX, k: Symbols) -> ca.SX:
        """T^inv(z), shape (n,)."""
        if "inverse" in vars(k):
            return k.inverse @ z
        return kkl_map.value(k.W, (z - k.center) / k.scale, self.degree)
