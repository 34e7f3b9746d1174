"""Find the canonical coordinates of a plant, or say why there are none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby
from typing import Literal

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate, ranks
from hgorun.symbolic.canonical import CanonicalForm
from hgorun.symbolic.chains import Chain, Links
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.points import around
from hgorun.symbolic.shares import chain_lengths, unevenness
from hgorun.symbolic.uniform import input_slopes, require_uniform
from hgorun.symbolic.unseen import unseen_states

_TIE = 1e-6  # of the logarithm of a determinant


@dataclass(frozen=True)
class CanonicalForms:
    """The class of plants with chains as coordinates: a function that gives a plant's form.

    Where the plant is made of chains with constant links, in whatever order its states are listed, these are
    taken; elsewhere the derivatives of the outputs. With several outputs the n rows h, L h, L^2 h ... are
    shared among them as evenly as is possible with J regular; of equally even ways the one with the largest
    determinant of J, its rows in units of the outputs' noise; of equal ones the one with the longer chain for
    the output that comes first in the alphabet. Where outputs measure the same, all get chains of one length.
    None of this depends on the order or the units in which a plant is written.

    Attributes
    ----------
    map : {"auto", "chain", "derivatives"}
        The chains of the plant, the derivatives of its outputs, or chains where there are some.
    chains : tuple of (str, int)
        Length of every output's chain, if they are chosen.
    noise : tuple of (str, float)
        Standard deviation of the noise of outputs; 1 where it is left out.
    """

    map: Literal["auto", "chain", "derivatives"] = "auto"
    chains: tuple[tuple[str, int], ...] = ()
    noise: tuple[tuple[str, float], ...] = ()

    def chosen(
        self,
        map: Literal["auto", "chain", "derivatives"],
        chains: Mapping[str, int],
        noise: Mapping[str, float],
    ) -> CanonicalForms:
        """The same class with a choice of coordinates."""
        return replace(self, map=map, chains=tuple(chains.items()), noise=tuple(noise.items()))

    def __call__(self, plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
        """Find the coordinates of a plant, or say why there are none.

        Parameters
        ----------
        plant : PlantModel
        at : ndarray, shape (n,)
            A typical state: ranks are decided at random points around it.
        parameters : ndarray
            Values of the parameters.

        Raises
        ------
        NotObservableForm
            When a state does not reach the output, when J is singular everywhere, or when the model is
            not triangular in z, so that some input can hide a state.
        """
        return self.finder(plant)(at, parameters)

    def finder(self, plant: PlantModel) -> Callable[[np.ndarray, np.ndarray], CanonicalForm]:
        """The same of one plant, from a typical state and parameters: its symbolic work is done once."""
        return _Search(self, plant).form


canonical_form = CanonicalForms()


class _Search:
    """The ways to choose coordinates of a plant: what is symbolic is done once, numbers decide among them."""

    def __init__(self, wishes: CanonicalForms, plant: PlantModel) -> None:
        self.wishes, self.plant = wishes, plant
        noise = dict(wishes.noise)
        self.weights = tuple(1 / noise.get(name, 1.0) for name in plant.outputs)
        self.links = Links(plant)
        self._known: dict[tuple[int, ...], CanonicalForm] = {}
        self._linked: dict[tuple[tuple[int, ...], ...], CanonicalForm] = {}
        self._slope_functions: dict[tuple[int, ...], ca.Function | None] = {}
        self._moving: dict[tuple[int, ...], bool] = {}
        self._rows: dict[tuple[int, int], ca.Function] = {}

    def form(self, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
        """The form for these numbers."""
        form = self._chosen(at, parameters)
        return replace(form, holds=lambda at, parameters: self._again(form, at, parameters))

    def _again(self, form: CanonicalForm, at: np.ndarray, parameters: np.ndarray) -> bool:
        """Whether other numbers lead to the same coordinates."""
        try:
            other = self._chosen(at, parameters)
        except NotObservableForm:
            return False
        states = [[chain.states for chain in each.links] for each in (form, other)]
        return (other.map, other.chains, states[1]) == (form.map, form.chains, states[0])

    def _chosen(self, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
        links = self.links.chains(parameters) if self.wishes.map != "derivatives" else None
        if links is not None:
            form = self._of_links(links)
            if not self.wishes.chains or dict(self.wishes.chains) == form.taken:
                return form
        if self.wishes.map == "chain":
            raise NotObservableForm(
                f"map: chain requires x_i' = c_i x_(i+1) + phi_i(u, x_1..x_i) with constant c_i and outputs c_0 x_1"
                f"{', with the lengths of the key chains' if links is not None else ''}; take map: derivatives"
            )
        near = around(at, self.plant.states)
        lengths = self._lengths(near, parameters)
        form = self._of_derivatives(lengths)
        require_uniform(form, near, parameters, self._slopes(form))
        return form

    def _of_links(self, links: tuple[Chain, ...]) -> CanonicalForm:
        order = tuple(tuple(chain.states) for chain in links)
        if order not in self._linked:
            self._linked[order] = self._along(links)
        return self._linked[order]

    def _along(self, links: tuple[Chain, ...]) -> CanonicalForm:
        """The form whose coordinates are chains of the plant's own states."""
        plant = self.plant
        lengths = tuple(len(chain.states) for chain in links)
        z = ca.vertcat(*[s * plant.x[i] for chain in links for i, s in zip(chain.states, chain.scales, strict=True)])
        identity = len(lengths) == 1 and bool(ca.is_equal(z, plant.x))
        if identity:
            return CanonicalForm(plant, lengths, plant.x, ca.SX.eye(plant.n), identity=True)
        return CanonicalForm(
            plant, lengths, z, ca.jacobian(z, plant.x), identity=False, links=links, weights=self.weights
        )

    def _of_derivatives(self, lengths: tuple[int, ...]) -> CanonicalForm:
        if lengths not in self._known:
            rows = [self._derivatives[i][k] for i, length in enumerate(lengths) for k in range(length)]
            phi_map = ca.cse(ca.vertcat(*rows))
            jacobian = ca.cse(ca.jacobian(phi_map, self.plant.x))
            self._known[lengths] = CanonicalForm(
                self.plant, lengths, phi_map, jacobian, identity=False, weights=self.weights
            )
        return self._known[lengths]

    @cached_property
    def _derivatives(self) -> list[list[ca.SX]]:
        return _lie_derivatives(self.plant)

    def _row(self, output: int, order: int) -> ca.Function:
        """The gradient of L^order h of an output, of (x, p)."""
        if (output, order) not in self._rows:
            gradient = ca.jacobian(self._derivatives[output][order], self.plant.x)
            self._rows[output, order] = ca.Function("row", [self.plant.x, self.plant.p], [ca.densify(ca.cse(gradient))])
        return self._rows[output, order]

    def _jacobian(self, lengths: tuple[int, ...], x: np.ndarray, parameters: np.ndarray) -> np.ndarray:
        """J with its rows in units of the outputs' noise, shape (sum(lengths), n)."""
        if len(lengths) == 1:  # the only way, and the form has it
            return self._of_derivatives(lengths).jacobian_at(x, parameters) * self.weights[0]
        rows = [
            evaluate.at(self._row(i, k), x, parameters)[0].ravel() * self.weights[i]
            for i, length in enumerate(lengths)
            for k in range(length)
        ]
        return np.array(rows).reshape(-1, self.plant.n)

    def _slopes(self, form: CanonicalForm) -> ca.Function | None:
        if form.chains not in self._slope_functions:
            self._slope_functions[form.chains] = input_slopes(form)
        return self._slope_functions[form.chains]

    def _lengths(self, points: list[np.ndarray], parameters: np.ndarray) -> tuple[int, ...]:
        """How long the chain of every output is."""
        plant = self.plant
        q = len(plant.outputs)
        if self.wishes.chains:
            given = dict(self.wishes.chains)
            lengths = tuple(given[name] for name in plant.outputs)
            if self._regular(lengths, points, parameters):
                return lengths
            raise NotObservableForm(self._why_not(lengths, points, parameters))
        if q == 1:
            if self._regular((plant.n,), points, parameters):
                return (plant.n,)
            raise NotObservableForm(self._why_not((plant.n,), points, parameters))
        for _, even in groupby(chain_lengths(plant.outputs, plant.n), unevenness):
            sizes = {lengths: self._size(lengths, points, parameters) for lengths in even}
            best = max(sizes.values())
            if best > -np.inf:
                return next(lengths for lengths, size in sizes.items() if size >= best - _TIE * (1 + abs(best)))
        for length in range(1, plant.n + 1):
            if q * length >= plant.n and self._regular((length,) * q, points, parameters):
                return (length,) * q
        raise NotObservableForm(self._why_not((plant.n,) * q, points, parameters))

    def _moves(self, lengths: tuple[int, ...]) -> bool:
        """Whether the map depends on time."""
        if lengths not in self._moving:
            rows = [self._derivatives[i][k] for i, length in enumerate(lengths) for k in range(length)]
            self._moving[lengths] = bool(ca.depends_on(ca.vertcat(*rows), self.plant.t))
        return self._moving[lengths]

    def _regular(self, lengths: tuple[int, ...], points: list[np.ndarray], parameters: np.ndarray) -> bool:
        """Whether the map does not depend on time, and J has rank n at one of the points."""
        if self._moves(lengths):
            return False
        jacobians = (self._jacobian(lengths, x, parameters) for x in points)
        return any(ranks.is_regular(jacobian) for jacobian in jacobians)

    def _size(self, lengths: tuple[int, ...], points: list[np.ndarray], parameters: np.ndarray) -> float:
        """The mean logarithm of |det J| over the points where J is regular; -inf where there are none.

        Differences of it do not depend on units: those of the states change all determinants alike, that of
        time does so among equally uneven lengths, and those of the outputs cancel against their noise.
        """
        sizes: list[float] = []
        for x in points if not self._moves(lengths) else ():
            jacobian = self._jacobian(lengths, x, parameters)
            if ranks.is_regular(jacobian):
                sizes.append(float(np.linalg.slogdet(jacobian)[1]))
        return float(np.mean(sizes)) if sizes else -np.inf

    def _why_not(self, lengths: tuple[int, ...], points: list[np.ndarray], parameters: np.ndarray) -> str:
        plant, names = self.plant, ", ".join(self.plant.outputs)
        if hidden := ", ".join(unseen_states(plant)):  # whatever the map depends on
            return (
                f"nothing that is measured ({names}) depends on the state {hidden}, now or later: no observer can tell "
                "it from measurements; measure more, or leave it out"
            )
        if self._moves(lengths):
            return (
                "the observability map (h, L_f h, ...) depends on time; declare what varies as an input, since the "
                "map is taken with the inputs at zero"
            )
        rows = [self._derivatives[i][k] for i, length in enumerate(lengths) for k in range(length)]
        seen = set(ca.jacobian(ca.vertcat(*rows), plant.x).sparsity().get_col())
        missing = [name for k, name in enumerate(plant.states) if k not in seen]
        if missing:
            return (
                f"state {', '.join(missing)} does not appear in the output {names} and its derivatives along the "
                "drift (inputs at zero): it cannot be observed by a constant-gain observer"
            )
        jacobians = [self._jacobian(lengths, x, parameters) for x in points]
        finite = [jacobian for jacobian in jacobians if np.all(np.isfinite(jacobian))]
        if not finite:
            return "the observability map (h, L_f h, ...) of the drift is not a finite number near the initial state"
        best = max(finite, key=ranks.rank)
        unseen = ranks.null_direction(best)
        parts = [name for name, c in zip(plant.states, unseen, strict=True) if abs(c) > 1e-6 * np.abs(unseen).max()]
        return (
            f"the observability map (h, L_f h, ...) of the drift has a singular Jacobian everywhere "
            f"(rank {ranks.rank(best)} of {plant.n}): {', '.join(parts)} cannot be told apart from the output {names}"
        )


def _lie_derivatives(plant: PlantModel) -> list[list[ca.SX]]:
    """For each output the n functions h, L_f0 h, ..., with the inputs at zero."""
    zero = ca.SX.zeros(plant.u.shape)
    drift = plant.f(plant.t, plant.x, zero, plant.p)
    output = plant.h(plant.t, plant.x, zero, plant.p)
    chains = []
    for i in range(len(plant.outputs)):
        functions = [output[i]]
        for _ in range(plant.n - 1):
            functions.append(ca.cse(ca.jtimes(functions[-1], plant.x, drift)))
        chains.append(functions)
    return chains
