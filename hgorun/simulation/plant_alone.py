"""The plant alone, for what has to be known of it before or beside the observers' run."""

from __future__ import annotations

import casadi as ca
import numpy as np

from hgorun.engine.layout import Structure
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program, Start
from hgorun.plants.build import BuiltPlant
from hgorun.simulation.engine_tables import count_steps, in_pieces


class PlantRun:
    """x(t) and the integral of y^2, by RK4 with steps that land on the kinks.

    Parameters
    ----------
    plant : BuiltPlant
    start, end : float
    events : ndarray
        Kinks of the inputs and disturbances.
    step : float
    """

    def __init__(self, plant: BuiltPlant, start: float, end: float, events: np.ndarray, step: float) -> None:
        self.plant, self.start, self.end = plant, start, end
        model = plant.model
        self.n, self.q = model.n, len(model.outputs)
        z, w = ca.SX.sym("z", self.n + self.q), ca.SX.sym("w", 0)
        x = z[: self.n]
        y = model.h(model.t, x, plant.inputs, model.p)
        dx = model.f(model.t, x, plant.inputs, model.p) + plant.disturbance
        arguments = [model.t, model.p, z, w]
        flow = ca.Function("flow", arguments, [ca.densify(ca.cse(ca.vertcat(dx, y * y)))])
        nothing = ca.Function("nothing", arguments, [ca.SX(0, 1)])
        self._structure = Structure(
            self.n + self.q, self.n, 0, model.p.numel(), 0, 0, False, (), {(): flow}, {}, nothing, nothing
        )
        self._output = ca.Function("y", [model.t, model.p, z], [y])
        self._program = Program(self._structure, "rk4")
        inside = events[(events > start) & (events < end)]
        self._ends = np.concatenate([[start], inside, [end]])
        self._step = step

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (len(times), q) and the integral of their squares (q,) to the end; times increase."""
        gaps = np.diff(self._ends)
        steps = count_steps(gaps, self._step)
        zero = np.zeros_like(steps)
        spans = np.column_stack([self._ends[:-1], self._ends[1:]] * 2)
        inward = 4 * np.spacing(np.maximum(np.abs(self._ends), self._step))
        spans[1:, 2] += inward[1:-1]
        spans[:-1, 3] -= inward[1:-1]
        counts = np.column_stack([steps, zero, steps, zero, zero, zero, zero + 1])
        spans, counts = in_pieces(spans, counts)
        nothing = np.zeros(0)
        plan = Plan(
            spans,
            counts,
            np.zeros((0, 5), dtype=np.int64),
            np.append(times, self.end),
            0,
            nothing,
            nothing,
            nothing,
        )
        z0 = np.concatenate([self.plant.initial, np.zeros(self.q)])
        raw = self._program.run(plan, Start(z0[:, None], self.plant.parameters[:, None]))
        rows = raw.rows[:, :, 0]
        y = self._output(ca.DM(plan.grid[None, :]), ca.DM(self.plant.parameters), ca.DM(rows.T))
        return np.asarray(y.full()).T[:-1].copy(), rows[-1, self.n :].copy()
