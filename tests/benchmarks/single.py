"""Single runs of hgorun and of plain C (single.c): the cases, whose numbers agree."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import academic
import numpy as np
import yaml

import hgorun
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.simulate import prepare

Run = Callable[[], np.ndarray]  # the final state

_OMEGAS = "omega: 0.95*pi/0.25", "omega: 0.97*pi/0.25"
_CHAIN = """
time: {end: 40, output_step: 0.4}
plant:
  type: integrator_chain
  n: 8
  phi: u - x1
  inputs: {u: sin(t)}
  initial: {x1: 1, x2: 0, x3: 0, x4: 0, x5: 0, x6: 0, x7: 0, x8: 0}
observers: {H: {type: shgo, theta: 2}}
solver: {method: rk4, step: 5.0e-4}
"""
_CONTOIS = """
time: {end: 60, output_step: 0.6}
plant:
  type: contois
  parameters: {mu: 1.064, k_c: 4.39, s_in: 20}
  inputs: {D: mu*(0.75 + sin(t)/4)}
  initial: {x1: 1.5, x2: 15}
measurement: {noise: [{type: sinusoids, terms: [{amplitude: 0.5, W1}, {amplitude: 0.5, W2}]}]}
observers:
  S: {type: shgo, theta: 1, initial: {x1: 1, x2: 14}}
  F1: {type: fhgo2, r: 1, theta: 2, initial: {x1: 1, x2: 14}}
  F2: {type: fhgo2, r: 2, theta: 2, initial: {x1: 1, x2: 14}}
  F3: {type: fhgo2, r: 3, theta: 2, initial: {x1: 1, x2: 14}}
solver: {method: rk4, step: 1.0e-3}
""".replace("W1", _OMEGAS[0]).replace("W2", _OMEGAS[1])
_VAN_DER_POL = """
time: {end: 100, output_step: 1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}
MEASUREMENT
observers: {H: {type: shgo, theta: 2}}
solver: {method: rk4, step: 1.0e-3}
"""
_LATE = _VAN_DER_POL.replace("MEASUREMENT", "measurement: {delay: 0.15025}")
_WAVES = [0.5, 0.95 * np.pi / 0.25, 0.97 * np.pi / 0.25]


@dataclass(frozen=True)
class Case:
    """One case in hgorun and in C.

    Attributes
    ----------
    name, text : str
        How it is called, and its configuration.
    function : str
        In single.c.
    parameters : tuple of float
        What that takes.
    order : tuple of int
        Of each of its states the place among hgorun's.
    bar : float
        What the time of a run may be, in units of C's.
    agreement : float
        Of the final states, relative. hgorun's steps end where a delay brings an event back, and those of C do not.
    """

    name: str
    text: str
    function: str
    parameters: tuple[float, ...]
    order: tuple[int, ...]
    bar: float
    agreement: float = 1e-9


# FHGO II: hgorun writes the estimate before the filter, and C the other way round
_CONTOIS_ORDER = (0, 1, 2, 3, 6, 4, 5, 9, 10, 7, 8, 13, 14, 15, 11, 12)
CASES = (
    Case("chain, n = 8", _CHAIN, "chain", (2.0,), tuple(range(16)), 0.28),
    Case("Contois, 4 observers", _CONTOIS, "contois", (1.064, 4.39, 20.0, *_WAVES, 1.0, 2.0), _CONTOIS_ORDER, 0.85),
    Case("Van der Pol", _VAN_DER_POL.replace("MEASUREMENT", ""), "van_der_pol", (0.5, 2.0), (0, 1, 2, 3), 0.9),
    Case("Van der Pol, measured late", _LATE, "late", (0.5, 2.0, 0.15025), (0, 1, 2, 3, 4), 1.2, 1e-7),
)


def ours(case: Case, folder: Path) -> tuple[Run, np.ndarray]:
    """hgorun's run without what comes before and after the integration, and where it starts."""
    path = folder / f"{case.function}.yaml"
    path.write_text(case.text, encoding="utf-8")
    run = prepare(hgorun.load(path))
    how = as_given(run)
    program = run.structure.program(how.method)
    plan, start = plan_of(run, how)
    order = list(case.order)
    return lambda: program.run(plan, start).rows[-1, order, 0], run.numbers.z0[order]


def library(folder: Path) -> ctypes.CDLL:
    """The C functions, compiled into a folder; there has to be a compiler."""
    command, target = academic.compiler(), folder / "single.so"
    assert command is not None
    options = ["-O3", "-march=native", "-shared", "-fPIC"]
    subprocess.run([command, *options, "-o", target, Path(__file__).with_suffix(".c"), "-lm"], check=True)
    return ctypes.CDLL(str(target))


def theirs(case: Case, compiled: ctypes.CDLL, z0: np.ndarray) -> Run:
    """The run in C."""
    function, pointer = getattr(compiled, case.function), ctypes.c_void_p
    function.restype = None
    function.argtypes = [ctypes.c_double, ctypes.c_long, ctypes.c_long, pointer, pointer, pointer]
    blocks = yaml.safe_load(case.text)
    step = blocks["solver"]["step"]
    steps = round(blocks["time"]["end"] / step)
    parameters, rows = np.array(case.parameters), np.empty((101, z0.size))
    start = np.ascontiguousarray(z0)
    call = partial(function, step, steps, steps // 100, start.ctypes.data, parameters.ctypes.data, rows.ctypes.data)

    def run(kept: tuple[np.ndarray, ...] = (start, parameters)) -> np.ndarray:
        call()
        return rows[-1]

    return run


def compared(folder: Path) -> Iterator[tuple[Case, Run, Run]]:
    """Every case, its run in hgorun and that in C."""
    compiled = library(folder)
    for case in CASES:
        run, z0 = ours(case, folder)
        yield case, run, theirs(case, compiled, z0)
