"""Find the canonical coordinates of a plant, or say why there are none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from heapq import merge
from itertools import islice, product

import casadi as ca
import numpy as np

from hgorun.errors import NotObservableForm
from hgorun.symbolic import evaluate
from hgorun.symbolic.canonical import CanonicalForm, singular_value_ratio
from hgorun.symbolic.plant import PlantModel
from hgorun.symbolic.triangular import blocks_of

_MOST_SHARES = 50  # of the states among the outputs that are tried


def canonical_form(plant: PlantModel, at: np.ndarray, parameters: np.ndarray) -> CanonicalForm:
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
    if is_chain(plant):
        eye = ca.SX.eye(plant.n)
        return CanonicalForm(plant, (plant.n,), plant.x, eye, identity=True)
    chains_found = _chains(plant) if len(plant.outputs) > 1 else None
    if chains_found:
        order = [state for chain in chains_found for state in chain]
        z = ca.vertcat(*[plant.x[i] for i in order])
        lengths = tuple(len(chain) for chain in chains_found)
        return CanonicalForm(plant, lengths, z, ca.jacobian(z, plant.x), identity=False)
    derivatives = _lie_derivatives(plant)
    points = _points_around(at)
    singular: list[CanonicalForm] = []
    for chains in _chain_lengths(plant.n, len(plant.outputs)):
        rows = [derivatives[i][k] for i, length in enumerate(chains) for k in range(length)]
        phi_map = ca.cse(ca.vertcat(*rows))
        form = CanonicalForm(plant, chains, phi_map, ca.cse(ca.jacobian(phi_map, plant.x)), identity=False)
        if _rank(form, points, parameters) == plant.n:
            slopes = _slopes(form)
            _require_triangular(form, slopes, points, parameters)
            return replace(form, holds=partial(_holds, form, slopes, tuple(singular)))
        singular.append(form)
    raise NotObservableForm(_why_singular(singular[0], points, parameters))


def _holds(
    form: CanonicalForm,
    slopes: ca.Function,
    singular: tuple[CanonicalForm, ...],
    at: np.ndarray,
    parameters: np.ndarray,
) -> bool:
    """Whether other numbers decide as those did for which ``form`` was found after ``singular``."""
    points = _points_around(at)
    if any(_rank(other, points, parameters) == form.plant.n for other in singular):
        return False
    if _rank(form, points, parameters) < form.plant.n:
        return False
    try:
        _require_triangular(form, slopes, points, parameters)
    except NotObservableForm:
        return False
    return True


def is_chain(plant: PlantModel) -> bool:
    """Whether y = x_1 and x_i' = x_{i+1} + phi_i(t, u, x_1..x_i)."""
    if len(plant.outputs) != 1 or not ca.is_equal(ca.SX(plant.output), plant.x[0]):
        return False
    jacobian = ca.jacobian(plant.dynamics, plant.x)
    for i in range(plant.n - 1):
        for j in range(i + 1, plant.n):
            entry = ca.simplify(jacobian[i, j])
            if not entry.is_constant() or float(entry) != (1.0 if j == i + 1 else 0.0):
                return False
    return True


def _chains(plant: PlantModel) -> list[list[int]] | None:
    """Several chains that may feed each other downwards: the states of each, or None.

    For every output a measured state, and x_i' = x_(i+1) + phi_i along each chain, phi_i depending on the
    first i states of all chains.
    """
    try:
        block, measured = blocks_of(plant)
    except NotObservableForm:
        return None
    jacobian = ca.jacobian(plant.dynamics, plant.x)
    following: dict[int, int] = {}
    for i, j in product(range(plant.n), repeat=2):
        if block[j] > block[i]:
            slope = ca.simplify(jacobian[i, j])
            if not slope.is_constant() or float(slope) not in (0.0, 1.0):
                return None
            if float(slope) == 1.0:
                if block[j] > block[i] + 1 or i in following or j in following.values():
                    return None
                following[i] = j
    chains = []
    for head in measured:
        chain = [head]
        while chain[-1] in following:
            chain.append(following[chain[-1]])
        chains.append(chain)
    return chains if sum(map(len, chains)) == plant.n else None


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
    if plant.n and ca.depends_on(ca.vertcat(*[f for chain in chains for f in chain]), plant.t):
        raise NotObservableForm(
            "the observability map (h, L_f h, ...) depends on time; declare what varies as an input, since the map "
            "is taken with the inputs at zero, or take an observer with time-varying gain (shgo_riccati, fhgo1, "
            "fhgo2_nuos)"
        )
    return chains


