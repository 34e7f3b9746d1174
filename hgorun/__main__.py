"""``hgorun`` and ``python -m hgorun``."""

from __future__ import annotations

import gc
import os
import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable


# Libraries read these names when they are loaded. Matrices here are tiny: the threads of a BLAS library would spend
# their time waiting for each other. Long arrays are gone through a few times: large pages gain little there, and many a
# virtual machine has given those that are free back to its host: to get them again takes several times as long.
_SETTINGS = {
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "BLIS_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
    "NUMPY_MADVISE_HUGEPAGE": "0",
}
_GARBAGE = 200_000  # objects between two collections: while modules are imported they find nothing, and cost 10 %


def run() -> None:
    """The entry point of the command.

    Python ends with collections that look at every object, a tenth of a short run, and whose memory the end of the
    process returns anyway: they find nothing to look at.
    """
    gc.set_threshold(_GARBAGE, 20, 50)
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)  # until more is imported, there is nothing to put in order
    from hgorun.process import run as run_process

    try:
        run_process(_command_line)
    finally:
        gc.freeze()


def _leave(*_: object) -> None:
    os.write(2, b"hgorun: interrupted; no file is left half-written\n")
    os._exit(130)


def _command_line() -> Callable[[], None]:
    from hgorun.cli import main

    return main


if __name__ == "__main__":
    run()
