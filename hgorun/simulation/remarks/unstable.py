"""Gains that are given as they are and with which the error grows, where poles would have been refused."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hgorun.config.types import pole_text
from hgorun.observers.capabilities import GivenGain
from hgorun.simulation.experiment.experiment import Experiment

_ROUNDING = 1e-9  # of the largest root: what is nearer to the axis is on it


def unstable(experiment: Experiment) -> Iterator[str]:
    """A remark for every observer whose own gains are not those of a stable error.

    They are carried out: a plant that is stable itself may need no gain at all, and an unstable one may be shown.
    """
    for label, design in experiment.designs.items():
        observer = design.observer
        if not isinstance(observer, GivenGain) or (key := observer.given_gain) is None:
            continue
        worst = _rightmost(observer.characteristics(design.form))
        if worst is not None:
            yield (
                f"{experiment.source.told(('observers', label, key))}: with these gains the error grows, or stays: it "
                f"has the eigenvalue {pole_text(worst)} at theta = 1, without the plant's own slopes, and every real "
                "part has to be below 0; give poles instead, or other gains"
            )


def _rightmost(polynomials: list[np.ndarray]) -> complex | None:
    """The root with the largest real part where that is not below zero; None where it is."""
    roots = np.concatenate([np.roots(polynomial) for polynomial in polynomials])
    if roots.size == 0:
        return None
    worst = complex(roots[np.argmax(roots.real)])
    rounding = _ROUNDING * float(np.max(np.abs(roots)))
    return None if worst.real < -rounding else complex(worst.real if worst.real > 0 else 0.0, worst.imag)
