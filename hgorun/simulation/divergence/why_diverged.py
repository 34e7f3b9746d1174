"""Why an estimate has left the truth, where that is plain to see."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from hgorun.engine.memory import Raw
from hgorun.observers.base import ContinuousObserver
from hgorun.observers.capabilities import NotLinear, SlidingMode, Speed
from hgorun.result.records.status import Verdict
from hgorun.simulation.checks.far_start import far_start
from hgorun.simulation.divergence.too_large import too_large
from hgorun.simulation.error_dynamics.slopes import at_truth, slopes
from hgorun.simulation.error_dynamics.timing import below
from hgorun.simulation.passes.loss import Again, ceased, step_at
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.system.observer_block import ObserverBlock
from hgorun.symbolic.evaluate import Floats, at, evaluate
from hgorun.symbolic.forms import ChosenChains

_GROWS = 1e-6  # of the fastest rate: a smaller one may be rounding of zero
_HALVINGS = 40  # of the time between the last point of the grid and a loss
_STABLE = 4.0  # the largest step of explicit methods, times the fastest rate, and somewhat more
_SAFE = 2.5  # such a step with which they are stable, whatever the phase of the eigenvalues of usual gains
_NEARLY, _EXPLODED = 1e-3, 1e3  # of the determinant at the start; times the size of the states


def with_reason(
    run: PreparedRun, raw: Raw, j: int, verdict: Verdict, again: Again, *, controlled: bool = False
) -> Verdict:
    """What is said of an observer that has diverged, with the reason where it is one of those that are looked for.

    Parameters
    ----------
    raw : Raw
        A run in which the observer was followed until its numbers overflowed.
    again : Again
        That run once more.
    controlled : bool
        Whether its steps are those of error control, so that none was too long.
    """
    if run.closed:
        return verdict  # where the plant goes depends on the estimate
    said = verdict.reason
    found = None if said else _unstable_gain(run, raw, run.observers[j])
    found = (
        found or too_large(run, raw, j) or far_start(run, raw, j) or (None if said else singular(run, raw, j, again))
    )
    if found is None and not said and not controlled:
        found = _too_fast(run, raw, j, again)
    known = [reason for reason in (said, found) if reason]
    return replace(verdict, reason="; ".join(known) or None)


def no_step(run: PreparedRun, raw: Raw, verdicts: Mapping[str, Verdict], again: Again) -> dict[str, Verdict]:
    """The verdicts, where controlled steps have given observers up and nothing else is known of them."""
    places = {block.label: j for j, block in enumerate(run.observers)}
    return {label: given_up(run, raw, places[label], verdict, again) for label, verdict in verdicts.items()}


def given_up(run: PreparedRun, raw: Raw, j: int, verdict: Verdict, again: Again) -> Verdict:
    """What is said of an observer that controlled steps have given up, where nothing else is known of it.

    Where an operation is undefined there that is the reason, and the estimate has not diverged before.
    """
    lost = float(raw.diverged[j, 0])
    if verdict.status != "diverged" or verdict.reason is not None or not np.isfinite(lost):
        return verdict
    what = ceased(run, again, j, lost)
    if what is not None:
        return Verdict("undefined", verdict.at, what)
    when = f"{run.origin + lost:.6g}"
    since = when if verdict.at is None else f"{run.origin + verdict.at:.6g}"
    why = "its equations are singular there, its gains too large, or the tolerance is out of reach"
    if since == when:
        return replace(verdict, reason=f"no step is small enough at t = {when}: {why}")
    left = f"its estimate leaves the truth for good at t = {since}, and from t = {when} on"
    return replace(verdict, reason=f"{left} no step is small enough: {why}")


def singular(run: PreparedRun, raw: Raw, j: int, again: Again) -> str | None:
    """When J, through whose inverse a constant gain corrects, became singular: its determinant changed its sign.

    Where the estimate is lost before its own determinant shows that, that of the true state does, or what becomes of
    the determinant between the last point of the grid and the loss: infinite corrections may hold an estimate where J
    is singular, and no step brings it across.
    """
    block = run.observers[j]
    along = determinants(run, block)
    if along is None:
        return None
    estimate = _finite(_estimate(block, raw))
    truth = raw.rows[: len(estimate) + 1, run.structure.truths[j], 0]
    for states in (estimate, truth):
        when = _sign_changes(run.grid, along(states))
        if when is not None:
            return _singular_at(run, when)
    lost = float(raw.diverged[j, 0])
    if not (np.isfinite(lost) and 0 < len(estimate) < len(run.grid)):
        return None
    last = float(run.grid[len(estimate) - 1])
    times = np.unique(np.append(last, lost - (lost - last) * 2.0 ** -np.arange(_HALVINGS)))
    closer = _finite(_estimate(block, again.integrate(again.plan().with_grid(times), [j])))
    values = np.concatenate([along(estimate[:1]), along(closer)])
    when = _sign_changes(np.append(times[0], times), values)
    if when is not None:
        return _singular_at(run, when)
    far = np.max(np.abs(closer)) > _EXPLODED * max(np.max(np.abs(estimate[:1])), np.max(np.abs(truth)))
    return None if far or abs(values[-1]) > _NEARLY * abs(values[0]) else _singular_at(run, lost)


def determinants(run: PreparedRun, block: ObserverBlock) -> Callable[[Floats], Floats] | None:
    """The determinant of J at states, shape (N, n) to (N,); None of an observer that does not invert J."""
    form = block.form
    if not isinstance(form, ChosenChains) or block.canonical or form.map == "chain":
        return None
    if sum(form.chains) != form.plant.n:  # corrected by least squares
        return None
    x, p = form.plant.x, form.plant.p
    determinant = ca.Function("det", [x, p], [ca.det(form.jacobian)])
    return lambda states: evaluate(determinant, states, run.plant.parameters)[0].ravel()


def _too_fast(run: PreparedRun, raw: Raw, j: int, again: Again) -> str | None:
    """That its gains make it faster than the steps can be; they have been shortened as far as may be."""
    block, lost = run.observers[j], float(raw.diverged[j, 0])
    rate = block.observer.fastest_rate(block.form) or 0.0
    if not (np.isfinite(lost) and rate > 0):
        return None
    step = step_at(again.plan(), lost)
    if rate * step <= _STABLE:
        return None
    return (
        f"steps of {step:.3g} are too long for its gains, which make it as fast as {rate:.3g} per time unit, and many "
        f"more would be needed than can be made: give {_slower(block, _SAFE / step)}"
    )


def _slower(block: ObserverBlock, rate: float) -> str:
    """What to give so that an observer is no faster than a rate: a value of the key that sets its largest speed."""
    observer = block.observer
    keys = observer.speed_keys if isinstance(observer, Speed) else ()
    if isinstance(observer, Speed) and keys:
        key, *others = keys
        value = float(observer.speed_of(key) * rate / observer.fastest_rate(block.form))
        slower = observer.model_copy(update={key: value})
        if value > 0 and slower.fastest_rate(block.form) <= rate * (1 + 1e-9):
            beside = [other for other in others if observer.speed_of(other) >= value]
            return f"{key} of at most {below(value)}" + "".join(f" with {other} below it" for other in beside)
    return "smaller gains"


def _estimate(block: ObserverBlock, raw: Raw) -> Floats:
    """The rows of its estimate, shape (N, n)."""
    xhat = block.states["xhat"]
    return raw.rows[:, xhat.start : xhat.start + xhat.size, 0]


def _finite(rows: Floats) -> Floats:
    """The rows that are numbers."""
    return rows[np.all(np.isfinite(rows), axis=1)]


def _sign_changes(times: Floats, values: Floats) -> float | None:
    """When values change their sign for the first time, as far as a straight line tells; None where they are none."""
    with np.errstate(invalid="ignore"):
        changed = np.flatnonzero(np.sign(values) != np.sign(values[:1]))
    if not changed.size or not changed[0]:  # none, or no number to begin with
        return None
    k = int(changed[0])
    return float(np.interp(0.0, *_rising(values[k - 1 : k + 1], times[k - 1 : k + 1])))


def _singular_at(run: PreparedRun, when: float) -> str:
    return f"J became singular at t = {run.origin + when:.6g}"


def _rising(values: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Two points in ascending order of their values."""
    order = np.argsort(values)
    return values[order], times[order]


