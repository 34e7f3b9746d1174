"""``hgorun`` and ``python -m hgorun``."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


def run() -> None:
    """The entry point of the command."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)  # until more is imported, there is nothing to put in order
    from hgorun.process import run as run_process

    run_process(_command_line)


def _leave(*_: object) -> None:
    os.write(2, b"hgorun: interrupted; no file is left half-written\n")
    os._exit(130)


def _command_line() -> Callable[[], None]:
    from hgorun.cli import main

    return main


if __name__ == "__main__":
    run()
