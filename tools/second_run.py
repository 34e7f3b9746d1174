"""What a second run costs beside its native loop: the same experiment with other numbers, in milliseconds.

    python tools/second_run.py [CONFIG] [--runs N]

Each line is the median over some runs of the processor time of ``simulate(experiment.varied(...))`` without that of
the native loop. The structure is shared, so none of it is symbolic work or compilation.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import hgorun
from hgorun.engine.program import Program

CONFIG = Path(__file__).parents[1] / "experiments" / "robles2023" / "chapter3" / "contois_te025.yaml"


@contextmanager
def native_time() -> Iterator[list[float]]:
    """Collects the processor time of every call of the native loop."""
    spent: list[float] = []
    make = Program.__init__

    def timed(program: Program, *args: Any, **kwargs: Any) -> None:
        make(program, *args, **kwargs)
        native: Callable[..., int] = program._run

        def run(*arguments: int) -> int:
            before = time.process_time()
            verdict = native(*arguments)
            spent.append(time.process_time() - before)
            return verdict

        program._run = run  # type: ignore[assignment]  # a function of Python in place of one of ctypes

    Program.__init__ = timed  # type: ignore[method-assign]  # for as long as it is measured
    try:
        yield spent
    finally:
        Program.__init__ = make  # type: ignore[method-assign]


def beside(experiment: hgorun.Experiment, changes: list[dict[str, Any]], spent: list[float]) -> list[float]:
    """Processor time of runs with changes, in s, without the native loop."""
    found = []
    for change in changes:
        spent.clear()
        before = time.process_time()
        hgorun.simulate(experiment.varied(change))
        found.append(time.process_time() - before - sum(spent))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("config", nargs="?", type=Path, default=CONFIG)
    parser.add_argument("--runs", type=int, default=100)
    options = parser.parse_args()
    with native_time() as spent:
        experiment = hgorun.load(options.config)
        label, observer = next(iter(experiment.observers.items()))
        state, value = next(iter(experiment.plant_block.initial.items()))
        parts = [1 + 1e-3 * i for i in range(options.runs)]
        kinds = {
            "seed": [{"seed": i} for i in range(options.runs)],
            f"initial state {state}": [{f"plant.initial.{state}": float(value) * part} for part in parts],
        }
        theta = observer.model_dump().get("theta")
        if isinstance(theta, float):
            kinds = {f"theta of {label}": [{f"observers.{label}.theta": theta * part} for part in parts]} | kinds
        for name, changes in kinds.items():
            beside(experiment, changes[:5], spent)
            print(f"{name}: {1e3 * statistics.median(beside(experiment, changes, spent)):.2f} ms")


if __name__ == "__main__":
    main()
