"""All that is decided before the first step of a run, and the run itself."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from hgorun.engine.layout import OUTPUT, PREVIOUS
from hgorun.engine.methods import METHODS
from hgorun.engine.program import Program, Raw, Start, Tolerance, history_bytes, history_pieces
from hgorun.errors import Problem
from hgorun.measurement.availability import Stretch
from hgorun.measurement.events import kinks
from hgorun.measurement.schedule import build_schedule, check_delays, continuous_delays, find_channels
from hgorun.observers.base import SampledObserver, SampleSchedule
from hgorun.simulation.engine_tables import build_plan, count_steps
from hgorun.simulation.experiment import Experiment
from hgorun.simulation.plant_alone import PlantRun
from hgorun.simulation.system import Signal, build_system
from hgorun.symbolic.parameters import Parameters

_DEFAULT_RTOL, _DEFAULT_ATOL = 1e-8, 1e-10
_SEARCH_POINTS = (4_000, 200_000)  # least and most points in the search for kinks
_OVERLAP = 0.05  # of a step: delays shorter than that are followed inside the step


class Run:
    """All that is decided before the first step, and the run itself."""

    def __init__(self, experiment: Experiment) -> None:
        self.experiment, self.blocks = experiment, experiment.blocks
        self.plant, self.forms = experiment.plant, experiment.forms
        self.time, self.solver = self.blocks.time, self.blocks.solver
        self.adaptive = self.solver.adaptive or (self.solver.method == "dopri5" and self.solver.step == "auto")
        self.grid, _, _ = experiment.grid
        self.points = int(np.clip((self.time.end - self.time.start) / (self._given_step() or 1e-3), *_SEARCH_POINTS))
        self.channels = find_channels(
            experiment.stretches, self.plant.model.outputs, self.time, self.blocks.seed, self._mean_square
        )
        self.smallest_delay, self.reach = check_delays(self.channels, self.points)
        self.parameters = Parameters()
        self.plant_symbol = self.parameters.add("plant", self.plant.parameters)
        t = self.plant.model.t
        self.signals = {
            (i, k): Signal(
                channel.noise[k].symbol(t, self.parameters, f"noise.{channel.name}.{k}"),
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
        self._check_memory()
        self._check_jumps()
        self._check_start()

    @cached_property
    def program(self) -> Program:
        """Native code for the structure."""
        return Program(self.system.structure, self.solver.method, adaptive=self.adaptive)

    def _given_step(self) -> float | None:
        return None if self.solver.step == "auto" or self.adaptive else self.solver.step

    def _automatic_step(self) -> float:
        """From the fastest declared frequency and the fastest error dynamics.

        RK4 follows exp(-rate t) to about 1e-7 of a step when rate * step is 0.05, and a sinusoid to the same
        with 60 points a period; never fewer than 1,000 steps a run. Euler takes 100 times as many.
        """
        rates = []
        for label, observer in self.experiment.observers.items():
            try:
                rates.append(observer.fastest_rate(self.forms[label]))
            except Problem as problem:
                raise Problem(("observers", label, *problem.path), problem.message) from problem
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
                fastest = s.fastest() if s.continuous else 0.0
                if fastest > 0:
                    step = min(step, 2 * np.pi / fastest / 60)
        return step / 100 if self.solver.method == "euler" else step

    def _plant_kinks(self) -> np.ndarray:
        model, u = self.plant.model, self.plant.inputs
        functions = [u, self.plant.disturbance]
        functions += [function(model.t, model.x, u, model.p) for function in (model.f, model.h)]
        return kinks(functions, model.t, model.p, self.plant.parameters, self.time.start, self.time.end, self.points)

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

    def _check_memory(self) -> None:
        """The output must fit, now that its width is known."""
        size = self.grid.size * (self.system.structure.states + 1) * 8
        if size > self.time.max_memory:
            raise Problem(
                ("time", "output_step"),
                f"{self.grid.size:.4g} output points of {self.system.structure.states} states take "
                f"{size / 2**30:.3g} GiB; time.max_memory allows {self.time.max_memory / 2**30:.3g} GiB",
            )

        self._check_steps(self.step)

    def _longest(self, step: float) -> float:
        """The longest step: no longer than the delays, unless they are very short."""
        longest = np.inf if self.adaptive else step
        return min(longest, self.smallest_delay) if self.smallest_delay > _OVERLAP * step else longest

    def _check_steps(self, step: float) -> None:
        """There must be time for all steps, and memory for those that a continuous delay spans."""
        structure, events = self.system.structure, self.schedule.events
        if self.adaptive:
            count_steps(np.diff(events), self.solver.max_step or np.inf, "max_step")
        steps = None if self.adaptive else count_steps(np.diff(events), self._longest(step))
        if not structure.remembers:
            return
        pieces = history_pieces(np.column_stack([events[:-1], events[1:]]), steps, self.reach)
        size = history_bytes(structure, pieces)
        if size > self.time.max_memory:
            late = max(continuous_delays(self.channels), key=self._longest_delay)
            raise Problem(
                late.paths["delay"],
                f"with steps of {self._longest(step):.3g} the history of a delay of {self.reach:.3g} takes "
                f"{size / 2**30:.3g} GiB; time.max_memory allows {self.time.max_memory / 2**30:.3g} GiB",
            )

    def _longest_delay(self, stretch: Stretch) -> float:
        return float(stretch.delay_at(np.linspace(stretch.start, stretch.end, self.points)).max())

    def _check_jumps(self) -> None:
        """What is stepped at samples needs all outputs sampled, together and in time."""
        stepped = [("observers", b.label) for b in self.system.observers if isinstance(b.observer, SampledObserver)]
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
        self._check_schedules(np.diff(first.arrival[first.used]))

    def _check_schedules(self, intervals: np.ndarray) -> None:
        """What each discrete-time observer asks of the times between samples."""
        stretch = self.channels[0].stretches[0]
        steps = getattr(stretch.sampling, "steps", None) if len(self.channels[0].stretches) == 1 else None
        schedule = SampleSchedule(intervals, steps, stretch.paths["sampling"])
        for b in self.system.observers:
            if isinstance(b.observer, SampledObserver):
                try:
                    b.observer.check_samples(b.form, schedule)
                except Problem as problem:
                    inside = problem.path[:1] != ("measurement",)
                    path = ("observers", b.label, *problem.path) if inside else problem.path
                    raise Problem(path, problem.message) from problem

    def _held_at_start(self) -> np.ndarray:
        """The vector w as if every output had just been measured."""
        s, t = self.system.structure, self.time.start
        held = np.zeros(s.held)
        channels = np.asarray(s.channels(t, self.system.p, self.system.z0, held).full()).ravel()
        for i, own in enumerate(channels.reshape(s.outputs, s.width)):
            held[i * s.held_width + PREVIOUS] = own[0]
            held[i * s.held_width + OUTPUT : (i + 1) * s.held_width] = own
        held[-1] = 1.0
        return held

    def _check_start(self) -> None:
        """The right-hand sides must be numbers at the start."""
        s = self.system
        held = self._held_at_start()
        flow = next(iter(s.structure.flows.values()))
        rates = np.asarray(flow(self.time.start, s.p, s.z0, held).full()).ravel()
        bad = np.flatnonzero(~np.isfinite(rates[: s.structure.plant_states]))
        if bad.size:
            name = self.plant.model.states[int(bad[0])]
            path = ("plant", *self.plant.block.place_of(name))
            raise Problem(path, f"the right-hand side of {name} is not a finite number at the start of the run")
        for b in s.observers:
            if not np.all(np.isfinite(rates[b.start : b.end])):
                internal = ", ".join(name for name in b.states if name not in ("xhat", "alpha"))
                raise Problem(
                    ("observers", b.label),
                    "the observer's right-hand side is not a finite number at the start of the run: its "
                    "initial estimate"
                    + (f" or its internal state ({internal})" if internal else "")
                    + " lies where the equations are singular; set them with initial and internal",
                )

    def execute(self, step: float, progress: Callable[[float], None] | None) -> Raw:
        """One run with a nominal step."""
        structure = self.system.structure
        self._check_steps(step)
        longest = self._longest(step)
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
            tolerance = Tolerance(self.solver.rtol or _DEFAULT_RTOL, self.solver.atol or _DEFAULT_ATOL, most, first)
        return self.program.run(plan, start, tolerance, progress)
