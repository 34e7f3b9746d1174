"""What recorded data are asked for, and the samples that decide: some for a search, others for its report."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hgorun.data.faults.said_places import samples_said
from hgorun.data.recording import Note, Recording, Signal
from hgorun.errors import Problem
from hgorun.estimate.holdout import given_of, part

SCORES = ("holdout_rmse", "innovation_rms", "reference_rmse")
_NAME = r"""(?:'([^']+)'|"([^"]+)"|([^'",()]+?))"""  # in quotes it may have brackets
_CALL = re.compile(rf"\s*(\w+)\s*\(\s*{_NAME}\s*,\s*{_NAME}\s*\)\s*")
_EVERY = 5  # samples: one of them is for the search, another for the report
ALL = "*"  # outputs


@dataclass(frozen=True)
class Goal:
    """A score of an observer, of one output or state, or of all outputs in standard deviations of their noise."""

    score: str
    label: str
    name: str

    def __str__(self) -> str:
        return f"{self.score}({self.label}, {self.name})"


@dataclass(frozen=True, eq=False, repr=False)
class Split:
    """A recording in three parts.

    Attributes
    ----------
    given : Recording
        What the observers get.
    search, report : mapping of str to Signal
        What they do not get: by output, or by what was measured for comparison alone.
    """

    given: Recording
    search: Mapping[str, Signal]
    report: Mapping[str, Signal]


def read_goal(text: str, place: tuple[str | int, ...]) -> Goal:
    """``holdout_rmse(LABEL, OUTPUT)``; names may be in quotes.

    Raises
    ------
    Problem
    """
    found = _CALL.fullmatch(text)
    if found is None or found[1] not in SCORES:
        message = f"of recorded data {', '.join(SCORES)} can be minimised, as in holdout_rmse(LABEL, OUTPUT)"
        raise Problem(place, f"{message}; found {text!r:.80}")
    score, *names = (one for one in found.groups() if one is not None)
    return Goal(score, *names)


def split(recording: Recording, goal: Goal, between: Mapping[str, Signal] | None = None) -> Split:
    """Samples for the observers, for the search and for the report.

    Of an output that is held out every fifth sample is for the search, and another fifth for the report; of one of
    which the observers do not get all samples anyway, those in every other gap are for the search. What was measured
    for comparison alone is given to no observer: every other sample is for the search.

    Parameters
    ----------
    between : mapping of str to Signal, optional
        By output samples that are held out already.

    Raises
    ------
    Problem
        Where nothing of that name was recorded, or too little.
    """
    if goal.score == "reference_rmse":
        if goal.name not in recording.reference:
            raise Problem(("tune", "minimise"), f"{goal}: {goal.name} is not in data.reference")
        signal = recording.reference[goal.name]
        search, report = _halves(signal, np.arange(signal.taken.size), goal)
        return Split(replace(recording, reference={}), {goal.name: search}, {goal.name: report})
    names = tuple(recording.outputs) if goal.name == ALL else (goal.name,)
    outputs, searched, reported, notes = dict(recording.outputs), {}, {}, list[Note]()
    for name in names:
        if name not in recording.outputs:
            raise Problem(("tune", "minimise"), f"{goal}: the output {name} is not in data.outputs")
        if between and name in between:
            gaps = np.searchsorted(recording.outputs[name].taken, between[name].taken)
            if np.unique(gaps).size == 1:
                few = f"all samples that data.period holds out lie in one gap of the {name} that observers get"
                raise Problem(("tune", "minimise"), f"{goal}: {few}: none is left for the report; give a shorter one")
            searched[name], reported[name] = _halves(between[name], gaps, goal)
        else:
            (outputs[name], told), searched[name], reported[name] = _fifths(recording.outputs[name], goal)
            notes += told
    given = replace(recording, outputs=outputs, reference={}, notes=(*recording.notes, *notes))
    return Split(given, searched, reported)


def _halves(signal: Signal, numbers: np.ndarray, goal: Goal) -> tuple[Signal, Signal]:
    """Samples with even numbers, and the others; a Problem where there are none of either."""
    odd = numbers % 2 == 1
    if odd.all() or not odd.any():
        raise _too_few(signal, goal)
    return part(signal, ~odd), part(signal, odd)


def _fifths(signal: Signal, goal: Goal) -> tuple[tuple[Signal, list[Note]], Signal, Signal]:
    """Three fifths of the samples of an output, and what is told of them; a fifth, and another."""
    place = np.arange(signal.taken.size) % _EVERY
    search, report = place == 1, place == _EVERY - 2
    given, told = given_of(signal, ~(search | report))
    if not (search.any() and report.any() and given.taken.size):
        raise _too_few(signal, goal)
    return (given, told), part(signal, search), part(signal, report)


def _too_few(signal: Signal, goal: Goal) -> Problem:
    samples = samples_said(signal.taken.size, " is too few", " are too few")
    return Problem(("tune", "minimise"), f"{goal}: {samples} for a search and its report")
