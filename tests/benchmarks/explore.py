"""What a redraw of a live page costs: on the server, and in a real browser from the event to the picture.

    PYTHONPATH=tests python tests/benchmarks/explore.py [CONFIG] [--runs N] [--no-browser] [--only WORD]

For every knob of the configuration and each of some small changes: processor time of the run, of what is drawn of it,
and of the theory's bounds of the observers that have changed, in milliseconds. In the browser the clock runs from the
event of a slider until the frame that shows the new curves, and the new bounds; what else the machine does, slows it.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import browser

import hgorun
from hgorun.explore.knobs import Knob
from hgorun.explore.picture import picture_of
from hgorun.explore.simulated import SimulatedBench
from hgorun.explore.state import State

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "experiments" / "robles2023" / "chapter3" / "contois_te025.yaml"
_ALLOWED = 100.0  # milliseconds


def nudged(knob: Knob, number: int) -> float:
    """A value near that of the file."""
    if knob.scale == "integer":
        return knob.start + number % 3 + 1
    return knob.start * (1 + 2e-3 * (number + 1)) or 1e-3 * (number + 1)


def on_the_server(bench: SimulatedBench, knob: Knob, runs: int) -> tuple[list[float], list[float], list[float]]:
    """Processor times of run, picture and bounds, in ms; the first two changes are not counted."""
    found: tuple[list[float], list[float], list[float]] = ([], [], [])
    for number in range(runs + 2):
        state = State().with_value(knob, nudged(knob, number))
        moments = [time.process_time()]
        shown = bench.shown(state)
        moments.append(time.process_time())
        picture_of(shown)
        moments.append(time.process_time())
        for label in shown.result.observers:
            bench.promise(shown, label)
        moments.append(time.process_time())
        if number > 1:
            for times, begun, ended in zip(found, moments, moments[1:], strict=False):
                times.append(1e3 * (ended - begun))
    return found


async def in_the_browser(page: browser.Page, runs: int, only: str) -> list[tuple[str, list[Any]]]:
    """For every slider the times until curves and bounds are seen."""
    await page.until("window.hgorun && hgorun.idle && hgorun.times.length > 0")
    await asyncio.sleep(6)
    found = []
    names = await page.value("JSON.parse(document.getElementById('known').textContent).knobs.map(k => k.name)")
    for i, name in enumerate(names):
        if only not in str(name):
            continue
        await page.value("hgorun.times.length = 0")
        for _ in range(runs):
            await page.value(_MOVED % i)
            await page.until("hgorun.idle")
            await asyncio.sleep(0.6)
        found.append((str(name), list(await page.value("hgorun.times"))))
        await page.value("document.getElementById('reset').click()")
        await asyncio.sleep(1)
    return found


_MOVED = """(() => {
  const one = document.querySelector('[data-knob="%d"]');
  one.value = Number(one.value) + 1;
  one.dispatchEvent(new Event('input', {bubbles: true}));
})()"""


def print_browser(config: Path, run: str | None, runs: int, only: str) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "hgorun", "explore", str(config), "--no-browser", "-q", "-o", folder]
        command += [] if run is None else ["--run", run]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        found: list[tuple[str, list[Any]]] = []

        async def look(page: browser.Page) -> None:
            await page.resize(1300, 1000)
            found.extend(await in_the_browser(page, runs, only))

        try:
            assert process.stdout is not None
            browser.opened(process.stdout.readline().strip(), look)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30)
    print("\nin the browser, from the event to the picture: median of curves, of all bounds, in ms")
    for name, times in found:
        curves = [float(ms) for what, ms in times if what == "curves"]
        bounds = [float(ms) for what, ms in times if what == "theory"]
        print(f"  {name}: {_median(curves)}, {_median(bounds)}")


def _median(values: list[float]) -> str:
    return f"{statistics.median(values):.0f}" if values else "-"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("config", nargs="?", type=Path, default=CONFIG)
    parser.add_argument("--run", help="which run of the file")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--only", default="", help="sliders with this in their names")
    parser.add_argument("--no-browser", action="store_true")
    options = parser.parse_args()
    bench = SimulatedBench(options.config, hgorun.load(options.config, run=options.run), options.run)
    shown = bench.shown(State())
    for label in shown.result.observers:
        bench.promise(shown, label)
    while bench.look_ahead(shown):  # as the server does while nothing is asked
        pass
    print("on the server: median processor time of run, picture, bounds, together, in ms")
    for knob in (one for one in bench.knobs.values() if options.only in one.name):
        parts = [statistics.median(times) for times in on_the_server(bench, knob, options.runs)]
        mark = "" if sum(parts) <= _ALLOWED else f"  more than {_ALLOWED:g}"
        print(f"  {knob.name}: {', '.join(f'{part:.1f}' for part in (*parts, sum(parts)))}{mark}")
    if options.no_browser:
        return
    if browser.CHROMIUM is None:
        print("no Chromium: nothing is measured in the browser")
        return
    print_browser(options.config, options.run, options.runs, options.only)


if __name__ == "__main__":
    main()
