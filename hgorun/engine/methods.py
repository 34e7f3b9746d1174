"""Explicit Runge-Kutta methods as tableaux."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """z + h * scale * sum_j weights[j] k_j: weights of one cost no multiplication."""

    weights: tuple[float, ...]
    scale: float = 1.0


@dataclass(frozen=True)
class Method:
    """An explicit Runge-Kutta method.

    Attributes
    ----------
    order : int
        Global order of convergence.
    c : tuple of float
        Stage times, as parts of the step.
    stages : tuple of Row
        From the second stage on.
    result : Row
        The step.
    error : tuple of float, optional
        Weights of an embedded error estimate, over the stages and the derivative at the end of the step.
    dense : tuple of float, optional
        Weights of the fifth coefficient of Dormand and Prince's continuous extension, same stages.
    """

    name: str
    order: int
    c: tuple[float, ...]
    stages: tuple[Row, ...]
    result: Row
    error: tuple[float, ...] = ()
    dense: tuple[float, ...] = ()


EULER = Method("euler", 1, (0.0,), (), Row((1.0,)))

RK4 = Method(
    "rk4",
    4,
    (0.0, 0.5, 0.5, 1.0),
    (Row((1.0,), 0.5), Row((0.0, 1.0), 0.5), Row((0.0, 0.0, 1.0))),
    Row((1.0, 2.0, 2.0, 1.0), 1 / 6),
)

# Dormand and Prince 1980; the continuous extension is Hairer, Norsett and Wanner's (II.6), fourth order.
DOPRI5 = Method(
    "dopri5",
    5,
    (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0),
    (
        Row((1 / 5,)),
        Row((3 / 40, 9 / 40)),
        Row((44 / 45, -56 / 15, 32 / 9)),
        Row((19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729)),
        Row((9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656)),
    ),
    Row((35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)),
    error=(71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
    dense=(
        -12715105075 / 11282082432,
        0.0,
        87487479700 / 32700410799,
        -10690763975 / 1880347072,
        701980252875 / 199316789632,
        -1453857185 / 822651844,
        69997945 / 29380423,
    ),
)

METHODS = {method.name: method for method in (EULER, RK4, DOPRI5)}
