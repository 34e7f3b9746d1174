"""Whether a small error decays: the linearised error of an observer on a plant at rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.integrate import solve_ivp

from hgorun.errors import HgorunError, Problem
from hgorun.observers.base import ContinuousObserver, CorrectedObserver, SampledObserver
from hgorun.observers.capabilities import Differentiator, NotLinear, SlidingMode
from hgorun.testing.cases import CHAINS, TWO_OUTPUTS, Subject
from hgorun.testing.contract import Broken, NotApplicable
from hgorun.testing.equations import Equations

PERIOD = 0.1  # of the samples of observers that jump
SETTLED = 100.0  # time, or samples, after which gains are looked at
MARGIN = 1e-6  # relative: rounding of an eigenvalue that is zero, or of modulus one
BESIDE = 1e-6  # an error that tells a kink from a slope
KINK = 1e-3  # relative change of the slopes there
MEANT = (
    "; look at the sign of the correction (e = C xhat - y, so it is subtracted) and at whether every state is corrected"
)


def decays(subject: Subject) -> None:
    """All eigenvalues of the error lie to the left of the imaginary axis, of one that jumps inside the unit circle."""
    observer = subject.cases[0].observer()
    if isinstance(observer, Differentiator):
        raise NotApplicable("it does without the plant's equations")
    if isinstance(observer, NotLinear) and observer.not_linear is not None:
        raise NotApplicable(observer.not_linear)
    if isinstance(observer, SlidingMode):
        raise NotApplicable("its right-hand side has no slope where the error is zero")
    looked_at = 0
    for equations in _at_rest(subject):
        looked_at += 1
        if isinstance(equations.observer, (CorrectedObserver, SampledObserver)):
            _shrinks(equations)
        else:
            _moves_left(equations)
    if not looked_at:
        raise NotApplicable("it takes neither integrators nor the common plant of two outputs, which can be at rest")


def _at_rest(subject: Subject) -> Iterator[Equations]:
    chains = (subject.on_integrators(n) for n in CHAINS)
    yield from [equations for equations in chains if equations is not None][:1]
    try:
        equations = subject.case(TWO_OUTPUTS).equations()
    except (HgorunError, Problem, Broken):
        return
    yield equations


def _moves_left(equations: Equations) -> None:
    """A continuous observer: the eigenvalues of the flow that the innovation closes."""
    z = _settled(equations)
    for A in _slopes(equations, z):
        poles = np.linalg.eigvals(A)
        slowest = float(np.max(poles.real, initial=-np.inf))
        if not slowest < -MARGIN * float(np.max(np.abs(poles), initial=1.0)):
            raise Broken(
                f"eigenvalues of the linearised error with real parts up to {slowest:.4g} {equations.where}",
                "an error that decays, all real parts below zero" + MEANT,
            )


def _shrinks(equations: Equations) -> None:
    """An observer that jumps: the eigenvalues of a period, flow and jump."""
    z, q = equations.start(np.zeros(equations.plant.model.n)), equations.outputs
    kept, still = equations.places("estimate", "filter"), np.zeros(q)
    whole = np.eye(z.size)
    for _ in range(int(SETTLED)):
        if isinstance(equations.observer, ContinuousObserver):
            z, whole = _flown(equations, z)
        if isinstance(equations.observer, CorrectedObserver):
            z, jump = equations.evaluate(equations.correct, 0.0, z, still, still)
        else:
            z, jump = equations.evaluate(equations.leap, 0.0, z, still, still, still, PERIOD)
        z = z[:, 0]
    factors = np.linalg.eigvals((jump @ whole)[np.ix_(kept, kept)])
    if not np.all(np.isfinite(jump)):
        raise NotApplicable("its equations have no finite slope where the error is zero")
    largest = float(np.max(np.abs(factors), initial=0.0))
    if not largest < 1 - MARGIN:
        raise Broken(
            f"a linearised error that a period of {PERIOD:g} multiplies by up to {largest:.4g} {equations.where}",
            "an error that decays, a factor below 1" + MEANT.replace("e = C xhat - y", "C xhat - y"),
        )


def _flown(equations: Equations, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The states a period later, nothing measured, and how they depend on those before; by RK4."""
    if np.any(equations.evaluate(equations.drive, 0.0, z, np.zeros(equations.outputs))[0]):
        raise NotApplicable("both its flow and its jumps correct")
    steps = 20
    h, whole = PERIOD / steps, np.eye(z.size)

    def rate(at: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, A = equations.evaluate(equations.flow, 0.0, at, np.zeros(equations.outputs))
        return value[:, 0], A @ slopes

    for _ in range(steps):
        a, A = rate(z, whole)
        b, B = rate(z + h / 2 * a, whole + h / 2 * A)
        c, C = rate(z + h / 2 * b, whole + h / 2 * B)
        d, D = rate(z + h * c, whole + h * C)
        z, whole = z + h / 6 * (a + 2 * b + 2 * c + d), whole + h / 6 * (A + 2 * B + 2 * C + D)
    return z, whole


def _settled(equations: Equations) -> np.ndarray:
    """The estimate right, filters where they start, gains where they settle."""
    z = equations.start(np.zeros(equations.plant.model.n))
    gains, still = equations.places("gain"), np.zeros(equations.outputs)
    if not gains.size:
        return z

    def rate(_: float, values: np.ndarray) -> np.ndarray:
        at = z.copy()
        at[gains] = values
        return np.asarray(equations.evaluate(equations.flow, 0.0, at, still)[0][gains, 0])

    found = solve_ivp(rate, (0.0, SETTLED), z[gains], method="LSODA", rtol=1e-8, atol=1e-10)
    if not found.success or not np.all(np.isfinite(found.y[:, -1])):
        raise NotApplicable("its gains do not settle on a plant at rest")
    z[gains] = found.y[:, -1]
    return z


def _slopes(equations: Equations, z: np.ndarray) -> list[np.ndarray]:
    """The error's matrix where the error is zero; at a kink the two beside it."""
    kept = equations.places("estimate", "filter")
    aside = np.zeros(z.size)
    aside[equations.places("estimate")] = BESIDE

    def at(side: float) -> np.ndarray:
        e = np.full(equations.outputs, side * BESIDE)
        return np.asarray(equations.evaluate(equations.flow, 0.0, z + side * aside, e)[1][np.ix_(kept, kept)])

    right, *both = (at(side) for side in (0.0, -1.0, 1.0))
    if not np.all(np.isfinite(right)):
        raise NotApplicable("its equations have no finite slope where the error is zero")
    size = float(np.max(np.abs(right), initial=1e-300))
    kink = any(not float(np.max(np.abs(other - right), initial=0.0)) <= KINK * size for other in both)
    return both if kink else [right]
