"""How right the inverse of a KKL observer's map is."""

from __future__ import annotations

from hgorun.analysis.finding import finding
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.subject import Subject
from hgorun.observers.kkl_keys import KklObserver
from hgorun.observers.kkl_map import Polynomial
from hgorun.symbolic.drift import DriftForm


def _is_kkl(observer: Subject) -> bool:
    return isinstance(observer.observer, KklObserver)


def _inverse(observer: Subject) -> Polynomial:
    kkl, form = observer.observer, observer.form
    assert isinstance(kkl, KklObserver)
    assert isinstance(form, DriftForm)
    if kkl.is_exact(form):
        raise NoValue("the map of a linear plant is a matrix: its inverse is exact")
    return kkl.inverse(form)


@finding(
    "for `kkl`: root mean square of the inverse's error at points of the box that it was not fitted to",
    group="excitation",
    unit="state",
    optional=True,
    applies=_is_kkl,
)
def inverse_error(observer: Subject) -> dict[str, float]:
    return observer.by_state(_inverse(observer).held_out)


@finding(
    "for `kkl`: the same at the points that it was fitted to",
    group="excitation",
    unit="state",
    places=("json",),
    optional=True,
    applies=_is_kkl,
)
def inverse_error_fitted(observer: Subject) -> dict[str, float]:
    return observer.by_state(_inverse(observer).trained)


@finding(
    "for `kkl`: the largest coefficient of the inverse, of z divided by its standard deviation on the box; if it "
    "is large, noise and errors of the model are amplified",
    group="excitation",
    unit="state",
    optional=True,
    applies=_is_kkl,
)
def inverse_weight(observer: Subject) -> dict[str, float]:
    return observer.by_state(abs(_inverse(observer).W).max(axis=1))
