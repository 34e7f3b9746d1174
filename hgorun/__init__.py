"""hgorun: the bench for high-gain observers.

>>> import hgorun
>>> experiment = hgorun.load("config.yaml")
>>> result = hgorun.simulate(experiment)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hgorun.errors import ConfigError, HgorunError, SimulationError

if TYPE_CHECKING:
    from hgorun.analysis.report import analyze
    from hgorun.experiment import Experiment
    from hgorun.loading import load, load_study
    from hgorun.result import Result
    from hgorun.simulation import simulate
    from hgorun.store import read

__version__ = "0.1.0"

__all__ = [
    "ConfigError",
    "Experiment",
    "HgorunError",
    "Result",
    "SimulationError",
    "analyze",
    "load",
    "load_study",
    "read",
    "simulate",
]

# Imported when first used: the command line's help must not wait for numpy.
_LAZY = {
    "Experiment": "hgorun.experiment",
    "Result": "hgorun.result",
    "analyze": "hgorun.analysis.report",
    "load": "hgorun.loading",
    "load_study": "hgorun.loading",
    "read": "hgorun.store",
    "simulate": "hgorun.simulation",
}


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'hgorun' has no attribute {name!r}")
