"""Waiting for what a process has done, not for time, of which a busy machine gives it little."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path


def wait_until_it_computes(process: subprocess.Popen[bytes], seconds: float) -> None:
    """Wait until a process has had this much processor time."""
    usage = Path(f"/proc/{process.pid}/stat")
    if not usage.exists():
        time.sleep(2 * seconds)
        return
    deadline = time.monotonic() + 60
    while process.poll() is None and time.monotonic() < deadline:
        user, system = map(int, usage.read_text().rpartition(")")[2].split()[11:13])
        if (user + system) / os.sysconf("SC_CLK_TCK") > seconds:
            return
        time.sleep(0.01)
