"""The integration error of some members, where steps or tolerances are given: no member shows its own then.

A second pass of every member would take as long again. So a few are carried out once more, alone and with a second
pass, as a single run is; which, follows from the seed.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hgorun.ensemble.found import FAILED, Block
from hgorun.ensemble.members.ensemble import Ensemble
from hgorun.errors import HgorunError
from hgorun.result.records.data import PLANT
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import simulate
from hgorun.simulation.timeline.grid import LONG

_MOST = 3  # members
_OF_EACH = 100  # alone a member takes up to ten times what it takes among others
_GOLDEN = 0.6180339887498949  # multiples of it lie evenly between whole numbers, however many there are
_PERIOD = 10_000  # of seeds: of larger ones nothing would be left behind the point


def chosen(size: int, seed: int) -> list[int]:
    """Which of so many members are checked: one of each hundred, at most three."""
    count = min(_MOST, size // _OF_EACH)
    return sorted({int(size * ((seed % _PERIOD + k) * _GOLDEN % 1)) for k in range(1, count + 1)})


def check(ensemble: Ensemble, block: Block, start: int, stop: int) -> None:
    """Estimate the errors of the members from ``start`` to before ``stop`` that are chosen, and write them down.

    Alone, a member of very many output points would need memory that it does not need among others: it has none.
    """
    base = ensemble.base
    for number in chosen(ensemble.size, base.blocks.seed):
        i = number - start
        if not start <= number < stop or block.plant_status[i] == FAILED or np.isfinite(block.integration_error[i, 0]):
            continue
        errors = _errors(base.varied(ensemble.members(number, number + 1).of_observers(base).changes(0)))
        block.integration_error[i] = [errors.get(label, np.nan) for label in (PLANT, *block.observers)]


def _errors(member: Experiment) -> Mapping[str, float]:
    """Of the plant and of the observers; nothing where they cannot be estimated."""
    try:
        return {} if member.grid[0].size > LONG else simulate(member).integration_error or {}
    except HgorunError:
        return {}
