"""What no member of an ensemble can be made of: said of the base, before anything runs."""

from __future__ import annotations

from collections.abc import Iterator

from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.ensemble.members.members import written_out
from hgorun.errors import ConfigError, HgorunError
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.preparation import prepare


def refuse_base(ensemble: Ensemble) -> None:
    """Refuse a base that cannot be run, unless some member can, whose axes change what is wrong.

    Of the members only the first, one in the middle and the last are tried.

    Raises
    ------
    HgorunError
        What is wrong with the base, with its place in the file.
    """
    refuse(ensemble.base, _some(ensemble))


def refuse(base: Experiment, varied: Iterator[Experiment]) -> None:
    """Refuse an experiment that cannot be run, unless some variation of it can.

    Raises
    ------
    HgorunError
        What is wrong with it, with its place in the file.
    """
    refused = _refused(base)
    if refused is not None and all(map(_refused, varied)):
        raise refused


def _some(ensemble: Ensemble) -> Iterator[Experiment]:
    """Some of the members; those that the configuration does not admit are left out."""
    for number in sorted({0, ensemble.size // 2, ensemble.size - 1}):
        try:
            yield ensemble.base.varied(ensemble.members(number, number + 1).of_observers(ensemble.base).changes(0))
        except HgorunError:
            continue


def _refused(experiment: Experiment) -> HgorunError | None:
    """Why an experiment cannot be run; None where nothing is known to be wrong."""
    try:
        prepare(experiment)
    except HgorunError as error:
        return error
    return None


def refusal_of(ensemble: Ensemble, number: int) -> HgorunError | None:
    """Why a member cannot be prepared; None where it can."""
    base = ensemble.base
    changes = ensemble.members(number, number + 1).of_observers(base).changes(0)
    try:
        prepare(base.varied(changes))
    except HgorunError as found:
        return found
    return None


def told_where(ensemble: Ensemble, number: int, error: str) -> str:
    """The recorded error of a member with its place in the file, where the base of the ensemble knows it.

    What is recorded has none, so that it does not depend on who has carried the member out. A value that an axis has
    made stands in no line of the base: the axis is named.
    """
    refusal = refusal_of(ensemble, number)
    if isinstance(refusal, ConfigError) and (axis := _axis_of(ensemble, refusal.key)) is not None:
        other = "" if refusal.key == axis else f"{refusal.key}: "
        return f"axis {axis}: {other}{refusal.message}"  # the file has another value at that key
    if refusal is not None:
        return str(refusal)
    file, line = ensemble.base.source.where(("plant",))
    return f"{file}:{line}: {error}" if file is not None and error.startswith("plant: ") else error


def _axis_of(ensemble: Ensemble, key: str | None) -> str | None:
    """The axis whose values stand at a key; None where there is none."""
    return next((axis for axis in ensemble.axes if key in written_out(ensemble.base, axis)), None)
