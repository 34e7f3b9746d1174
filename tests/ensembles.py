"""Small ensembles that tests carry out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from examples import VAN_DER_POL, experiment

from hgorun import Experiment
from hgorun.config.sweeps import SweepBlocks
from hgorun.ensemble.growing import read_sweep
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.sweep import Place
from hgorun.result.quantities.quantity import Quantity
from hgorun.study.ensembles import carried_out, ensemble_of
from hgorun.study.measured import Numbers, beside_metrics, of_members
from hgorun.study.study import Run


@cache
def base() -> Experiment:
    """Two observers, and noise that is drawn."""
    return experiment(
        VAN_DER_POL,
        {"SHGO": {"type": "shgo", "theta": 3}, "FHGO": {"type": "fhgo1", "theta": 2, "delta": 3}},
        end=0.5,
        step=0.01,
        measurement={"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]},
    )


def ensemble(axes: Mapping[str, Any], of: Experiment | None = None, **more: Any) -> Ensemble:
    """An ensemble of :func:`base`, or of another experiment."""
    return Ensemble(name="small", base=of or base(), blocks=SweepBlocks(axes=dict(axes), **more))


def small(**keep: Any) -> Ensemble:
    """Twelve members."""
    axes = {"observers.*.theta": {"log": [2, 20, 4]}, "seed": {"count": 3}}
    return ensemble(axes, keep={"metrics": ["rmse", "peak"], **keep})


def numbers(run: Run, quantities: Sequence[Quantity], folder: Path) -> Numbers:
    """What the members of a study's run measure."""
    of, place = ensemble_of(run, beside_metrics(quantities), followed="none"), Place.of(folder / f"{run.name}.sweep.h5")
    carried_out(of, place, workers=1)
    return of_members(run, of, read_sweep(place.file), quantities)
