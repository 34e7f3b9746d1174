"""Two pendula, one hanging from the other, that are simulated here, without hgorun, for links.yaml.

    python demos/qube/links.py FOLDER [NAME ...]

writes three logs of each, or of those that are named: NAME0.csv and NAME1.csv for the model and the gains, NAME2.csv to
judge them.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

END, STEP = 12.0, 0.004
LAG = 0.3  # s, of the wind
GRID = 0.01  # s, between which it is a line
STARTS = ((1.4, 0.6, 0.0, 0.0), (-0.9, 1.2, 1.0, -2.0), (1.0, -1.3, -2.0, 1.0))
SOFT = 0.02  # rad/s: dry friction is c tanh(speed/SOFT)


@dataclass(frozen=True)
class Links:
    """Angles a and b from the vertical; point masses at the ends of massless links.

    Lengths are in units of the first link, masses of the first mass, torques of both: G = g/l_a, rho = l_b/l_a, mu =
    m_b/m_a; d_a, d_b are friction of a fluid film in the joints; c is dry friction, in the second joint times mu. The
    wind is not recorded: white noise through a lag, a torque of this size on the first
    link, and of mu times this size on the second. Angles have white noise, or encoders of so many steps a turn.
    """

    G: float = 32.7
    rho: float = 1.0
    mu: float = 0.6
    d_a: float = 0.02
    d_b: float = 0.01
    c: float = 0.0
    wind: float = 0.0
    noise: float = 0.0
    encoder: int = 4096
    seed: int = 0

    def accelerations(self, x: Sequence[float], wind: Sequence[float]) -> tuple[float, float]:
        """Of both angles, from the equations of Lagrange: mass matrix times accelerations = torques."""
        a, b, speed_a, speed_b = x
        mu, rho, turn = self.mu, self.rho, speed_b - speed_a
        first, across, second = 1 + mu, mu * rho * math.cos(a - b), mu * rho**2  # the mass matrix
        push = mu * rho * math.sin(a - b)
        joint = self.d_b * turn + self.c * mu * math.tanh(turn / SOFT)
        torque_a = -push * speed_b**2 - first * self.G * math.sin(a)
        torque_a += joint - self.d_a * speed_a - self.c * math.tanh(speed_a / SOFT) + wind[0]
        torque_b = push * speed_a**2 - mu * rho * self.G * math.sin(b)
        torque_b += mu * wind[1] - joint
        by = first * second - across**2
        return (second * torque_a - across * torque_b) / by, (first * torque_b - across * torque_a) / by

    def log(self, path: Path, start: tuple[float, ...], seed: int) -> None:
        rng = np.random.default_rng(seed)
        t = np.arange(round(END / STEP)) * STEP + rng.uniform(-2e-5, 2e-5, round(END / STEP))
        t[0] = 0.0
        gusts, kept = np.zeros((2, round(END / GRID) + 3)), math.exp(-GRID / LAG)
        for k in range(1, gusts.shape[1]):
            gusts[:, k] = kept * gusts[:, k - 1] + self.wind * math.sqrt(1 - kept**2) * rng.standard_normal(2)
        wind = gusts.tolist()

        def slope(s: float, x: np.ndarray) -> list[float]:
            k, part = int(s / GRID), s / GRID - int(s / GRID)
            state = x.tolist()
            return [*state[2:], *self.accelerations(state, [(1 - part) * one[k] + part * one[k + 1] for one in wind])]

        span = (0.0, t[-1] + GRID)
        states = solve_ivp(slope, span, start, method="DOP853", rtol=1e-9, atol=1e-10, max_step=GRID, t_eval=t).y
        angles = states[:2] + self.noise * rng.standard_normal((2, t.size))
        if self.encoder:
            angles = 2 * math.pi / self.encoder * np.round(angles * self.encoder / (2 * math.pi))
        rows = np.column_stack([t, *angles, *states[2:]])
        np.savetxt(path, rows, delimiter=",", header="time,a,b,speed_a,speed_b", comments="", fmt="%.8f")


LINKS = {
    "heavy": Links(G=25.0, rho=1.3, mu=1.5, c=0.03, wind=0.4, seed=6000),
    "gusts": Links(rho=0.9, mu=0.8, wind=1.5, seed=8000),
    "wind": Links(wind=0.5, seed=3000),
    "dry": Links(c=0.08, seed=2000),
}


def main() -> None:
    names = sys.argv[2:] or list(LINKS)
    if len(sys.argv) < 2 or not LINKS.keys() >= set(names):
        raise SystemExit(f"{__doc__}\nThere are {', '.join(LINKS)}.")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        for i, start in enumerate(STARTS):
            LINKS[name].log(folder / f"{name}{i}.csv", start, seed=LINKS[name].seed + i)


if __name__ == "__main__":
    main()
