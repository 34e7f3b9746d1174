"""Stamps that run backwards or come again where sorting, dropping or keeping them would be wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.errors import ConfigError

K = np.arange(40)


def message_of(folder: Path, content: str, clock: object = "t") -> str:
    with pytest.raises(ConfigError) as found:
        recorded(folder, content, {"time": clock})
    return found.value.message


def log(stamps: list[str], separator: str = ",") -> str:
    return f"t{separator}glucose\n" + "".join(f"{stamp}{separator}{k % 7}\n" for k, stamp in enumerate(stamps))


@pytest.mark.parametrize(
    ("stamps", "period", "what"),
    [
        ((K * 7 + 100) % 256, 256, "a counter that is full"),
        (np.round((K * 10 + 4294867.296) % 4294967.296, 3), 4294967.296, "a counter that is full"),
        ((K * 10000 + 2**32 - 50000) % 2**32, 2**32, "a counter that is full"),
        ((K * 10.0 + 86300) % 86400, 86400, "the time of day at midnight"),
        ((K * 15 + 1300) % 1440, 1440, "the time of day at midnight"),
    ],
)
def test_counters_begin_again(tmp_path: Path, stamps: np.ndarray, period: float, what: str) -> None:
    message = message_of(tmp_path, log([repr(one) for one in stamps.tolist()]))
    assert message.endswith(
        f"they may begin again, as {what}: write n + {period:.10g} for each n from here on into the file"
    )


def test_a_unit_of_the_column_is_that_of_the_counter(tmp_path: Path) -> None:
    stamps = [str(one) for one in ((K * 10_000 + 2**32 - 50_000) % 2**32).tolist()]
    assert "write n + 4294967296 for each" in message_of(tmp_path, log(stamps), {"column": "t", "unit": "ms"})


def test_points_between_thousands_are_named(tmp_path: Path) -> None:
    stamps = [f"{60 * k:,}".replace(",", ".") for k in K.tolist()]
    message = message_of(tmp_path, log(stamps, "\t"))
    assert message.endswith(
        'if the point in 1.020 stands between thousands: csv: {thousands: "."}; csv goes below data'
    )


def test_hours_without_minutes_are_named_at_midnight(tmp_path: Path) -> None:
    message = message_of(tmp_path, log([f"{100 * (k % 24)}" for k in range(60)]))
    assert 'its numbers look like hours, since 2300 is followed by 0: format: "%H%M"' in message


def test_times_of_day_as_numbers_are_named_at_midnight(tmp_path: Path) -> None:
    stamps = [f"{(1200 + 15 * k) // 60 % 24 * 100 + 15 * k % 60}" for k in range(40)]
    message = message_of(tmp_path, log(stamps))
    assert 'its numbers look like times, since 2045 is followed by 2100: format: "%H%M" if they are hours' in message


@pytest.mark.parametrize(
    "stamps",
    [[0, 1, 2, 3, 4, 2.5, 6], [0, 5, 1, 2], [0, 1, 2, 3, 100, 200, 300, 5, 6], [5, 5, 5, 5, 4, 3]],
)
def test_of_others_nothing_is_said(tmp_path: Path, stamps: list[float]) -> None:
    assert "begin again" not in message_of(tmp_path, log([repr(one) for one in stamps]))


@pytest.mark.parametrize(
    ("content", "clock", "what"),
    [
        ("date;time;glucose\n31.05.2024;22:45:10;1\n31.05.2024;22:50:10;2\n", "date", "'time' has the time of day"),
        ("t;ms;glucose\n2024-05-31 22:45:10;0;1\n2024-05-31 22:45:10;250;2\n", "t", "'ms' has parts of a second"),
    ],
)
def test_times_in_two_columns_are_named(tmp_path: Path, content: str, clock: str, what: str) -> None:
    form = {"format": "%d.%m.%Y"} if clock == "date" else {}
    message = message_of(tmp_path, content, {"column": clock, **form})
    right = "write a column into the file that has both, such as 2024-05-31 13:45:10.25"
    assert message.endswith(f"column {what}: {right}")


def test_other_columns_are_none_of_time(tmp_path: Path) -> None:
    content = "t;ms;glucose\n2024-05-31 22:45:10;a;1\n2024-05-31 22:45:10;b;2\n"
    assert message_of(tmp_path, content).endswith(
        "faults: {repeated: first}, last, mean or keep if this is known; faults goes below data"
    )
