"""The mode of a new file, which temporary files do not get by themselves."""

from __future__ import annotations

import os


def _umask() -> int:
    """The process's file mode mask; asking sets it for a moment, in every thread, so it is asked once."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


FILE_MODE = 0o666 & ~_umask()