def _unstable_gain(run: PreparedRun, raw: Raw, block: ObserverBlock) -> str | None:
    """Small errors grow with a continuous output at the start, in the middle and at the end of the run.

    Not said of gains that are states, which follow the plant, and of what jumps, looks back or has no linearisation.
    """
    observer = block.observer
    if not isinstance(observer, ContinuousObserver) or isinstance(observer, (NotLinear, SlidingMode)) or block.recalled:
        return None
    if "gain" in observer.roles(block.form).values():
        return None
    count, linear, rates = len(run.grid), slopes(run, block), list[float]()
    for row in (0, count // 2, count - 1):
        rates.append(_rate(run, block, linear, row, raw.rows[row, : run.plant.model.n, 0]))
        if rates[-1] <= 0:
            return None
    return f"the gain is unstable on this plant: small errors grow like exp({min(rates):.3g} t)"


def _rate(run: PreparedRun, block: ObserverBlock, linear: ca.Function, row: int, x: Floats) -> float:
    """The largest real part of the error dynamics' eigenvalues at a true state; 0 where it is small or not known."""
    try:
        z = at_truth(run, block, x)
    except ValueError:  # the coordinates do not exist there
        return 0.0
    found = at(linear, run.grid[row], run.numbers.p, z, np.zeros(len(run.plant.model.outputs)))
    A0, E, H = (values.reshape(linear.size_out(i)) for i, values in enumerate(found[:3]))
    matrix = A0 + E @ H  # of the observer's own states, its innovation being C xhat - y
    if not np.all(np.isfinite(matrix)):
        return 0.0
    eigenvalues = np.linalg.eigvals(matrix)
    largest = float(np.max(eigenvalues.real))
    return largest if largest > _GROWS * float(np.max(np.abs(eigenvalues))) else 0.0
