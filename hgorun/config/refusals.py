"""What is wrong with several parts of an input, told at once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hgorun.errors import ConfigError


class Refusals:
    """What is wrong with parts of an input that do not depend on each other, to be told at once.

    Attributes
    ----------
    found : list of ConfigError
        In the order in which they were found; none twice.
    """

    def __init__(self) -> None:
        self.found: list[ConfigError] = []

    @contextmanager
    def of_a_part(self) -> Iterator[None]:
        """Keep what is wrong with a part, and go on."""
        try:
            yield
        except ConfigError as error:
            told = {str(one) for one in self.found}
            self.found += [one for one in (error, *error.others) if str(one) not in told]

    def refuse(self) -> None:
        """Raise the first, with the others; nothing where there is none.

        Raises
        ------
        ConfigError
        """
        if self.found:
            first, *others = self.found
            first.others = ()
            first.add_others(others)
            raise first
