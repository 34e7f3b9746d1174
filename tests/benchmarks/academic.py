"""The benchmark's case: the academic plant with an FHGO II for plants that are not uniformly observable.

23 states: plant 3, estimate 3, filter 2, U 2 x 3, P 3 x 3. The same equations stand here three times: as a
configuration (academic.yaml) and an observer class, the way somebody outside the package writes one; in C
(academic.c); and in numpy for scipy.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
from pydantic import Field

import hgorun
from hgorun.engine.layout import ACTION_WORDS
from hgorun.engine.memory import Start
from hgorun.engine.plan import Plan
from hgorun.observers.base import ContinuousObserver, Flow, observer
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.matrices import A, B, C, hurwitz_gain
from hgorun.symbolic.symbols import Symbols
from hgorun.symbolic.triangular import TriangularCopy, TriangularForm, triangular_form

Run = Callable[[Plan], np.ndarray]

END, STEPS, ROWS = 40.0, 80_000, 400
THETA = 5.0
NOISE = (0.25, 387.0, 0.5, 987.0)  # amplitude and frequency, twice


@observer("benchmark_fhgo2_nuos")
class ReducedRiccatiObserver(ContinuousObserver[TriangularForm, TriangularCopy]):
    """Filtered high-gain observer FHGO II with the reduced Riccati gain, for triangular plants.

    With F the superdiagonal of df/dx at xhat, e the innovation and K_n = P U^T C_r^T, K_r = b + U K_n,

        eta'  = theta ((A_r - K_r C_r) eta + B_r e)
        xhat' = f(xhat, u) - theta Delta_n^-1(theta) K_n eta_1
        U'    = theta ((A_r - b C_r) U - U F + B_r C_n)
        P'    = theta (P + F P + P F^T - K_n K_n^T)

    P is kept whole here, as in the C, so that both integrate the same 23 states.
    """

    reference = "Robles Magdaleno 2023, (3.97)-(3.103), (3.133)"
    form = staticmethod(triangular_form)

    theta: float = Field(gt=0, description="high gain theta > 0")
    r: int = Field(default=1, ge=1, description="order of the filter, r >= 1")

    def design(self, form: TriangularForm) -> dict[str, np.ndarray]:
        return {"theta": np.array(self.theta), "b": hurwitz_gain(self.r, -1.0)}

    def states(self, form: TriangularForm) -> dict[str, np.ndarray]:
        return {"eta": np.zeros(self.r), "U": np.zeros((self.r, form.n)), "P": np.eye(form.n)}

    def equations(self, plant: TriangularCopy, s: Symbols, e: ca.SX, k: Symbols) -> Flow:
        r, F = self.r, plant.F(s.xhat)
        K_n = s.P @ s.U.T @ C(r).T
        K_r = k.b + s.U @ K_n
        FP = F @ s.P
        kappa = k.theta * plant.inv_Delta(k.theta) @ K_n * s.eta[0]
        return Flow(
            {
                "eta": k.theta * ((A(r) - K_r @ C(r)) @ s.eta + B(r) * e),
                "xhat": plant.copy(s.xhat) - kappa,
                "U": k.theta * ((A(r) - k.b @ C(r)) @ s.U - s.U @ F + B(r) @ plant.C),
                # FP + FP^T is symmetric to the last bit, and so P stays
                "P": k.theta * (s.P + (FP + FP.T) - K_n @ K_n.T),
            },
            correction=plant.measured(kappa),
        )


def build() -> PreparedRun:
    """Plant, noise and observer as the system that ``hgorun.simulate`` runs."""
    return prepare(hgorun.load(Path(__file__).with_suffix(".yaml")))


def plan(end: float = END, steps: int = STEPS, rows: int = ROWS) -> Plan:
    """One segment from 0 to ``end``, the output at ``rows`` equal distances and at the start."""
    nothing = np.zeros(0)
    return Plan(
        spans=np.array([[0.0, end, 0.0, end]]),
        counts=np.array([[steps, 0, steps, 0, 0, 0, 1]]),
        actions=np.zeros((0, ACTION_WORDS), dtype=np.int64),
        grid=np.linspace(0, end, rows + 1),
        slots=0,
        gain=nothing,
        bias=nothing,
        holds=nothing,
    )


def native(run: PreparedRun, *, lanes: int = 1) -> Callable[[Plan], np.ndarray]:
    """hgorun's engine: from a plan to rows of states, shape (points, 23, lanes)."""
    program = run.structure.program("rk4", lanes=lanes)
    start = Start(np.repeat(run.numbers.z0[:, None], lanes, axis=1), np.repeat(run.numbers.p[:, None], lanes, axis=1))
    return lambda plan: program.run(plan, start).rows


