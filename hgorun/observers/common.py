"""What all observers have: keys, numbers designed from gains, internal states, an estimate.

What an observer does beside it, its equations, is said by the classes of :mod:`hgorun.observers.base`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Generic, Self

import casadi as ca
import numpy as np
from typing_extensions import TypeVar

from hgorun.observers.equations import Role
from hgorun.observers.keys import Keys
from hgorun.symbolic.canonical import CanonicalForm, PlantCopy
from hgorun.symbolic.forms import Copy, Form, FormFinder
from hgorun.symbolic.observability import canonical_form
from hgorun.symbolic.states import Symmetric
from hgorun.symbolic.symbols import Symbols

# The class of plants that an observer is for, and the copy of the plant that this class gives it.
FormT = TypeVar("FormT", bound=Form, default=CanonicalForm)
CopyT = TypeVar("CopyT", bound=Copy, default=PlantCopy)


class Observer(Keys, Generic[FormT, CopyT]):
    """Base of all observers; :class:`~hgorun.observers.keys.Keys` are those that every observer block has.

    Derive from one of the classes of :mod:`hgorun.observers.base` that say what it does. The type parameters are the
    class of plants that the observer is for and the copy of the plant that its equations get; left out, they are
    those of :func:`~hgorun.symbolic.observability.canonical_form`.
    """

    kind: ClassVar[str] = "observer"
    reference: ClassVar[str] = ""
    # {key: its source}, of what an observer does only where its block has the key
    key_references: ClassVar[Mapping[str, str]] = {}
    # {key: why it has none}, of keys that observers like it have
    lacks: ClassVar[Mapping[str, str]] = {
        "extend": "it takes the plant neither as chains nor block by block, so that no unknown input can stand behind "
        "them: give the plant a state for it, or take extended",
    }
    # the class of plants: a function that gives a plant's form, and refuses other plants
    form: ClassVar[FormFinder] = canonical_form

    # Parameters are types of methods, which only type checkers ask for, and not of keys. Pydantic would derive a
    # class with all keys for each combination, and build what checks them: a tenth of a short run.
    def __class_getitem__(cls, parameters: object) -> type[Self]:
        return cls

    @abstractmethod
    def design(self, form: FormT) -> Mapping[str, np.ndarray]:
        """The numbers that the equations use, from the gains of the block: ``k`` of the equations.

        Raises
        ------
        Problem
            When the gains do not fit the plant; its path starts at the key of this block.
        """

    def states(self, form: FormT) -> Mapping[str, np.ndarray | Symmetric]:
        """Internal states other than xhat: their names, shapes and default initial values; none by default."""
        return {}

    def roles(self, form: FormT) -> Mapping[str, Role]:
        """What each internal state is, for the theory.

        ``filter``
            It passes the innovation on, and is zero while the estimate is right.
        ``gain``
            The correction is multiplied by it: it follows the plant, and small errors do not move it.
        ``signal``
            It estimates something of the plant beside the state, such as derivatives of the output.

        By default symmetric matrices are gains, and all other states are filters: of a gain that is a number or a
        vector its class has to say so.
        """
        return {name: "gain" if isinstance(value, Symmetric) else "filter" for name, value in self.states(form).items()}

    def estimate(self, s: Symbols, k: Symbols) -> ca.SX:
        """The estimate in the observer's coordinates, shape (n,); by default its state xhat."""
        return s.xhat

    def start(self, xhat: np.ndarray, k: Mapping[str, np.ndarray]) -> np.ndarray:
        """The state xhat (..., n) from which :meth:`estimate` gives these estimates (..., n); by default themselves.

        Parameters
        ----------
        k : mapping of str to ndarray
            The numbers of :meth:`design`.
        """
        return xhat

    def fastest_rate(self, form: FormT) -> float:
        """The largest modulus of the error dynamics' eigenvalues (1/time), for ``step: auto``; 0: unknown."""
        return 0.0

    def error_rate(self, form: FormT) -> float:
        """The rate at which the error itself moves, where gains move faster (1/time); 0: unknown."""
        return self.fastest_rate(form)

    def unestimated(self, form: FormT) -> tuple[str, ...]:
        """States of the plant of which it says nothing; its numbers for them are those that it started from."""
        return ()

    def remarks(self, form: FormT) -> tuple[str, ...]:
        """What should be known of it on this plant although nothing is wrong with its keys."""
        return ()

    @classmethod
    def example(cls, states: tuple[str, ...]) -> Mapping[str, object]:
        """Keys of a block that works, for a family whose keys have no defaults.

        Parameters
        ----------
        states : tuple of str
            Names of the plant's states.
        """
        return {}
