"""Whether the run excites a plant that is observable under some inputs only."""

from __future__ import annotations

from dataclasses import asdict

from hgorun.analysis.excitation.excitation import Excitation
from hgorun.analysis.excitation.excitation import excitation as excitation_along
from hgorun.analysis.finding import Remarked, finding
from hgorun.analysis.subject import Subject, once


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
