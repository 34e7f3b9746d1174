"""hgorun: a test bench for high-gain observers.

>>> import hgorun
>>> experiment = hgorun.load("config.yaml")
>>> result = hgorun.simulate(experiment)  # or the file itself, or a mapping with the same keys
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hgorun.errors import ConfigError, HgorunError, SimulationError
from hgorun.version import __version__

if TYPE_CHECKING:
    from hgorun.analysis.report import analyze
    from hgorun.ensemble.call import sweep
    from hgorun.ensemble.growing import Sweep, read_sweep
    from hgorun.estimate.stream.estimator import Estimator
    from hgorun.result.reading import read
    from hgorun.result.result import Result
    from hgorun.simulation.experiment.experiment import Experiment
    from hgorun.study.loading import load, load_study
    from hgorun.study.python import simulate

__all__ = [
    "ConfigError",
    "Estimator",
    "Experiment",
    "HgorunError",
    "Result",
    "SimulationError",
    "Sweep",
    "__version__",
    "analyze",
    "load",
    "load_study",
    "read",
    "read_sweep",
    "simulate",
    "sweep",
]

# Imported when first used: the command line's help must not wait for numpy.
_LAZY = {
    "Estimator": "hgorun.estimate.stream.estimator",
    "Experiment": "hgorun.simulation.experiment.experiment",
    "Result": "hgorun.result.result",
    "Sweep": "hgorun.ensemble.growing",
    "analyze": "hgorun.analysis.report",
    "load": "hgorun.study.loading",
    "load_study": "hgorun.study.loading",
    "read": "hgorun.result.reading",
    "read_sweep": "hgorun.ensemble.growing",
    "simulate": "hgorun.study.python",
    "sweep": "hgorun.ensemble.call",
}


_TABLE = "`result.metrics()` of hgorun.simulate has the numbers, and `hgorun compare` in a shell prints the table"
_LOG = "hgorun.Estimator takes sample after sample, and `hgorun estimate` in a shell takes a whole log"
_COMMAND = "it is a command only, `hgorun {}` in a shell"

# Of names that are not here, what does the same. The submodules called so are no functions.
_CALLED = {
    "compare": _TABLE,
    "run": "hgorun.simulate runs an experiment, and hgorun.sweep an ensemble",
    **{name: _COMMAND.format(name) for name in ("tune", "figures", "export", "claims", "benchmark", "explore")},
    "estimate": _LOG,
}


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    if name in _LAZY:
        value = getattr(import_module(_LAZY[name]), name)
        globals()[name] = value
        return value
    called = f": {_CALLED[name]}" if name in _CALLED else ""
    raise AttributeError(f"module 'hgorun' has no attribute {name!r}{called}")
