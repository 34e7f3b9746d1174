"""How far an ensemble is: on a bar, and in a last line where a signal ends the process."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hgorun.ensemble.sweep import Count
from hgorun.process import told_where_ended
from hgorun.progress import Progress


@contextmanager
def counted(
    members: int, name: str, bar: Progress, same: str = "the same command"
) -> Iterator[Callable[[Count], None]]:
    """Give what is to be called with each count, the last of which is told where a signal ends the process.

    Parameters
    ----------
    members : int
    name : str
        Of the ensemble.
    bar : Progress
    same : str
        What goes on with it.
    """
    counts = deque([Count(members, 0)], maxlen=1)

    def told(count: Count) -> None:
        counts.append(count)
        bar.update(count.done, failed=count.failed)

    with told_where_ended(lambda: counts[-1].continued(name, same)):
        yield told
