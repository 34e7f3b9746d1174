"""Pendula that are simulated here, without hgorun, for pendulum.yaml.

    python demos/qube/pendula.py FOLDER [NAME ...]

writes three logs of each, or of those that are named: NAME0.csv and NAME1.csv for the model and the gains, NAME2.csv to
judge them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

STEP = 2e-4  # of the classical method of Runge and Kutta
END = 12.0
State = tuple[float, float]


@dataclass(frozen=True)
class Pendulum:
    """angle'' = -omega_0^2 sin(angle) - d angle' - c sign(angle') - b angle' |angle'| + torque + wind.

    The angle has white noise, or an encoder of so many steps a turn; times of samples jitter by up to so much; a torque
    that is recorded changes every 0.25 s; the wind is not recorded: white noise through a lag of 0.3 s.
    """

    omega_0: float
    d: float
    starts: tuple[State, ...]
    c: float = 0.0
    b: float = 0.0
    noise: float = 0.0
    encoder: int = 0
    jitter: float = 2e-5
    torque: float = 0.0
    wind: float = 0.0
    seed: int = 0

    def log(self, path: Path, start: State, seed: int) -> None:
        rng = np.random.default_rng(seed)
        t = np.arange(round(END / 0.004)) * 0.004 + rng.uniform(-self.jitter, self.jitter, round(END / 0.004))
        t[0] = 0.0
        wind, kept = [0.0], math.exp(-0.01 / 0.3)
        for _ in range(round(END / 0.01) + 2):
            wind.append(kept * wind[-1] + self.wind * math.sqrt(1 - kept**2) * rng.standard_normal())
        levels = self.torque * rng.uniform(-1, 1, round(END / 0.25) + 2)

        def force(s: float, x: State) -> float:
            """All but Coulomb's friction."""
            gravity = -(self.omega_0**2) * math.sin(x[0]) - self.d * x[1] - self.b * x[1] * abs(x[1])
            return float(gravity + wind[int(s / 0.01)] + levels[int(s / 0.25)])

        def slope(s: float, x: State) -> State:
            whole = force(s, x)
            if x[1] == 0 and abs(whole) <= self.c:
                return 0.0, 0.0
            return x[1], whole - math.copysign(self.c, x[1] or whole)

        states, x = [], start
        for k in range(round(END / STEP) + 2):
            states.append(x)
            then = stepped(slope, k * STEP, x)
            stops = self.c > 0 and x[1] * then[1] < 0 and abs(force(k * STEP, (then[0], 0.0))) <= self.c
            x = (then[0], 0.0) if stops else then
        grid = STEP * np.arange(len(states))
        angle, speed = (np.interp(t, grid, column) for column in np.array(states).T)
        angle = angle + self.noise * rng.standard_normal(t.size)
        if self.encoder:
            angle = 2 * math.pi / self.encoder * np.round(angle * self.encoder / (2 * math.pi))
        columns = {"time": t, "angle": angle, "velocity": speed, "torque": [levels[int(s / 0.25)] for s in t]}
        rows = np.column_stack(list(columns.values()))
        np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.8f")


def stepped(slope: Callable[[float, State], State], s: float, x: State) -> State:
    def at(part: float, by: State) -> State:
        return slope(s + part, (x[0] + part * by[0], x[1] + part * by[1]))

    a = slope(s, x)
    b = at(STEP / 2, a)
    c = at(STEP / 2, b)
    d = at(STEP, c)
    angle, speed = (x[i] + STEP / 6 * (a[i] + 2 * b[i] + 2 * c[i] + d[i]) for i in (0, 1))
    return angle, speed


HIGH = ((2.4, 0.0), (-1.1, 4.0), (1.6, -3.0))
PENDULA = {
    "coulomb": Pendulum(6.1, 0.02, HIGH, c=0.6, encoder=2000, seed=1435),
    "noisy": Pendulum(7.0, 0.2, HIGH, noise=0.03, seed=1562),
    "small": Pendulum(5.0, 0.05, ((0.15, 0.0), (-0.12, 0.3), (0.1, -0.5)), noise=0.004, jitter=5e-4, seed=1537),
    "driven": Pendulum(5.2, 0.3, ((0.4, 0.0), (-0.6, 1.0), (0.1, -1.0)), c=0.15, noise=0.004, torque=14.0, seed=1648),
    "drag": Pendulum(4.5, 0.02, ((2.8, 0.0), (-1.9, 3.0), (2.2, -4.0)), b=0.1, noise=0.006, seed=1427),
    "windy": Pendulum(6.5, 0.1, HIGH, encoder=8192, wind=0.5, seed=1434),
}


def main() -> None:
    names = sys.argv[2:] or list(PENDULA)
    if len(sys.argv) < 2 or not PENDULA.keys() >= set(names):
        raise SystemExit(f"{__doc__}\nThere are {', '.join(PENDULA)}.")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        one = PENDULA[name]
        for i, start in enumerate(one.starts):
            one.log(folder / f"{name}{i}.csv", start, seed=one.seed + 17 * i)


if __name__ == "__main__":
    main()
