"""Measurement logs as text, and what is read of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording

LOG = {"file": "log.csv", "time": "t", "outputs": {"S": "glucose"}}


def recorded(folder: Path, content: str | bytes, changes: dict[str, Any] | None = None, **options: Any) -> Recording:
    """What is read of a file ``log.csv`` with these contents."""
    folder.mkdir(exist_ok=True)
    (folder / "log.csv").write_bytes(content.encode() if isinstance(content, str) else content)
    return read(Data.model_validate(LOG | (changes or {})), folder, **options)


def noisy(count: int = 40, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Times and values without any fault."""
    random = np.random.default_rng(seed)
    times = np.round(np.cumsum(random.uniform(0.5, 1.5, count)), 3)
    return times, np.round(20 + 5 * np.sin(times / 5) + random.normal(size=count), 4)


def table(times: np.ndarray, values: np.ndarray) -> str:
    """As a CSV file with the columns t and glucose."""
    return "t,glucose\n" + "".join(f"{t!r},{v!r}\n" for t, v in zip(times.tolist(), values.tolist(), strict=True))
