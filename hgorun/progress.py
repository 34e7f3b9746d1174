"""How far long work is, told in one style: a bar at a terminal, and plain lines every few seconds elsewhere.

What is over soon shows nothing.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from hgorun.errors import printable

if TYPE_CHECKING:
    from rich.progress import Progress as RichBar

SOON = 0.4  # seconds, after which a bar appears
EVERY = 5.0  # seconds between two lines


class Progress:
    """What is done of a piece of work.

    Parameters
    ----------
    total : float
        How much there is to do.
    what : str
        What is being done.
    unit : str
        What is counted, in the plural; empty where parts of the whole are told.
    show : bool
        Whether anything is shown.
    """

    def __init__(self, total: float, what: str, unit: str = "", *, show: bool = True) -> None:
        self._total, self._what, self._unit, self._show = total, what, unit, show
        self._done, self._failed = 0.0, 0
        self._began, self._first = time.monotonic(), 0.0
        self._started = False
        self._said = self._began
        self._bar: RichBar | None = None

    def update(self, done: float, *, failed: int = 0, what: str | None = None) -> None:
        """Tell how much is done.

        Parameters
        ----------
        done : float
            Of the total, with what was done before this piece of work began.
        failed : int
            How many of those done have failed, or have an estimate without numbers.
        what : str, optional
            What is being done now.
        """
        if not self._started:
            self._started, self._first = True, done
        self._done, self._failed, self._what = done, failed, self._what if what is None else what
        now = time.monotonic()
        if not self._show:
            return
        if _at_a_terminal():
            if self._bar is not None or now - self._began >= SOON:
                self._draw()
        elif now - self._said >= EVERY:
            self._said = now
            print(f"hgorun: {printable(self._what)}: {self.told(now)}", file=sys.stderr, flush=True)

    def told(self, now: float) -> str:
        """In words: part, rate, remaining time and failures."""
        passed, since = now - self._began, self._done - self._first
        words = [f"{100 * min(self._done / self._total, 1.0) if self._total else 100:.0f} %"]
        if self._unit:
            words.append(f"{self._done:.0f} of {self._total:.0f} {self._unit}")
        if since > 0 and passed > 0:
            rate = since / passed
            words += [f"{rate:.3g}/s"] if self._unit else []
            words.append(f"{duration((self._total - self._done) / rate)} left")
        return ", ".join([*words, *([f"{self._failed} lost or failed"] if self._failed else [])])

    def _draw(self) -> None:
        if self._bar is None:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            texts = ("{task.fields[told]}", "{task.description}")
            columns = (BarColumn(), *(TextColumn(text, markup=False) for text in texts))
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.add_task("", total=self._total, told="")
            self._bar.start()
        self._bar.update(
            self._bar.task_ids[0],
            completed=self._done,
            description=printable(self._what),
            told=self.told(time.monotonic()),
        )

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


@contextmanager
def shown(total: float, what: str, unit: str = "", *, show: bool = True) -> Iterator[Progress]:
    """Progress of a piece of work while a block lasts; see :class:`Progress`."""
    progress = Progress(total, what, unit, show=show)
    try:
        yield progress
    finally:
        progress.close()


def duration(seconds: float) -> str:
    """A time to wait: ``40 s``, ``3 min 20 s``, ``2 h 5 min``."""
    whole = max(round(seconds), 0)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def _at_a_terminal() -> bool:
    return sys.stderr.isatty()
