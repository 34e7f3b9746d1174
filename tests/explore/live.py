"""A live page without a browser: a session whose worker works at once, and what it has been told."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hgorun.commands.explore import bench_of
from hgorun.explore.keeping import Keeper
from hgorun.explore.picture import Bound, Picture
from hgorun.explore.session import Session
from hgorun.explore.worker import Job, Worker

OSCILLATOR = """\
time: {end: 4, output_step: 0.05}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
measurement:
  sampling: {period: 0.1}
  noise: [{type: gaussian, std: 0.01}]  # of the sensor
observers:
  F: {type: fhgo2, r: 1, theta: 2, poles: -1}
  S: {type: shgo, theta: 3, poles: [-1, -2]}
solver: {method: rk4, step: 0.01}
"""

CLOSED = """\
time: {end: 4, output_step: 0.02}
plant:
  states: [x1, x2]
  dynamics: {x1: x2, x2: u}
  output: x1
  inputs: {u: controller}
  initial: {x1: 1, x2: 0}
controller: {law: {u: -x1 - 2*x2}}
observers: {S: {type: shgo, theta: 5, poles: -1}}
solver: {step: 0.01}
"""


RECORDED = """\
time: {start: 0, end: 12, output_step: 0.1, unit: h}
plant:
  states: [x, v]
  dynamics: {x: v, v: -x}
  output: x
  units: {x: mm}
data:
  file: log.csv
  time: t
  period: 0.3
  outputs:
    x: {column: y, std: 0.05, gate: 6}
  reference: {v: {column: w}}
observers:
  F: {type: fhgo2, r: 1, theta: 2, initial: {x: 0.2}}  # filtered
  E: {type: ekf, Q: {x: 0.01, v: 0.02}, initial: {v: 0.5}}
tune:
  gains: {observers.F.theta: {log: [0.5, 50]}}
  minimise: holdout_rmse(F, x)
"""


def recorded(folder: Path) -> Path:
    """A configuration of recorded data, and its log, in a folder that is made."""
    folder.mkdir()
    t = np.arange(0, 12, 0.1)
    noise = 0.05 * np.random.default_rng(2).standard_normal(t.size)
    rows = np.column_stack([t, np.sin(t) + noise, np.cos(t)])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="t,y,w", comments="", fmt="%.6f")
    path = folder / "a.yaml"
    path.write_text(RECORDED)
    return path


class AtOnce(Worker):
    """Does what it is asked to when it is asked; what is less urgent, afterwards."""

    def __init__(self) -> None:
        self.later: list[Job] = []

    def submit(self, job: Job, urgency: int = 0) -> None:
        if urgency:
            self.later.append(job)
        else:
            job()

    def finish(self) -> None:
        """Do everything that waits."""
        while self.later:
            self.later.pop(0)()


class Paper:
    """A page that keeps what it is given."""

    def __init__(self) -> None:
        self.pictures: list[Picture] = []
        self.bounds: dict[str, list[Bound]] = {}
        self.told: list[dict[str, Any]] = []

    def draw(self, picture: Picture, bounds: Mapping[str, list[Bound]]) -> None:
        self.pictures.append(picture)
        self.draw_bounds(bounds)

    def draw_bounds(self, bounds: Mapping[str, list[Bound]]) -> None:
        self.bounds |= bounds

    def tell(self, told: dict[str, Any]) -> None:
        self.told.append(json.loads(json.dumps(told, allow_nan=False)))


class Live:
    """A session of a file, asked by keywords."""

    def __init__(
        self,
        path: Path,
        *,
        run: str | None = None,
        query: str = "",
        folder: Path | None = None,
        alone: bool = False,
        patience: float = 0.0,
    ) -> None:
        self.bench = bench_of(path, run=run)
        self.keeper = Keeper(self.bench, folder or path.parent / "results", f"{path.stem}.explored.yaml", alone)
        self.worker, self.paper = AtOnce(), Paper()
        self.session = Session(self.bench, self.keeper, self.worker, lambda job: job(), self.paper, query, patience)
        self.number = 0
        self.begun = self.ask("begin")

    def ask(self, do: str, **more: object) -> dict[str, Any]:
        """Ask for something; the first full answer."""
        self.number += 1
        before = len(self.paper.told)
        self.session.ask(json.dumps({"do": do, "number": self.number, **more}))
        return next(told for told in self.paper.told[before:] if "busy" not in told)

    def set(self, name: str, value: object, *, final: bool = True) -> dict[str, Any]:
        return self.ask("set", name=name, value=value, final=final)

    @property
    def digits(self) -> dict[str, list[str]]:
        """All digits of the metrics that were shown last, by observer."""
        picture = next(told["picture"] for told in reversed(self.paper.told) if "picture" in told)
        return {row["label"]: [digits for _, digits in row["cells"]] for row in picture["rows"]}

    def theory(self) -> dict[str, dict[str, Any]]:
        """What has been told of the theory since the last picture, by observer."""
        found: dict[str, dict[str, Any]] = {}
        for told in self.paper.told:
            if "picture" in told:
                found = {}
            for one in told.get("theories", []):
                own = found.setdefault(one["label"], {"cells": {}, "reasons": {}})
                own |= {key: part for key, part in one.items() if key not in ("cells", "reasons")}
                for key in ("cells", "reasons"):
                    own[key] |= one[key]
        return found
