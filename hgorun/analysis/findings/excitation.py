"""Whether the run excites a plant that is observable under some inputs only, and parameters that are estimated."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from hgorun.analysis.excitation.excitation import Excitation
from hgorun.analysis.excitation.excitation import excitation as excitation_along
from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.reasons import NoValue, require_estimate
from hgorun.analysis.subject import Subject, once
from hgorun.observers.adaptive import AdaptiveObserver
from hgorun.result.windows import points_in
from hgorun.symbolic.canonical import CanonicalForm


@once
def _excitation(observer: Subject) -> Excitation:
    return excitation_along(observer.run, observer.label, observer.result)


@finding("the largest delta of the excitation condition, (2.43), (3.86) or (3.101), along the run", group="excitation")
def excitation(observer: Subject) -> Remarked:
    seen = _excitation(observer)
    return Remarked(seen.delta, (f"excitation: {seen.words}",))


@finding("the time when the excitation is smallest", unit="time", group="excitation", optional=True)
def excitation_at(observer: Subject) -> float:
    return _excitation(observer).at


@finding(
    "details of `excitation`: horizon, weights of the states, intervals in which a state is hardly observable, "
    "eigenvalues of P or S",
    group="excitation",
    places=("json",),
    optional=True,
)
def excitation_details(observer: Subject) -> dict[str, object]:
    details = asdict(_excitation(observer))
    return {key: value for key, value in details.items() if key not in ("delta", "at")}


def _adapts(observer: Subject) -> bool:
    return isinstance(observer.observer, AdaptiveObserver)


@finding(
    "for `adaptive`: the smallest eigenvalue of the integral of Upsilon^T C^T C Upsilon over `metrics.window`, from "
    "the points of the output; 0 if a parameter, or a combination of parameters, is not observable",
    group="excitation",
    optional=True,
    applies=_adapts,
)
def parameter_excitation(observer: Subject) -> float:
    form = observer.form
    assert isinstance(form, CanonicalForm)
    require_estimate(observer.found)
    result = observer.result
    window = points_in(result.time, result.windows["steady"])
    time = result.time[window]
    if time.size < 2:
        raise NoValue("metrics.window has no two points of the output")
    Upsilon = np.asarray(observer.found.internal["Upsilon"][window]).reshape(time.size, form.plant.n, -1)
    seen = Upsilon[:, form.heads]
    return float(np.linalg.eigvalsh(np.trapezoid(np.einsum("tqi,tqj->tij", seen, seen), time, axis=0))[0])
