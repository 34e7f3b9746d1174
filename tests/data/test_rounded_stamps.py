"""Stamps that a file has with too few digits for their steps: single precision, and days of few decimals."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from logs import recorded

from hgorun.config.data import Data
from hgorun.data.reading import read
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError

COUNT = 60
RIGHT = "double precision, or dates as text, are right for stamps"


def in_parquet(folder: Path, stamps: np.ndarray, clock: dict[str, str]) -> Recording:
    table = pyarrow.table({"t": stamps, "glucose": np.sin(np.arange(stamps.size))})
    pyarrow.parquet.write_table(table, folder / "log.parquet")
    block = {"file": "log.parquet", "time": {"column": "t", **clock}, "outputs": {"S": "glucose"}}
    return read(Data.model_validate(block), folder)


def said(found: Recording) -> list[str]:
    return [note.message for note in found.notes if note.kind == "clock"]


@pytest.mark.parametrize(
    ("start", "step", "clock", "apart", "usual"),
    [
        (1717163110.0, 600.0, {}, "128", "640"),
        (1717163110.0, 600.0, {"format": "unix"}, "128", "640"),
        (45443.5, 1 / 24, {"format": "excel"}, "0.00391", "0.043"),
        (20000.0, 0.01, {}, "0.00195", "0.00977"),
    ],
)
def test_single_precision_that_rounds_steps_is_told(
    tmp_path: Path, start: float, step: float, clock: dict[str, str], apart: str, usual: str
) -> None:
    stamps = (start + step * np.arange(COUNT)).astype(np.float32)
    (told,) = [one for one in said(in_parquet(tmp_path, stamps, clock)) if "precision" in one]
    rounded = f"numbers of this size in single precision are rounded to multiples of {apart}, and a usual step is "
    assert told == f"column 't': {rounded}{usual}: {RIGHT}"


@pytest.mark.parametrize("stamps", [0.01 * np.arange(COUNT), 16_000_000.0 + np.arange(COUNT), 0.5 * np.arange(9e3)])
def test_single_precision_that_is_enough_is_not_told(tmp_path: Path, stamps: np.ndarray) -> None:
    assert said(in_parquet(tmp_path, stamps.astype(np.float32), {"unit": "s"})) == []


def test_stamps_that_become_equal_are_told_with_the_cause(tmp_path: Path) -> None:
    stamps = (1717163110.0 + 30 * np.arange(COUNT)).astype(np.float32)
    with pytest.raises(ConfigError, match=r"has come before, .* only as it is rounded, to multiples of 128 here"):
        in_parquet(tmp_path, stamps, {})


def test_dates_of_single_precision_are_told_in_seconds(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        hours = 45443.0 + np.arange(COUNT) / 24
        file.create_dataset("t", data=hours.astype(np.float32)).attrs["units"] = "days since 1900-01-01"
        file["glucose"] = np.sin(np.arange(COUNT))
    block = {"file": "log.h5", "time": "t", "outputs": {"S": "glucose"}}
    told = said(read(Data.model_validate(block), tmp_path))
    rounded = (
        "numbers of this size in single precision are rounded to multiples of 338 s, and a usual step is 3.71e+03 s"
    )
    assert told == [f"column 't': {rounded}: {RIGHT}"]


def as_days(step: float, decimals: int, start: float = 45443.572) -> str:
    return "t,glucose\n" + "".join(f"{start + k * step / 86400:.{decimals}f},{k % 3}\n" for k in range(COUNT))


@pytest.mark.parametrize(
    ("step", "decimals", "apart", "usual"),
    [(1.0, 5, "0.864", "0.864"), (60.0, 4, "8.64", "60.5"), (60.0, 5, "0.864", "59.6"), (900.0, 2, "864", "864")],
)
def test_days_of_few_decimals_are_told(tmp_path: Path, step: float, decimals: int, apart: str, usual: str) -> None:
    clock = {"time": {"column": "t", "format": "excel"}}
    (told,) = said(recorded(tmp_path, as_days(step, decimals), {**clock, "faults": {"repeated": "first"}}))
    rounded = (
        f"its days have {decimals} decimals, which round times to multiples of {apart} s, and a usual step is {usual} s"
    )
    assert told == f"column 't': {rounded}: write more decimals, or dates as text"


@pytest.mark.parametrize(
    ("step", "decimals", "start"),
    [(60.0, 9, 45443.572), (3600.0, 5, 45443.5), (21600.0, 2, 45443.0), (86400.0, 0, 45443)],
)
def test_days_of_enough_decimals_are_not_told(tmp_path: Path, step: float, decimals: int, start: float) -> None:
    clock = {"time": {"column": "t", "format": "excel"}}
    assert said(recorded(tmp_path, as_days(step, decimals, start), clock)) == []


def test_of_two_days_nothing_is_known(tmp_path: Path) -> None:
    clock = {"time": {"column": "t", "format": "excel"}}
    assert said(recorded(tmp_path, "t,glucose\n45443.25,1\n45443.26,2\n", clock)) == []
