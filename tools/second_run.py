"""What a second run costs beside its native loop: the same experiment with other numbers, in milliseconds.

    python tools/second_run.py [CONFIG] [--run NAME] [--runs N]

Each line is the median over some runs, and the least, of the processor time of ``simulate(experiment.varied(...))``
without that of the native loop; and how the median compares with that of other seeds. The structure is shared, so none
of it is symbolic work or compilation. Runs of all kinds take turns: what else the machine does, slows all of them.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any

import hgorun
from hgorun.config.expressions import parse
from hgorun.engine.program import Program

_FIRST = 5  # runs that are not counted
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


def beside(experiment: hgorun.Experiment, change: dict[str, Any], spent: list[float]) -> float:
    """Processor time of a run with a change, in ms, without the native loop."""
    spent.clear()
    before = time.process_time()
    hgorun.simulate(experiment.varied(change))
    return 1e3 * (time.process_time() - before - sum(spent))


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
    all_at_once = zip(*found.values(), strict=True)
    return found | {"all at once": [dict(chain(*(change.items() for change in some))) for some in all_at_once]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("config", nargs="?", type=Path, default=CONFIG)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--run", help="which run of the file")
    options = parser.parse_args()
    with native_time() as spent:
        experiment = hgorun.load(options.config, run=options.run)
        hgorun.simulate(experiment)
        kinds = kinds_of_change(experiment, [1 + 1e-3 * i for i in range(options.runs + _FIRST)])
        times: dict[str, list[float]] = {name: [] for name in kinds}
        for number in range(options.runs + _FIRST):
            for name, changes in kinds.items():
                times[name].append(beside(experiment, changes[number], spent))
    usual = statistics.median(times["seed"][_FIRST:])
    for name, found in times.items():
        middle = statistics.median(found[_FIRST:])
        print(f"{name}: {middle:.2f} ms, at least {min(found):.2f}, {middle / usual:.2f} of a seed's")


if __name__ == "__main__":
    main()
