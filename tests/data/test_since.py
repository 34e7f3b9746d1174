"""Units that count from a date: those that are read, and what is said of others."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError


def log(folder: Path, units: str, stamps: list[float]) -> Recording:
    with h5py.File(folder / "log.h5", "w") as file:
        file.create_dataset("t", data=np.array(stamps)).attrs["units"] = units
        file["glucose"] = np.arange(len(stamps)) % 3.0
    return read(Data.model_validate({"file": "log.h5", "time": "t", "outputs": {"S": "glucose"}}), folder)


@pytest.mark.parametrize(
    ("units", "step"),
    [
        ("weeks since 2024-01-02", 604800.0),
        ("µs since 2024-01-02", 1e-6),
        ("μs since 2024-01-02", 1e-6),
        ("[hours since 2024-01-02]", 3600.0),
        ("(hours since 2024-01-02 00:00)", 3600.0),
    ],
)
def test_units_as_they_are_written_are_read(tmp_path: Path, units: str, step: float) -> None:
    found = log(tmp_path, units, [0.0, 1.0, 2.0])
    assert np.allclose(found.outputs["S"].taken, [0, step, 2 * step], rtol=1e-12)
    assert found.origin.epoch == np.datetime64("2024-01-02")


@pytest.mark.parametrize(
    ("units", "right"),
    [
        ("hours since 0001-01-01", ": time: {column: t, unit: h}"),
        ("minutes since 2024/01/02", ": time: {column: t, unit: min}"),
        ("[µs since 2024/01/02]", ": time: {column: t, unit: us}"),
        ("weeks since launch", ": time: {column: t, unit: week}"),
        ("seconds since epoch", ": time: {column: t, format: unix}"),
        ("ms since Epoch", ": time: {column: t, format: unix, unit: ms}"),
        ("months since 2024-01-01", ""),
    ],
)
def test_the_unit_that_is_proposed_is_that_of_the_file(tmp_path: Path, units: str, right: str) -> None:
    with pytest.raises(ConfigError) as found:
        log(tmp_path, units, [0.0, 1.0])
    assert found.value.message.endswith(f"; with unit or format the numbers are read as these say{right}")
