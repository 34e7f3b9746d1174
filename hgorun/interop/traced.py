"""Functions of a system of python-control followed by symbols, and compared with what the symbols give."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from hgorun.errors import ConfigError

if TYPE_CHECKING:
    from control import NonlinearIOSystem

_TRIES = 20  # places at which what was traced is compared with the function itself
_RTOL = 1e-9


class NotTraced(ConfigError):
    """A function that symbols cannot follow."""


class Traced(NamedTuple):
    """A system's right-hand sides and outputs as expressions of t, x, u and p."""

    arguments: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    dynamics: ca.SX
    output: ca.SX


def traced(package: ModuleType, system: NonlinearIOSystem, parameters: Mapping[str, float]) -> Traced:
    """A system as expressions, with some of its parameters as symbols p.

    Raises
    ------
    NotTraced
    """
    x, u = ca.SX.sym("x", system.nstates), ca.SX.sym("u", system.ninputs)
    t, p = ca.SX.sym("t"), ca.SX.sym("p", len(parameters))
    if isinstance(system, package.StateSpace):
        A, B, C, D = (ca.DM(np.atleast_2d(part)) for part in (system.A, system.B, system.C, system.D))
        return Traced((t, x, u, p), A @ x + B @ u, C @ x + D @ u)
    symbols = dict(system.params) | dict(zip(parameters, ca.vertsplit(p), strict=True))
    columns = [np.array(ca.vertsplit(part), dtype=object) if part.numel() else np.zeros(0) for part in (x, u)]
    found = []
    for what, function, count in (
        ("update", system.updfcn, system.nstates),
        ("output", system.outfcn, system.noutputs),
    ):
        if function is None:
            found.append(x)
            continue
        try:
            with warnings.catch_warnings():  # of CasADi, that functions of numpy give its own kind
                warnings.simplefilter("ignore")
                value = _column(function(t, *columns, symbols))
        except Exception as error:
            raise NotTraced(f"{system.name}: {_why(what, function, error)}") from error
        if value.numel() != count:
            raise NotTraced(f"{system.name}: the {what} function gives {value.numel()} numbers for {count}")
        _compare(system, what, function, ca.Function("traced", [t, x, u, p], [value]), parameters)
        found.append(value)
    return Traced((t, x, u, p), found[0], found[1])


def _column(value: object) -> ca.SX:
    """What a function returns, as a column."""
    if isinstance(value, ca.SX):
        return ca.vec(value)
    return ca.vertcat(*[ca.SX(part) for part in np.atleast_1d(np.array(value, dtype=object)).ravel()])


def _why(what: str, function: object, error: Exception) -> str:
    """Why a function could not be called with symbols, and where in it."""
    code = getattr(function, "__code__", None)
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if code is not None and frame.filename == code.co_filename]
    where = f" in line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
    reason = str(error).strip().splitlines()[0][:200] if str(error).strip() else type(error).__name__
    return (
        f"the {what} function cannot be followed by symbols{where}: {type(error).__name__}: {reason}. It has to "
        "be made of arithmetic and functions of numpy: no if, no comparison that decides, no math.sin, no tables"
    )


def _compare(
    system: NonlinearIOSystem, what: str, function: Any, traced: ca.Function, parameters: Mapping[str, float]
) -> None:
    """Refuse what gives other numbers than the function itself: it does something that symbols do not see."""
    random = np.random.default_rng(0)
    for _ in range(_TRIES):
        t, x, u = random.uniform(0, 2), random.uniform(0.1, 2, system.nstates), random.uniform(0.1, 2, system.ninputs)
        expected = np.asarray(function(t, x, u, dict(system.params)), dtype=float).ravel()
        found = np.asarray(traced(t, x, u, list(parameters.values()))).ravel()
        known = np.isfinite(expected)
        if np.any(known & np.isnan(found)):
            raise NotTraced(
                f"{system.name}: the {what} function turns symbols into numbers, as math.sin and float do: functions "
                "of numpy take symbols"
            )
        if not np.allclose(found[known], expected[known], rtol=_RTOL, atol=1e-12):
            raise NotTraced(
                f"{system.name}: the {what} function gives other numbers than its symbols: it decides by numbers, or "
                "by something else than t, x, u and its parameters"
            )
