"""Small ensembles that tests carry out."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from examples import VAN_DER_POL, experiment

from hgorun import Experiment
from hgorun.config.sweeps import SweepBlocks
from hgorun.ensemble.ensemble import Ensemble


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
