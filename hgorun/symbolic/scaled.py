"""Plants whose coordinates scale with powers of theta: chains, or blocks of a triangular model where there are none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.forms import Form, ModelCopy
from hgorun.symbolic.observability import CanonicalForms
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.triangular import TriangularForm, triangular_form


class ScaledCopy(ModelCopy, Protocol):
    """A copy of a plant with z = Phi(x), whose i-th block is corrected with theta^i."""

    def inv_Delta(self, theta: ca.SX) -> ca.SX:
        """Delta^-1(theta), shape (N, N) with N components of z."""
        ...

    def links(self, xhat: ca.SX) -> ca.SX | ca.DM:
        """What leads in z' from each block to the next: A of the chains, or F(u, xhat); shape (N, N)."""
        ...

    @property
    def C(self) -> ca.DM:
        """y = C z, shape (q, N)."""
        ...

    def lift(self, xhat: ca.SX, kappa: ca.SX) -> ca.SX:
        """A correction made in z, in the coordinates of the estimate."""
        ...


@dataclass(frozen=True)
class BlocksForm(TriangularForm):
    """A triangular model that has been taken since the plant has no chains; other numbers may give it some.

    Attributes
    ----------
    chains : callable
        (at, parameters) -> the chains for other numbers, or NotObservableForm.
    """

    chains: Callable[[np.ndarray, np.ndarray], Form] = field(compare=False, repr=False)

    def again(self, at: np.ndarray, parameters: np.ndarray) -> BlocksForm | None:
        """Itself, where other numbers do not lead to chains either."""
        try:
            self.chains(at, parameters)
        except NotObservableForm:
            return self
        return None


@dataclass(frozen=True)
class ChainsOrBlocks(CanonicalForms):
    """The class of plants with chains as coordinates, and of those that are triangular without being observable
    under every input."""

    def __call__(self, plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> Form:  # type: ignore[override]  # either of two forms
        """The chains of a plant, else its blocks.

        Raises
        ------
        NotObservableForm
            With the reason why there are no chains, and no blocks.
        """
        find = self.finder(plant)

        def chains(at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
            return _square(find(at, parameters))

        if self.map != "auto" or self.chains:
            return chains(at, parameters)
        try:
            return chains(at, parameters)
        except NotObservableForm as no_chains:
            try:
                found = triangular_form(plant, at, parameters)
            except NotObservableForm as no_blocks:
                raise NotObservableForm(f"{no_chains}; nor is it triangular: {no_blocks}") from no_blocks
            return BlocksForm(found.plant, found.model, found.block, found.measured, chains)


def _square(form: CanonicalForm) -> CanonicalForm:
    """A form whose chains have as many components as there are states."""
    if not form.square:
        raise NotObservableForm("outputs that measure the same have more chain components than there are states")
    return form


scaled_form = ChainsOrBlocks()
