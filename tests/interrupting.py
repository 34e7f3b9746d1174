"""Ctrl-C while rows are written."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.result.hdf5 import growing


def interrupt_writing(patch: pytest.MonkeyPatch, after: int) -> None:
    """Interrupt whoever appends rows to a file for more than so many times."""
    append, calls = growing.Growing.append, 0

    def interrupted(self: growing.Growing, rows: np.ndarray) -> None:
        nonlocal calls
        calls += 1
        if calls > after:
            raise KeyboardInterrupt
        append(self, rows)

    patch.setattr(growing.Growing, "append", interrupted)
