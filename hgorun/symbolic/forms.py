"""What an observer needs of a plant's structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, Protocol, runtime_checkable

import casadi as ca
import numpy as np

from hgorun.symbolic.plant import PlantModel

Bounds = Mapping[str, tuple[ca.SX, ca.SX]]


def saturate(x: ca.SX, names: Sequence[str], bounds: Bounds) -> ca.SX:
    """x with the named states clipped to their bounds."""
    parts = [x[i] for i in range(len(names))]
    for name, (low, high) in bounds.items():
        i = names.index(name)
        parts[i] = ca.fmax(low, ca.fmin(high, parts[i]))
    return ca.vertcat(*parts)


class Copy(Protocol):
    """What an observer knows of the plant: at least the way from its own coordinates to the plant's."""

    def state(self, xhat: ca.SX) -> ca.SX:
        """The estimate in the plant's coordinates."""
        ...

    def output(self, xhat: ca.SX) -> ca.SX:
        """C xhat, the outputs of the estimate, shape (q,)."""
        ...


@runtime_checkable
class ModelCopy(Copy, Protocol):
    """A copy of the plant: its vector field as well."""

    def copy(self, xhat: ca.SX) -> ca.SX:
        """The plant's vector field at the estimate, in the coordinates where the observer computes."""
        ...


def felt(copy: Copy, xhat: ca.SX, rate: ca.SX) -> ca.SX | None:
    """C_x (copy(xhat) - xhat'): what the outputs of an estimate feel beside a copy of the plant; None without one."""
    return ca.jtimes(copy.output(xhat), xhat, copy.copy(xhat) - rate) if isinstance(copy, ModelCopy) else None


@runtime_checkable
class GuessingCopy(Copy, Protocol):
    """A copy whose estimate is found by Newton's method."""

    def started_at(self, guess: ca.SX) -> Copy:
        """The same with other numbers to start from, shape (n,)."""
        ...


class Form(Protocol):
    """A class of plants, and one member of it: built by a function that refuses what is not in the class."""

    @property
    def plant(self) -> PlantModel:
        """The plant."""
        ...

    def saturable(self, canonical: bool) -> tuple[str, ...]:
        """Names of the states that can be saturated in the observer's coordinates."""
        ...

    def coordinates(self, canonical: bool) -> ca.SX:
        """z = T(x), where the observer computes, in the plant's symbols t, x and p; shape (n,)."""
        ...

    def start(self, x: np.ndarray, parameters: np.ndarray, canonical: bool) -> np.ndarray:
        """The initial estimate in the observer's coordinates; ValueError says why there is none."""
        ...

    def copy(self, t: ca.SX, u: ca.SX, p: ca.SX, canonical: bool, bounds: Bounds) -> Copy:
        """The copy of the plant with these inputs and parameters."""
        ...


@runtime_checkable
class Guessing(Form, Protocol):
    """A form whose copies of the plant are :class:`GuessingCopy`, where there is something to guess."""

    @property
    def guess(self) -> np.ndarray | None:
        """Where Newton's method starts, shape (n,): a number of the run, and no part of its equations."""
        ...


@runtime_checkable
class Driven(Form, Protocol):
    """A form whose coordinates depend on the inputs, too."""

    def start_driven(self, x: np.ndarray, parameters: np.ndarray, canonical: bool, inputs: np.ndarray) -> np.ndarray:
        """As :meth:`start`, with u and its derivatives by time at the start, shape (m, n); NaN is not known yet."""
        ...


@runtime_checkable
class Redecided(Form, Protocol):
    """A form that tells whether other numbers lead to the same equations, without symbolic work."""

    def again(self, at: np.ndarray, parameters: np.ndarray) -> Form | None:
        """The form for other numbers, of the same equations; None where they may lead to others, or to none.

        Parameters
        ----------
        at : ndarray, shape (n,)
            The plant's initial state.
        parameters : ndarray
            Values of the plant's parameters.
        """
        ...


class FormFinder(Protocol):
    """A class of plants as a function: the form of a plant, or why it has none."""

    def __call__(self, plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> Form:
        """The plant's form, decided near the state ``at`` (n,); NotObservableForm where it has none."""
        ...


@runtime_checkable
class ChainForm(Form, Protocol):
    """A form whose coordinates z = Phi(x) are chains, one an output: z_i' = z_(i+1) + phi_i(u, z)."""

    @property
    def chains(self) -> tuple[int, ...]:
        """Length of each output's chain."""
        ...

    @property
    def phi_map(self) -> ca.SX:
        """Phi(x, p), shape (n,)."""
        ...

    @property
    def jacobian(self) -> ca.SX:
        """dPhi/dx, shape (n, n)."""
        ...

    @property
    def identity(self) -> bool:
        """Whether z is x."""
        ...


@runtime_checkable
class ChosenChains(ChainForm, Protocol):
    """Chains that a plant may have in several ways: which were taken, and whether they lead back to its states."""

    @property
    def map(self) -> Literal["chain", "derivatives"]:
        """Whether z are the plant's own states, but for their units, or derivatives of its outputs."""
        ...

    @property
    def taken(self) -> Mapping[str, int]:
        """The outputs with the lengths of their chains."""
        ...

    @property
    def no_inverse(self) -> str | None:
        """Why x is not known as a function of z; None where it is."""
        ...


@runtime_checkable
class BlockForm(Form, Protocol):
    """A form whose model is triangular, block by block, in coordinates where every output is a state."""

    @property
    def model(self) -> PlantModel:
        """The plant in these coordinates."""
        ...

    @property
    def block(self) -> tuple[int, ...]:
        """For each state of ``model`` the number of its block, 0 for the measured ones."""
        ...

    @property
    def measured(self) -> tuple[int, ...]:
        """For each output the state that it is."""
        ...
