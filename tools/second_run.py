"""What a second run costs beside its native loop: the same experiment with other numbers, in milliseconds.

    python tools/second_run.py [CONFIG] [--runs N]

Each line is the median over some runs, and the least, of the processor time of ``simulate(experiment.varied(...))``
without that of the native loop. The structure is shared, so none of it is symbolic work or compilation.
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
from hgorun.config.expressions import parse
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
        Program.__init__ = make  # type: ignore[method-assign]  # as it was


def beside(experiment: hgorun.Experiment, changes: list[dict[str, Any]], spent: list[float]) -> list[float]:
    """Processor time of runs with changes, in s, without the native loop."""
    found = []
    for change in changes:
        spent.clear()
        before = time.process_time()
        hgorun.simulate(experiment.varied(change))
        found.append(time.process_time() - before - sum(spent))
    return found


def kinds_of_change(experiment: hgorun.Experiment, parts: list[float]) -> dict[str, list[dict[str, Any]]]:
    """Changes of one value each, by what they change: the value times each of some numbers near one."""
    plant, data = experiment.plant_block, experiment.source.data
    label, observer = next(iter(experiment.observers.items()))
    found: dict[str, list[dict[str, Any]]] = {"seed": [{"seed": i} for i in range(len(parts))]}

    def times(name: str, path: str, value: float) -> None:
        found[name] = [{path: value * part} for part in parts]

    for name, text in list(plant.parameters.items())[:1]:
        times(f"plant parameter {name}", f"plant.parameters.{name}", parse(text).number())
    for name, text in list(plant.inputs.items())[:1]:
        found[f"amplitude of input {name}"] = [{f"plant.inputs.{name}": f"{part!r}*({text})"} for part in parts]
    for name, value in list(plant.initial.items())[:1]:
        times(f"initial state {name}", f"plant.initial.{name}", float(value))
    for name, value in list(observer.initial.items())[:1]:
        times(f"initial estimate of {label}", f"observers.{label}.initial.{name}", float(value))
    for name in {"theta", "poles"} & data["observers"][label].keys():
        times(f"{name} of {label}", f"observers.{label}.{name}", float(data["observers"][label][name]))
    terms = next((item.get("terms") for item in data.get("measurement", {}).get("noise", [])), None)
    if terms:
        times("amplitude of noise", "measurement.noise.0.terms.0.amplitude", float(terms[0]["amplitude"]))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("config", nargs="?", type=Path, default=CONFIG)
    parser.add_argument("--runs", type=int, default=100)
    options = parser.parse_args()
    with native_time() as spent:
        experiment = hgorun.load(options.config)
        hgorun.simulate(experiment)
        for name, changes in kinds_of_change(experiment, [1 + 1e-3 * i for i in range(options.runs)]).items():
            beside(experiment, changes[:5], spent)
            times = beside(experiment, changes, spent)
            print(f"{name}: {1e3 * statistics.median(times):.2f} ms, at least {1e3 * min(times):.2f}")


if __name__ == "__main__":
    main()
