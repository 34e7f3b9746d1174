"""How fast the error decays at theta = 1: its poles, and the Lyapunov function of the proofs."""

from __future__ import annotations

import numpy as np

from hgorun.analysis.convergence.lyapunov import MU
from hgorun.analysis.convergence.premises import dynamics_of, theta_of
from hgorun.analysis.finding import finding
from hgorun.analysis.subject import Subject
from hgorun.observers.eso import LinearExtendedStateObserver


def speed_of(subject: Subject) -> float:
    """What the error's matrix at theta = 1 is multiplied by: theta, or the bandwidth of ``eso``.

    Raises
    ------
    NoValue
        When it has neither.
    """
    if isinstance(subject.observer, LinearExtendedStateObserver):
        return float(subject.observer.omega_o)
    return theta_of(subject)


@finding(
    "eigenvalues of the error's matrix A~ at theta = 1, on chains without nonlinearity, filters included",
    group="poles",
    unit="1/time",
)
def poles(observer: Subject) -> np.ndarray:
    return dynamics_of(observer).lyapunov.poles


@finding("whether all `poles` have negative real parts", group="poles")
def hurwitz(observer: Subject) -> bool:
    return dynamics_of(observer).lyapunov.hurwitz


@finding(
    "beta = mu/(2 lambda_max(P)) with P A~ + A~^T P = -2 mu I, mu = 1: (3.23), (3.35)", group="decay", unit="1/time"
)
def beta(observer: Subject) -> float:
    return dynamics_of(observer).lyapunov.beta


@finding("chi = cond(P): (3.6)", group="decay")
def chi(observer: Subject) -> float:
    return dynamics_of(observer).lyapunov.chi


@finding("the mu of `beta` and `P`", group="decay", places=("json",), optional=True)
def mu(observer: Subject) -> float:
    _ = dynamics_of(observer).lyapunov.P  # there is one
    return MU


@finding("the Lyapunov matrix P of `beta` and `chi`", group="decay", places=("json",), optional=True)
def P(observer: Subject) -> np.ndarray:
    return dynamics_of(observer).lyapunov.P


@finding(
    "the decay rate of the error without delay", title="beta theta", places=("compare",), group="decay", optional=True
)
def beta_theta(observer: Subject) -> float:
    return dynamics_of(observer).lyapunov.beta * speed_of(observer)


@finding("the configured high gain; omega_o of `eso`, which is the same", group="theta", optional=True)
def theta(observer: Subject) -> float:
    return speed_of(observer)
