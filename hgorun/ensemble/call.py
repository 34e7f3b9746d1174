"""Ensembles from Python, without a file that describes them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hgorun.config.sweeps import Combine, SweepBlocks
from hgorun.config.types import describe
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.ensemble.executors import Executor
from hgorun.ensemble.folder.store import Store
from hgorun.ensemble.growing import Sweep, read_sweep
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.refused import refuse_base
from hgorun.ensemble.sweep import SUFFIX, Place, carry_out, finished
from hgorun.errors import ConfigError
from hgorun.files import refuse_no_result, why_unwritable
from hgorun.simulation.experiment.expected import require_experiment
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.experiment.resolved import plain


def sweep(
    experiment: Experiment,
    axes: Mapping[str, Any],
    keep: Mapping[str, Any] | None = None,
    *,
    combine: Combine = "product",
    output: str | Path | None = None,
    fresh: bool = False,
    executor: Executor | None = None,
) -> Sweep:
    """Carry out an ensemble: an experiment, varied along axes.

    Parameters
    ----------
    experiment : Experiment
        The base.
    axes : mapping of str to list, array or mapping
        By path, as after ``--set``: values, or ``{"log": [2, 20, 10]}`` and the like, as in a sweep file.
    keep : mapping, optional
        ``metrics`` and ``trajectories``, as in a sweep file.
    combine : {"product", "zip", "sobol"}
    output : path, optional
        The collected file. It is kept with the folder beside it; called again, what is missing is carried out.
        Without it nothing is left on disk.
    fresh : bool
        Begin anew, whatever was finished before.
    executor : callable, optional
        Who carries members out, see ``hgorun.ensemble.executors``; by default threads of this process.

    Returns
    -------
    Sweep

    Raises
    ------
    ConfigError
        When an axis or what is kept does not fit the experiment, the experiment itself is refused, or an argument is
        something else than asked for.
    HgorunError
        When ``output`` holds members of something else, or cannot be written.

    Examples
    --------
    >>> found = hgorun.sweep(experiment, {"observers.FHGO.theta": {"log": [2, 20, 10]}, "seed": {"count": 20}})
    >>> found.to_xarray()["rmse"].mean("seed").dims
    ('observers.FHGO.theta', 'observer', 'state')
    """
    _check(experiment, output, executor)
    data = plain({"axes": _as_dict(axes), "combine": combine, "keep": _as_dict({} if keep is None else keep)})
    source = Source(data, {})
    blocks = validate(SweepBlocks, data, source, ())
    name = experiment.name if output is None else Path(output).stem.removesuffix(SUFFIX)
    ensemble = Ensemble(name=name, base=experiment, blocks=blocks)
    with source.located():
        ensemble.check()
    refuse_base(ensemble)
    if output is not None:
        return _at(Place.of(Path(output)), ensemble, fresh, executor)
    with TemporaryDirectory(prefix="hgorun-") as folder:
        return _at(Place.of(Path(folder) / f"{SUFFIX}.h5"), ensemble, False, executor)


def _as_dict(given: object) -> object:
    """A mapping of any kind as one that can be checked; whatever else it is stays what it is."""
    return dict(given) if isinstance(given, Mapping) else given


def _check(experiment: object, output: object, executor: object) -> None:
    """Refuse arguments of other kinds, which a notebook without type checks may give."""
    require_experiment(experiment)
    if output is not None and (not isinstance(output, (str, Path)) or not Path(output).name):
        raise ConfigError(f"output: expected the path of a file, found {describe(output)}")
    if output is not None:
        refuse_no_result(Path(output), "output")
        _refuse_unwritable(Path(output))
    if executor is not None and not callable(executor):
        what = "a function such as hgorun.ensemble.executors.processes(2)"
        raise ConfigError(f"executor: expected {what}, found {describe(executor)}")


def _refuse_unwritable(output: Path) -> None:
    """Before members are carried out, whose collected file could not be written."""
    if why := "it is a folder" if os.path.isdir(output) else why_unwritable(output):
        raise ConfigError(f"output: {output} cannot be written: {why}")


def _at(place: Place, ensemble: Ensemble, fresh: bool, executor: Executor | None) -> Sweep:
    store = Store.opened(place.folder, ensemble, fresh=fresh)
    carry_out(store, executor)
    finished(store, place.file, lambda: carry_out(store, executor))
    return read_sweep(place.file)
