"""Updates of an Estimator a second of processor time, beside a plain loop of Python for comparison between machines.

    python tests/benchmarks/updates.py

The fastest of many short stretches is told, so that what else runs on the machine matters little.
"""

from __future__ import annotations

import math
from time import process_time
from typing import Any

from hgorun.estimate.stream.estimator import Estimator
from hgorun.simulation.experiment.experiment import Experiment

PLANT = {
    "states": ["a", "b"],
    "dynamics": {"a": "b", "b": "-sin(a) - 0.1*b"},
    "output": "a",
    "initial": {"a": 0, "b": 1},
}
SHGO = {"type": "shgo", "theta": 2, "poles": -1}
CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "shgo": (SHGO, {}),
    "shgo, none late": (SHGO, {"remembered": 0}),
    "shgo, gate": (SHGO, {"gates": {"a": 5}}),
    "ekf": ({"type": "ekf", "Q": {"b": 0.1}, "R": 0.01}, {}),
}
STRETCHES, UPDATES, PASSES = 60, 300, 20_000


def seconds_of_a_pass() -> float:
    """Of a loop of plain Python: an addition and an entry of a dictionary."""
    start, total, kept = process_time(), 0.0, dict[int, float]()
    for k in range(PASSES):
        total += k * 0.5
        kept[k & 7] = total
    return (process_time() - start) / PASSES


def main() -> None:
    print(f"{'':16} {'updates/s':>10} {'loop passes/s':>14} {'passes an update':>17}")
    for name, (block, more) in CASES.items():
        config = {"plant": PLANT, "observers": {"O": block}, "time": {"end": 10, "output_step": 0.1}}
        sampled = {"measurement": {"sampling": {"period": 0.1}}, "solver": {"step": 0.1}}
        estimator, k = Estimator(Experiment(config | sampled), **more), 0
        update, a_pass = math.inf, math.inf
        for _ in range(STRETCHES):
            rows = [(0.1 * j, {"a": math.sin(0.1 * j)}) for j in range(k + 1, k + 1 + UPDATES)]
            k += UPDATES
            start = process_time()
            for t, y in rows:
                estimator.update(t, y)
            update = min(update, (process_time() - start) / UPDATES)
            a_pass = min(a_pass, seconds_of_a_pass())
        print(f"{name:16} {1 / update:10.0f} {1 / a_pass:14.3g} {update / a_pass:17.0f}")


if __name__ == "__main__":
    main()
