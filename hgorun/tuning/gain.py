"""A gain that is sought, and the ends of its range: which are admissible, and which was reached."""

from __future__ import annotations

from dataclasses import dataclass

from hgorun.config.tuning import Range
from hgorun.errors import ConfigError, Problem
from hgorun.simulation.experiment.experiment import Experiment

_FARTHER = (1.0, 0.5, 0.1)  # how much wider a range is advised, the widest that is admissible


@dataclass(frozen=True)
class Gain:
    """A number that is sought.

    Attributes
    ----------
    path : str
        As after ``--set``.
    range : Range
        Between which values.
    key : str
        Of ``tune.gains``, which may stand for several paths.
    """

    path: str
    range: Range
    key: str


def refuse_ends(base: Experiment, gain: Gain) -> None:
    """Refuse a range with an end that a configuration does not admit.

    Raises
    ------
    Problem
        At ("tune", "gains", key).
    """
    for value in gain.range.ends:
        try:
            base.varied({gain.path: value})
        except ConfigError as error:
            other = "" if error.key in (None, gain.path) else f"{error.key}: "
            message = f"{other}{error.message} (for the value {value:g})"
            raise Problem(("tune", "gains", gain.key), message) from None


def refuse_unasked(key: str, label: str) -> None:
    """Refuse a gain of an observer that no goal and no limit speaks of: whatever it is, they are the same.

    Raises
    ------
    Problem
        At ("tune", "gains", key).
    """
    raise Problem(("tune", "gains", key), f"nothing of observer {label} is minimised or bounded")


def at_an_end(base: Experiment, gain: Gain, value: float) -> str | None:
    """That the value found is at an end of its range, and which range is wider there; nothing where it is at none.

    Parameters
    ----------
    base : Experiment
        Which decides how far a range may reach.
    gain : Gain
    value : float
    """
    end = gain.range.end_at(value)
    if end is None:
        return None
    low, high = gain.range.ends
    told = f"{gain.path} = {value:g} is at the {end} end of its range [{low:g}, {high:g}]"
    wider = _wider(base, gain, end)
    advice = f"; write {gain.key}: {wider}" if wider is not None else ""
    return f"{told}: better values may lie beyond it{advice}"


def _wider(base: Experiment, gain: Gain, end: str) -> Range | None:
    """The widest of some ranges that reach beyond an end, if one is admissible."""
    for farther in _FARTHER:
        try:
            wider = gain.range.beyond(end, farther)
            refuse_ends(base, Gain(gain.path, wider, gain.key))
        except ValueError:  # too wide for numbers, or a Problem of the configuration
            continue
        return wider
    return None
