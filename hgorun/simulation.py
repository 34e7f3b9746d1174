"""Run an experiment: from its symbolic description to trajectories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.engine.methods import METHODS
from hgorun.engine.program import Program, Raw, Start, Tolerance
from hgorun.errors import Problem
from hgorun.experiment import Experiment
from hgorun.measurement.availability import evaluate
from hgorun.measurement.events import kinks
from hgorun.measurement.noise import continuous_noise
from hgorun.measurement.schedule import (
    build_plan,
    build_schedule,
    check_delays,
    find_channels,
)
from hgorun.metrics import Windows, measure
from hgorun.plant_run import PlantRun
from hgorun.result import Measurements, ObserverResult, Result
from hgorun.symbolic.parameters import Parameters
from hgorun.symbolic.system import Signal, build_system

_DEFAULT_RTOL, _DEFAULT_ATOL = 1e-8, 1e-10
_SEARCH_POINTS = (4_000, 200_000)  # least and most points in the search for kinks
_OVERLAP = 0.05  # of a step: delays shorter than that are followed inside the step


def simulate(
    experiment: Experiment, *, check_step: bool = False, progress: Callable[[float], None] | None = None
) -> Result:
    """Simulate the plant and all observers.

    Parameters
    ----------
    experiment : Experiment
    check_step : bool
        Run once more with half the step and report the largest difference as integration error.
    progress : callable, optional
        Told now and then which part of the run is done, 0 to 1.

    Returns
    -------
    Result

    Raises
    ------
    ConfigError
        When the configuration does not fit together.
    SimulationError
        When the plant diverges.
    """
    return prepare(experiment).simulate(check_step=check_step, progress=progress)


def prepare(experiment: Experiment) -> Run:
    """Check all that can be checked without running: models, schedules, observers, figures.

    Raises
    ------
    ConfigError
    """
    with experiment.located():
        run = Run(experiment)
        if experiment.blocks.figures:
            from hgorun.figures import check

            model = experiment.plant.model
            time = experiment.blocks.time
            check(experiment.blocks.figures, model.states, model.outputs, tuple(experiment.observers), (time.start, time.end))
        return run


def _difference(a: Result, b: Result) -> dict[str, float]:
    """Largest difference of two runs, for the plant and for each observer that did not diverge."""
    found = {"plant": float(np.max(np.abs(a.x - b.x)))}
    for label, observer in a.observers.items():
        gap = np.abs(observer.xhat - b.observers[label].xhat)
        found[label] = float(np.max(gap)) if np.all(np.isfinite(gap)) else float("inf")
    return found


class Run:
    """All that is decided before the first step, and the run itself."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment, self.blocks = experiment, experiment.blocks
        self.plant, self.forms = experiment.plant, experiment.forms
        self.time, self.solver = self.blocks.time, self.blocks.solver
        self.adaptive = self.solver.adaptive or (
            self.solver.method == "dopri5" and self.solver.step == "auto"
        )
        self.grid, _, _ = experiment.grid
        self.points = int(
            np.clip((self.time.end - self.time.start) / (self._given_step() or 1e-3), *_SEARCH_POINTS)
        )
        self.channels = find_channels(
            experiment.stretches, self.plant.model.outputs, self.time, self.blocks.seed, self._mean_square
        )
        self.smallest_delay, self.reach = check_delays(self.channels, self.points)
        self.parameters = Parameters()
        self.plant_symbol = self.parameters.add("plant", self.plant.parameters)
        t = self.plant.model.t
        self.signals = {
            (i, k): Signal(
                continuous_noise(s, t, self.parameters, f"noise.{channel.name}.{k}"),
                s.multiplicative,
                s.delay_symbol(t),
            )
            for i, channel in enumerate(self.channels)
            for k, s in enumerate(channel.stretches)
            if s.continuous
        }
        self.step = self._given_step() or self._automatic_step()
        self.schedule = build_schedule(self.channels, self.time, self._kinks(), self.step, self.points)
        self.system = build_system(
            self.plant,
            self.forms,
            experiment.observers,
            self.signals,
            self.schedule.variants,
            self.parameters,
            self.plant_symbol,
        )
        self._check_jumps()
        self._check_start()

    def simulate(
        self, *, check_step: bool = False, progress: Callable[[float], None] | None = None
    ) -> Result:
        """See :func:`simulate`."""
        result = self.result(self.execute(self.step, progress))
        if check_step and not self.adaptive:
            half = self.result(self.execute(self.step / 2, progress))
            result = replace(result, integration_error=_difference(result, half))
        return result

    @cached_property
    def program(self) -> Program:
        """Native code for the structure."""
        return Program(self.system.structure, self.solver.method, adaptive=self.adaptive)

    def _given_step(self) -> float | None:
        return None if self.solver.step == "auto" or self.adaptive else self.solver.step

    def _automatic_step(self) -> float:
        """From the fastest declared frequency and the fastest error dynamics.

        RK4 follows exp(-rate t) to about 1e-7 of a step when rate * step is 0.05, and a sinusoid to the same
        with 60 points a period; never fewer than 1,000 steps a run.
        """
        rates = [o.fastest_rate(self.forms[label]) for label, o in self.experiment.observers.items()]
        jacobian = ca.Function(
            "A",
            [self.plant.model.t, self.plant.model.x, self.plant.model.p],
            [
                ca.substitute(
                    ca.jacobian(self.plant.model.dynamics, self.plant.model.x),
                    self.plant.model.u,
                    self.plant.inputs,
                )
            ],
        )
        at_start = np.asarray(jacobian(self.time.start, self.plant.initial, self.plant.parameters).full())
        if np.all(np.isfinite(at_start)):
            rates.append(float(np.max(np.abs(np.linalg.eigvals(at_start)))))
        step = (self.time.end - self.time.start) / 1000
        if max(rates, default=0.0) > 0:
            step = min(step, 0.05 / max(rates))
        for stretches in self.experiment.stretches:
            for s in stretches:
                for item in s.noise if s.continuous else ():
                    for term in getattr(item, "terms", ()):
                        if term.omega != 0:
                            step = min(step, 2 * np.pi / abs(term.omega) / 60)
        return step

    def _plant_kinks(self) -> np.ndarray:
        model, u = self.plant.model, self.plant.inputs
        functions = [u, self.plant.disturbance]
        functions += [function(model.t, model.x, u, model.p) for function in (model.f, model.h)]
        return kinks(
            functions, model.t, model.p, self.plant.parameters, self.time.start, self.time.end, self.points
        )

    def _kinks(self) -> np.ndarray:
        t, p, values = self.plant.model.t, self.parameters.symbol, self.parameters.values
        found = [self._plant_kinks()]
        for (i, k), signal in self.signals.items():
            stretch = self.channels[i].stretches[k]
            functions = [signal.noise, signal.delay]
            found.append(kinks(functions, t, p, values, stretch.start, stretch.end, self.points))
        return np.concatenate(found)

    @cached_property
    def plant_alone(self) -> PlantRun:
        step = self._given_step() or self._automatic_step()
        return PlantRun(self.plant, self.time.start, self.time.end, self._plant_kinks(), step)

    def _mean_square(self, output: int) -> float:
        """Mean over the run of the noise-free output squared."""
        if self.plant.block.discretise:
            raise Problem(("plant", "discretise"), "snr_db needs a plant in continuous time; give std")
        _, integral = self.plant_alone.at(np.zeros(0))
        return float(integral[output]) / (self.time.end - self.time.start)

    def _check_jumps(self) -> None:
        """What is stepped at samples needs all outputs sampled, together and in time."""
        stepped = [("observers", b.label) for b in self.system.observers if b.observer.discrete]
        if self.plant.block.discretise:
            stepped.insert(0, ("plant", "discretise"))
        if not stepped:
            return
        first = self.channels[0].samples
        for channel in self.channels:
            samples = channel.samples
            if any(s.continuous for s in channel.stretches):
                raise Problem(stepped[0], f"this needs sampled outputs, but {channel.name} is continuous")
            if not np.array_equal(samples.arrival, first.arrival):
                raise Problem(stepped[0], "this needs all outputs sampled at the same times")
            if np.any(samples.taken < samples.arrival):
                raise Problem(stepped[0], "this takes samples without delay")

    def _check_start(self) -> None:
        """The right-hand sides must be numbers at the start."""
        s = self.system
        for flow in s.structure.flows.values():
            rates = np.asarray(flow(self.time.start, s.p, s.z0, np.zeros(s.structure.held)).full()).ravel()
            bad = np.flatnonzero(~np.isfinite(rates[: s.structure.plant_states]))
            if bad.size:
                name = self.plant.model.states[int(bad[0])]
                path = ("plant", "dynamics", name) if hasattr(self.plant.block, "dynamics") else ("plant",)
                raise Problem(
                    path, f"the right-hand side of {name} is not a finite number at the start of the run"
                )
            for b in s.observers:
                if not np.all(np.isfinite(rates[b.start : b.end])):
                    raise Problem(
                        ("observers", b.label, "initial"),
                        "the observer's right-hand side is not a finite number at the start of the run",
                    )
            break

    def execute(self, step: float, progress: Callable[[float], None] | None) -> Raw:
        """One run with a nominal step."""
        structure = self.system.structure
        longest = np.inf if self.adaptive else step
        if self.smallest_delay > _OVERLAP * step:
            longest = min(longest, self.smallest_delay)
        plan = build_plan(
            self.schedule,
            self.grid,
            structure,
            always_slope=bool(METHODS[self.solver.method].error),
            longest=np.inf if self.adaptive else longest,
            reach=self.reach,
        )
        bound = (1e6, 1e6) if self.solver.divergence is None else (self.solver.divergence, 0.0)
        start = Start(self.system.z0[:, None], self.system.p[:, None], bound)
        tolerance = None
        if self.adaptive:
            span = self.time.end - self.time.start
            most = min(self.solver.max_step or span, longest)
            first = min(1e-4 * span, most) if self.solver.step == "auto" else min(self.solver.step, most)
            tolerance = Tolerance(
                self.solver.rtol or _DEFAULT_RTOL, self.solver.atol or _DEFAULT_ATOL, most, first
            )
        return self.program.run(plan, start, tolerance, progress)

    def result(self, raw: Raw) -> Result:
        """Trajectories in the plant's coordinates, on the output grid, with metrics from the metric grid."""
        s, model, blocks = self.system, self.plant.model, self.blocks
        _, every_output, every_metric = self.experiment.grid
        rows = raw.rows[:, :, 0]
        u, y, *estimates = (
            np.asarray(v.full()).T for v in s.report(ca.DM(self.grid[None, :]), ca.DM(s.p), ca.DM(rows.T))
        )
        x = rows[:, : model.n]
        windows = Windows.of(blocks.metrics, self.time)
        metric = slice(None, None, every_metric)
        shown = slice(None, None, every_output)
        found = {}
        for j, (b, xhat) in enumerate(zip(s.observers, estimates, strict=True)):
            lost_at = float(raw.diverged[j, 0])
            found[b.label] = ObserverResult(
                b.observer.type,
                np.ascontiguousarray(xhat[shown]),
                {
                    name: st.shaped(rows[shown])
                    for name, st in b.states.items()
                    if name != "xhat" and st.size
                },
                {name: np.asarray(value).tolist() for name, value in b.design.items()},
                sum(st.size for name, st in b.states.items() if name != "alpha"),
                lost_at if np.isfinite(lost_at) else None,
                measure(self.grid[metric], x[metric], xhat[metric], windows),
            )
        embedded = None
        if METHODS[self.solver.method].error:
            blocks_of = {"plant": (0, model.n)} | {b.label: (b.start, b.stop) for b in s.observers}
            embedded = {label: float(np.max(raw.error[a:b])) for label, (a, b) in blocks_of.items()}
        units = {"time": self.time.unit, **self.plant.units}
        return Result(
            self.experiment.name,
            blocks.title,
            self.grid[shown].copy(),
            np.ascontiguousarray(x[shown]),
            u[shown].copy(),
            y[shown].copy(),
            model.states,
            model.inputs,
            model.outputs,
            units,
            self._measurements(raw, y[shown]),
            found,
            self.experiment.text,
            self.experiment.resolved_text(),
            blocks.seed,
            asdict(windows),
            embedded,
            blocks.figures,
        )

    def _measurements(self, raw: Raw, y: np.ndarray) -> Measurements:
        """Samples at their arrival, continuous outputs on the output grid."""
        grid = self.grid[:: self.experiment.grid[1]]
        parts, base = [], 0
        for i, c in enumerate(self.channels):
            count = c.samples.arrival.size
            times, taken = [c.samples.arrival], [c.samples.taken]
            values = [raw.measured[base : base + count, 0]]
            base += count
            on_grid = c.stretch_at(grid)
            for k, stretch in enumerate(c.stretches):
                if stretch.continuous:
                    mine = on_grid == k
                    t, truth = grid[mine], y[mine, i]
                    then = t
                    if not stretch.undelayed:
                        then = np.maximum(t - stretch.delay_at(t), self.time.start)
                        order = np.argsort(then, kind="stable")
                        late = np.empty_like(truth)
                        late[order] = self.plant_alone.at(then[order])[0][:, i]
                        truth = late
                    times.append(t)
                    taken.append(then)
                    values.append(self._noisy(i, k, t, truth))
            parts.append(tuple(np.concatenate(v) for v in (times, taken, values)))
        union = np.unique(np.concatenate([times for times, _, _ in parts]))
        taken_all, y_all = (np.full((union.size, len(parts)), np.nan) for _ in range(2))
        for i, (times, taken, values) in enumerate(parts):
            where = np.searchsorted(union, times)
            taken_all[where, i], y_all[where, i] = taken, values
        return Measurements(union, taken_all, y_all)

    def _noisy(self, i: int, k: int, t: np.ndarray, truth: np.ndarray) -> np.ndarray:
        """A continuous output with its noise."""
        signal = self.signals[i, k]
        f = ca.Function("v", [self.plant.model.t, self.parameters.symbol], [signal.noise])
        v = evaluate(f, t, self.parameters.values) + self.channels[i].random[k].held(t)
        return truth * (1 + v) if signal.multiplicative else truth + v
