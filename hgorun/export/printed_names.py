"""What everything in the equations of an observer is called, so that no two things are called the same."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hgorun.export.accents import barred, parted
from hgorun.export.observer import Exported
from hgorun.symbolic.states import StateBlock
from hgorun.tables.typeset import symbol

_LETTERS = "abcdghklmqrvw"


@dataclass(frozen=True, eq=False, repr=False)
class PrintedNames:
    r"""The symbols of a document.

    The plant's inputs and outputs keep their names, and states and estimates have hats. What belongs to the observer
    gets a bar where the plant, or another thing of the observer, has that letter: the alpha of the innovation is
    \bar{\alpha} beside an angle of attack that is called alpha.

    Attributes
    ----------
    observer : Exported
    """

    observer: Exported

    @property
    def estimates(self) -> list[str]:
        """Of the plant's states."""
        return [symbol(name, hat=True) for name in self.observer.states]

    @cached_property
    def inputs(self) -> list[str]:
        return [symbol(name) for name in self.observer.plant.model.inputs]

    @cached_property
    def outputs(self) -> list[str]:
        return [symbol(output.name) for output in self.observer.outputs]

    @cached_property
    def _of_blocks(self) -> dict[str, list[str]]:
        """What the entries of the parts of z are called."""
        found, block = dict[str, list[str]](), self.observer.block
        taken = letters([*self.inputs, *self.outputs])
        for name, part in block.states.items():
            if name == "xhat" and block.canonical:
                found[name] = [symbol(f"z{i + 1}", hat=True) for i in range(part.size)]
            elif name == "xhat":
                found[name] = self.estimates
            else:
                letter, below = parted(symbol(name))
                found[name] = _entries(free(letter, taken) + below, part)
        return found

    @cached_property
    def states(self) -> list[str]:
        """What the entries of z are called."""
        return [name for names in self._of_blocks.values() for name in names]

    @property
    def alphas(self) -> list[str]:
        """What the observer has corrected of each output; none where it does not compare with the past."""
        return self._of_blocks.get("alpha", [])

    @cached_property
    def _taken(self) -> set[str]:
        """The letters of plant and states."""
        return letters([*self.inputs, *self.outputs, *self.states])

    @cached_property
    def errors(self) -> list[str]:
        """The innovations, output by output."""
        return self._each("e")

    @cached_property
    def differences(self) -> list[str]:
        """The same before whole periods are taken from them."""
        return self._each("w")

    @cached_property
    def times(self) -> list[str]:
        """The times that the innovations are of."""
        return self._each(r"\tau")

    @property
    def interval(self) -> str:
        """The time between the last two samples."""
        return f"{free('T', self._taken)}_{{k}}"

    @cached_property
    def abbreviation(self) -> str:
        """A letter that nothing else is called by."""
        own = [*self.errors, *self.times]
        if any(output.period is not None for output in self.observer.outputs):
            own += self.differences
        taken = "".join([*self.states, *self.outputs, *self.observer.plant.model.inputs, *self.observer.states, *own])
        return next((letter for letter in _LETTERS if letter not in taken), r"\Lambda")

    def _each(self, letter: str) -> list[str]:
        """A thing of every output; with one output it needs no number."""
        found, count = free(letter, self._taken), len(self.outputs)
        return [f"{found}_{{{i + 1}}}" for i in range(count)] if count > 1 else [found]


def letters(symbols: Collection[str]) -> set[str]:
    """What stands before the indices of symbols."""
    return {parted(one)[0] for one in symbols}


def free(letter: str, taken: Collection[str]) -> str:
    r"""The letter, with a bar where it is taken.

    >>> free("e", {"x"}), free("e", {"e"})
    ('e', '\\bar{e}')
    """
    while letter in taken:
        letter = barred(letter)
    return letter


def _entries(name: str, block: StateBlock) -> list[str]:
    """The entries of an internal state."""
    if block.size == 1 and not block.symmetric:
        return [name]
    base = name if "_" not in name else f"{{{name}}}"
    shape = block.shape[:-1] if len(block.shape) > 1 and block.shape[-1] == 1 else block.shape
    triangle = zip(*np.triu_indices(block.shape[0]), strict=True) if block.symmetric else ()
    pairs = list(triangle) or list(np.ndindex(*shape))
    return [rf"{base}_{{{','.join(str(int(k) + 1) for k in index)}}}" for index in pairs]