def compiler() -> str | None:
    """The C compiler, if there is one."""
    return shutil.which(os.environ.get("CC", "gcc")) or shutil.which("cc")


def compiled(folder: Path, *flags: str) -> Callable[[Plan, np.ndarray], np.ndarray]:
    """The C program, compiled into a folder: from a plan and an initial state to rows of states."""
    command = compiler()
    assert command is not None
    library = folder / f"academic{''.join(flags)}.so"
    source = Path(__file__).with_suffix(".c")
    options = ["-O3", "-march=native", *flags, "-shared", "-fPIC"]
    subprocess.run([command, *options, "-o", library, source, "-lm"], check=True)
    run = ctypes.CDLL(str(library)).run
    run.restype, pointer = None, ctypes.c_void_p
    run.argtypes = [ctypes.c_double, ctypes.c_double, ctypes.c_long, ctypes.c_long, pointer, pointer, pointer]
    parameters = np.array([THETA, *NOISE])

    def call(plan: Plan, z0: np.ndarray) -> np.ndarray:
        steps, end, count = plan.steps, plan.spans[0, 1], plan.grid.size
        z, rows = z0.copy(), np.empty((count, z0.size))
        every = steps // (count - 1)
        run(0.0, end / steps, steps, every, z.ctypes.data, parameters.ctypes.data, rows.ctypes.data)
        return rows

    return call


def python_flow(t: float, z: np.ndarray) -> np.ndarray:
    """The right-hand side as one writes it for scipy: numpy, in the notation of the equations."""
    x, w = z[:3], z[3:]
    dx = _f(t, x)
    dx[2] += 0.1 * np.sin(0.1 * t)
    a1, omega1, a2, omega2 = NOISE
    y = x[0] + a1 * np.sin(omega1 * t) + a2 * np.sin(omega2 * t)
    return np.concatenate([dx, _observer(t, w, y)])


def _F(t: float) -> np.ndarray:
    return np.array([[0, np.sin(0.5 * t), 0], [0, 0, np.sin(2.7 * t)], [0, 0, 0]])


def _f(t: float, x: np.ndarray) -> np.ndarray:
    coupling = np.tanh(x[0] * x[1])
    return _F(t) @ x - 0.1 * x + np.array([0, coupling, coupling + 5 * np.sin(0.5 * np.pi * t)])


def _observer(t: float, w: np.ndarray, y: float) -> np.ndarray:
    xhat, eta, U, P = w[:3], w[3:5], w[5:11].reshape(2, 3), w[11:].reshape(3, 3)
    F = _F(t)
    K_n = P @ U[0]
    K_r = _b + U @ K_n
    FP = F @ P
    dxhat = _f(t, xhat) - THETA ** np.arange(1, 4) * K_n * eta[0]
    deta = THETA * (_A @ eta - K_r * eta[0] + _B * (xhat[0] - y))
    dU = THETA * (_A @ U - np.outer(_b, U[0]) - U @ F + np.outer(_B, _C))
    dP = THETA * (P + (FP + FP.T) - np.outer(K_n, K_n))
    return np.concatenate([dxhat, deta, dU.ravel(), dP.ravel()])


_A, _B, _C = np.eye(2, k=1), np.array([0.0, 1.0]), np.array([1.0, 0.0, 0.0])
_b = np.array([2.0, 1.0])