def _chain_lengths(n: int, outputs: int) -> Iterator[tuple[int, ...]]:
    """Ways to share n among the outputs, the most even first; a few hundred where there are very many."""
    if outputs > n:
        raise NotObservableForm(f"{outputs} outputs measure {n} states: at most one output a state")
    by_spread = (
        share
        for spread in range(n - outputs + 1)
        for share in merge(*(_shares(n, outputs, low, low + spread) for low in range(1, n // outputs + 1)))
        if max(share) - min(share) == spread
    )
    yield from islice(by_spread, _MOST_SHARES)


def _shares(n: int, parts: int, low: int, high: int) -> Iterator[tuple[int, ...]]:
    """Ordered ways to write n as a sum of parts from low to high."""
    if parts == 0:
        yield ()
        return
    for first in range(max(low, n - (parts - 1) * high), min(high, n - (parts - 1) * low) + 1):
        for rest in _shares(n - first, parts - 1, low, high):
            yield first, *rest


def _points_around(at: np.ndarray) -> list[np.ndarray]:
    generator = np.random.default_rng(0)
    scale = np.abs(at) + 0.1
    return [at] + [at + 0.3 * scale * generator.uniform(-1, 1, at.size) for _ in range(8)]


def _rank(form: CanonicalForm, points: list[np.ndarray], parameters: np.ndarray) -> int:
    """Generic rank of J: n as soon as it is regular at one of the points."""
    best = 0
    for x in points:
        jacobian = form.jacobian_at(x, parameters)
        if not np.all(np.isfinite(jacobian)):
            continue
        if singular_value_ratio(jacobian) > 1e-10:
            return form.plant.n
        best = max(best, int(np.linalg.matrix_rank(jacobian)))
    return best


def _why_singular(form: CanonicalForm, points: list[np.ndarray], parameters: np.ndarray) -> str:
    plant = form.plant
    seen = set(form.jacobian.sparsity().get_col())
    missing = [name for k, name in enumerate(plant.states) if k not in seen]
    names = ", ".join(plant.outputs)
    if missing:
        return (
            f"state {', '.join(missing)} does not appear in the output {names} and its derivatives along the "
            "drift (inputs at zero): it cannot be observed by a constant-gain observer"
        )
    for x in points:
        jacobian = form.jacobian_at(x, parameters)
        if np.all(np.isfinite(jacobian)):
            direction = np.linalg.svd(jacobian)[2][-1]
            parts = [name for name, c in zip(plant.states, direction, strict=True) if abs(c) > 1e-6]
            rank = int(np.linalg.matrix_rank(jacobian))
            return (
                f"the observability map (h, L_f h, ...) of the drift has a singular Jacobian everywhere "
                f"(rank {rank} of {plant.n}): {', '.join(parts)} cannot be told apart from the output {names}"
            )
    return "the observability map (h, L_f h, ...) of the drift is not a finite number near the initial state"


def _slopes(form: CanonicalForm) -> ca.Function:
    """d phi / dx from (t, x, u, p), of the model z' = shift z + phi."""
    plant = form.plant
    phi = form.jacobian @ plant.dynamics - form.shift @ form.phi_map
    return ca.Function("slopes", [plant.t, plant.x, plant.u, plant.p], [ca.jacobian(phi, plant.x)])


def _require_triangular(
    form: CanonicalForm, slopes: ca.Function, points: list[np.ndarray], parameters: np.ndarray
) -> None:
    """In z the model must be a chain plus phi(u, z) with phi_i a function of z_1..z_i only."""
    plant = form.plant
    position = [k for length in form.chains for k in range(length)]
    generator = np.random.default_rng(1)
    for x in points:
        u = generator.uniform(-1, 1, plant.u.numel())
        jacobian = form.jacobian_at(x, parameters)
        if not singular_value_ratio(jacobian) > 1e-10:
            continue
        slope = evaluate.at(slopes, generator.uniform(), x, u, parameters)[0].reshape(plant.n, plant.n)
        in_z = slope @ np.linalg.inv(jacobian)
        scale = np.abs(slope) @ np.abs(np.linalg.inv(jacobian)) + 1e-300
        for i, j in product(range(plant.n), repeat=2):
            last = position[i] == form.chains[_chain_of(form, i)] - 1
            if position[j] > position[i] and not last and abs(in_z[i, j]) > 1e-7 * (1 + scale[i].max()):
                raise NotObservableForm(
                    f"not uniformly observable: in the coordinates z = (h, L_f h, ...) the derivative of "
                    f"z{i + 1} depends on z{j + 1} through an input or time (slope {in_z[i, j]:.3g}), so some "
                    "input can hide a state; a constant-gain observer needs a triangular model. With persistent "
                    "excitation an observer with time-varying gain will do (shgo_riccati, fhgo1, fhgo2_nuos)"
                )


def _chain_of(form: CanonicalForm, row: int) -> int:
    return int(np.searchsorted(np.cumsum(form.chains), row, side="right"))
