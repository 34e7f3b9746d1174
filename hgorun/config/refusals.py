"""What is wrong with several parts of an input, told at once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager

from hgorun.errors import ConfigError, HgorunError, Problem

_OF_RUN = re.compile(r"^runs\.[^.]*\.")


class Refusals:
    """What is wrong with parts of an input that do not depend on each other, to be told at once.

    Attributes
    ----------
    found : list of ConfigError or Problem
        In the order in which they were found; none twice.
    """

    def __init__(self) -> None:
        self.found: list[ConfigError | Problem] = []

    @contextmanager
    def of_a_part(self) -> Iterator[None]:
        """Keep what is wrong with a part, and go on."""
        try:
            yield
        except (ConfigError, Problem) as error:
            told = set(map(_identity, self.found))
            self.found += [one for one in (error, *error.others) if _identity(one) not in told]

    def refuse(self) -> None:
        """Raise the first, with the others; nothing where there is none.

        A problem, whose place in the file is not known yet, is raised before errors: whoever knows the file tells all.

        Raises
        ------
        ConfigError or Problem
        """
        if not self.found:
            return
        first = next((one for one in self.found if isinstance(one, Problem)), None)
        if first is not None:
            first.others = tuple(one for one in self.found if one is not first)
            raise first
        leading, *others = (one for one in self.found if isinstance(one, ConfigError))
        leading.others = ()
        leading.add_others(others)
        raise leading


def _identity(fault: ConfigError | Problem) -> tuple[object, ...]:
    """What two faults have to share to be one."""
    return (fault.path, fault.message) if isinstance(fault, Problem) else (str(fault),)


def of_other_blocks(told: Sequence[ConfigError], checks: Iterable[Callable[[], object]]) -> Iterator[ConfigError]:
    """What checks find in other blocks of a configuration than the faults that are told; of each block its first.

    Parameters
    ----------
    told : sequence of ConfigError
    checks : iterable of callable
        Each of a part that can be wrong whatever else is. They are carried out as their faults are asked for.
    """
    seen = {block_of(one) for one in told}
    for check in checks:
        try:
            check()
        except ConfigError as error:
            new = [other for other in (error, *error.others) if block_of(other) not in seen]
            seen |= {block_of(other) for other in new}
            yield from new
        except HgorunError:  # said when it is the first
            continue


def block_of(error: ConfigError) -> tuple[str, ...]:
    """The block that a fault is in; of an observer its own."""
    keys = within_run(error.key or "").split(".")
    return tuple(keys[: 2 if keys[0] == "observers" else 1])


def within_run(key: str) -> str:
    """A key as a configuration of one run has it."""
    return _OF_RUN.sub("", key)
