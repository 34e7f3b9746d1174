"""What nothing in a file tells apart is told: points between digits, numbers for no value, stamps beyond doubles."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from logs import noisy, recorded, table

from hgorun.data.faults.sentinels import sentinels
from hgorun.data.recording import Recording
from hgorun.errors import ConfigError

TIMES, VALUES = noisy()
GROUPED = ("1.234", "12.345", "1.301", "9.876", "15.001", "1.200")


def of_kind(recording: Recording, kind: str) -> list[str]:
    return [str(note).partition("log.csv")[2] for note in recording.notes if note.kind == kind]


def rows(values: tuple[str, ...], separator: str = ";", more: str = "") -> str:
    head = separator.join(("t", "glucose", *(["other"] if more else [])))
    lines = (separator.join((str(k), value, *([more] if more else []))) for k, value in enumerate(values))
    return "\n".join([head, *lines, ""])


DOUBTFUL = {
    "nothing tells": (GROUPED, ";", ""),
    "by tabs": (GROUPED, "\t", ""),
    "decimal commas beside": (GROUPED, ";", "0,5"),
    "commas and large numbers beside": (GROUPED, ";", "1500,25"),
    "small ones have no point": (("950", "1.012", "998", "1.100", "1.050"), ",", "0.5"),
}
DECIMALS = {
    "below one": ((*GROUPED, "0.512"), ";", ""),
    "above a thousand": ((*GROUPED, "1234.567"), ";", ""),
    "other lengths": ((*GROUPED, "1.5"), ";", ""),
    "another column shows it": (GROUPED, ";", "12.5"),
    "whole numbers beyond 999": (GROUPED, ";", "1013"),
    "by commas": (GROUPED, ",", ""),
    "zeros that were cut off": (("5", "5.001", "4.999", "5.002"), ",", "7"),
    "too few": (GROUPED[:2], ";", ""),
    "below one far down": ((*GROUPED * 40, "0.512"), ";", ""),
}


@pytest.mark.parametrize("case", DOUBTFUL)
def test_points_that_may_stand_between_thousands_are_told(tmp_path: Path, case: str) -> None:
    values, separator, more = DOUBTFUL[case]
    content = rows(values, separator, more)
    faults: dict[str, Any] = {"faults": {"slips": "report"}}
    (said,) = of_kind(recorded(tmp_path, content, faults), "format")
    first = next(value for value in values if "." in value)
    assert f"column 'glucose': the point in {first} is read as a decimal point" in said
    assert said.endswith('{decimal: "."} that it does not; csv goes below data')
    whole = recorded(tmp_path, content, faults | {"csv": {"thousands": "."}})
    assert whole.outputs["S"].values.tolist() == [int(value.replace(".", "")) for value in values]
    as_read = recorded(tmp_path, content, faults | {"csv": {"decimal": "."}})
    assert as_read.outputs["S"].values.tolist() == [float(value) for value in values]
    assert of_kind(whole, "format") == of_kind(as_read, "format") == []


@pytest.mark.parametrize("case", DECIMALS)
def test_decimals_as_loggers_write_them_are_not(tmp_path: Path, case: str) -> None:
    assert of_kind(recorded(tmp_path, rows(*DECIMALS[case])), "format") == []


STEPS = np.random.default_rng(1).integers(-99, 99, 400).tolist()
RISING = [600 + step for step in STEPS] + [
    800 + k + step // 9 for k, step in zip(range(0, 400, 3), STEPS, strict=False)
]


def pointed(number: int) -> str:
    return f"{number:,}".replace(",", ".")


@pytest.mark.parametrize(
    ("numbers", "line", "number", "beside"),
    [
        (RISING, 469, "1.007", "997"),
        ([2000 - number for number in RISING], 468, "1.003", "993"),
        ([*RISING[:400], 998, 999, 1000, 1001, 1002, 1005], 404, "1.000", "999"),
    ],
)
def test_so_are_those_that_begin_or_end_far_down_with_the_line(
    tmp_path: Path, numbers: list[int], line: int, number: str, beside: str
) -> None:
    faults: dict[str, Any] = {"faults": {"slips": "report"}}
    content = rows(tuple(map(pointed, numbers)), ",")
    (said,) = of_kind(recorded(tmp_path, content, faults), "format")
    assert said.startswith(f":{line}: column 'glucose': the point in {number} beside {beside} is read as a decimal")
    whole = recorded(tmp_path, content, faults | {"csv": {"thousands": "."}})
    assert whole.outputs["S"].values.tolist() == numbers
    as_read = recorded(tmp_path, content, faults | {"csv": {"decimal": "."}})
    assert of_kind(whole, "format") == of_kind(as_read, "format") == []


@pytest.mark.parametrize("separator", [",", ";"])
@pytest.mark.parametrize("unit", [10, 50, 100])
def test_so_are_multiples_of_ten_whose_last_digit_is_always_zero(tmp_path: Path, unit: int, separator: str) -> None:
    random = np.random.default_rng(2)
    numbers = (random.integers(5, 10, 220) * 100).tolist() + (
        random.integers(900 // unit, 1200 // unit, 40) * unit
    ).tolist()
    content = rows(tuple(map(pointed, numbers)), separator)
    faults: dict[str, Any] = {"faults": {"slips": "report"}}
    (said,) = of_kind(recorded(tmp_path, content, faults), "format")
    first = next(k for k, number in enumerate(numbers) if number >= 1000)
    assert said.startswith(f":{first + 2}: column 'glucose': the point in {pointed(numbers[first])} beside ")
    shorter = content.replace(f"{pointed(numbers[first])}\n", f"{pointed(numbers[first])[:-1]}\n")
    assert of_kind(recorded(tmp_path, shorter, faults), "format") == []


def test_so_are_those_that_never_fall_where_a_zero_ends_them(tmp_path: Path) -> None:
    """As decimals they would have three of them throughout: 150.000 beside 1.050."""
    numbers = [*np.random.default_rng(4).integers(20, 190, 220).tolist(), 1048, 1050, 1055, 1061, 150, 1090]
    (said,) = of_kind(recorded(tmp_path, rows(tuple(map(pointed, numbers)), ",")), "format")
    assert said.startswith(f":223: column 'glucose': the point in 1.050 beside {numbers[219]} is read as a decimal")
    for others in (
        [f"{number / 1000:.3f}" if number > 999 else f"{number}.000" for number in numbers],
        [f"{number / 1000:g}" if number > 999 else f"{number}" for number in numbers],
        [f"{number / 1000:.3f}" if number > 999 else "0" for number in numbers],
    ):
        assert of_kind(recorded(tmp_path, rows(tuple(others), ",")), "format") == []


@pytest.mark.parametrize("hole", ["-9999", "9999", "99999.9"])
@pytest.mark.parametrize("place", [2, 300])
def test_a_number_for_no_value_hides_no_thousands(tmp_path: Path, place: int, hole: str) -> None:
    numbers = [pointed(number) for number in (RISING if place > 200 else RISING[400:])]
    numbers[place] = hole
    found = recorded(tmp_path, rows(tuple(numbers), ","), {"faults": {"slips": "report"}})
    assert len(of_kind(found, "format")) == 1
    assert len(of_kind(found, "sentinel")) == 1


def test_a_slip_of_a_thousand_may_be_a_point_between_thousands(tmp_path: Path) -> None:
    random = np.random.default_rng(3)
    rising = [int(800 + 5 * k + step) for k, step in enumerate(random.integers(0, 5, 100))]
    for some in (rising, random.integers(600, 990, 250).tolist() + rising):
        content = rows(tuple(map(pointed, some)), ";")
        with pytest.raises(
            ConfigError, match=r"a factor 1/1000 .*\{slips: report\} .*; column 'glucose': the point in "
        ):
            recorded(tmp_path, content)
        assert recorded(tmp_path, content, {"csv": {"thousands": "."}}).outputs["S"].values.tolist() == some


@pytest.mark.parametrize(
    ("csv", "cell", "sign"),
    [({}, "1.001.101", "."), ({}, "-12.001.101,25", "."), ({"decimal": ","}, "1,001,101.5", ",")],
)
def test_a_number_with_several_signs_between_thousands_is_told(
    tmp_path: Path, csv: dict[str, str], cell: str, sign: str
) -> None:
    with pytest.raises(ConfigError, match=rf'; for signs between thousands: csv: {{thousands: "\{sign}"}}; csv goes'):
        recorded(tmp_path, f"t;glucose\n0;1\n1;{cell}\n", {"csv": csv})


@pytest.mark.parametrize(
    "falls",
    [
        ["900", "1.5", "1.25", "1.75"],  # other decimals
        ["900", "1.512", "1.513"],  # too few
        ["900", "400.25", "30.125", "1.125", "1.5"],  # as they fall
        ["900", "1.2345", "1.5", "1.25"],
        ["900", "0.512", "1.234", "1.235"],
        ["1200", "1.234", "1.235", "1.236"],
    ],
)
def test_a_column_that_falls_by_itself_is_not(tmp_path: Path, falls: list[str]) -> None:
    content = rows((*map(str, RISING[:400]), *falls), ",")
    assert of_kind(recorded(tmp_path, content, {"faults": {"slips": "report"}}), "format") == []


@pytest.mark.parametrize(
    ("number", "places"), [(-9999.0, [7]), (-999.0, [0]), (999999.0, [39]), (-99.9, [3, 20]), (9999.0, [*range(8, 14)])]
)
def test_a_number_for_no_value_is_told_with_its_line(tmp_path: Path, number: float, places: list[int]) -> None:
    values = VALUES.copy()
    values[places] = number
    content = table(TIMES, values)
    (said,) = of_kind(recorded(tmp_path, content), "sentinel")
    count = "1 value is" if len(places) == 1 else f"{len(places)} values are"
    assert said.startswith(f":{places[0] + 2}: outputs.S: {count} {number:g}, far outside of the others (")
    assert f"csv: {{missing: [{number:g}]}}; csv goes below data" in said
    left = recorded(tmp_path, content, {"csv": {"missing": [number]}})
    assert left.outputs["S"].values.tolist() == np.delete(VALUES, places).tolist()
    assert of_kind(left, "sentinel") == []


def test_it_is_compared_as_the_file_writes_it_and_only_where_it_is_used(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[7] = -9999
    column: dict[str, Any] = {"column": "glucose", "unit": "mg/L"}
    content = table(TIMES, values)
    assert len(of_kind(recorded(tmp_path, content, {"outputs": {"S": column}}, units={"S": "g/L"}), "sentinel")) == 1
    for more in ({"plausible": [0, 1]}, {"quality": {"column": "glucose", "good": VALUES.tolist()}}):
        found = recorded(tmp_path, content, {"outputs": {"S": column | more}}, units={"S": "g/L"})
        assert of_kind(found, "sentinel") == []


OTHERS = [3.4028234663852886e38, -3.4028235e38, 1e31, 1e38, 9.9e37, -999.25, 4294967295, 99999.9]
OTHERS += [9.91e37, 2.0**63 - 1, -(2.0**63), 2.0**64 - 1, 3276.7, -3276.8, 6553.5, 327.67, -327.68, 655.35]
LARGEST = [1.797e308, -1.7976931348623157e308, 1e301]


@pytest.mark.parametrize(
    ("values", "found"),
    [
        ([5, 5, -9999, 5, 5], [-9999]),
        ([0, 0, 999, 999, 0, 0], []),  # a step of what is measured
        ([300, 2, 700, -999, 1000], [-999]),
        ([300, -400, 700, -999, 1000], []),
        ([0, 500, 998, 999, 700], []),
        ([1, 2, np.nan, -9999, 9999, 3], [-9999, 9999]),
        ([1.5, 2, 1e30, 3, 2], [1e30]),
        ([1, 1.1, -9999, 1.2, -999, 1.3, 9999, 1.4, 1e30, 1.2], [-9999, -999, 1e30, 9999]),  # none hides another
        ([1, 1.1, -9999, 1.2, -9998, 1.3], [-9999, -9998]),
        ([0, 0, 0, 99, 99, 99, -9999, 0, 0, 0], [-9999]),
        ([*[-99, 99] * 10, 5], []),  # switched between the two
        ([*[-99, 99] * 10, -9999], [-9999]),
        ([*[-32768] * 5, *[32767] * 5] * 3, []),
        ([10, 11, 12, 11, *[99] * 5], []),  # a valve
        ([*[10, 11, 12, *[99] * 3] * 4], []),
        ([*[3000, 3007, 3014] * 5, *[65535] * 9], []),
        ([10, 11, 12, 11, *[9999] * 5], [9999]),
        ([10, *[99] * 5, 11, *[99] * 5, 12, *[99] * 5], [99]),  # a slower rate
        ([*[10, 11, 12] * 20, *[99] * 5], [99]),  # seldom
        ([2, -1, 1, -2, *[-99] * 5], []),
        *(([1, 1.1, number, 1.2, 0.9], [number]) for number in OTHERS),
        *(([1, 1.1, number, 1.2, 0.9], [number]) for number in LARGEST),
        ([1, 1.1, LARGEST[0], 1.2, -LARGEST[0], 0.9], [-LARGEST[0], LARGEST[0]]),
        (3 * [*[-LARGEST[0]] * 5, *[LARGEST[0]] * 5], []),
        ([*[320, 322, 325] * 5, *[327.67] * 9], []),
        ([322.1, 325.4, 327.67, 326.1, 323.3], []),
        *(([number, 2 * number, 1.5 * number, 1.6 * number], []) for number in OTHERS),
        ([1, 2, -9999], []),
        ([-9999, -9999], []),
        ([np.nan, np.nan], []),
        ([], []),
    ],
)
def test_others_are_measured(values: list[float], found: list[float]) -> None:
    assert [number for number, *_ in sentinels(np.array(values, dtype=float))] == found


@pytest.mark.parametrize("cell", ["9.91E+37", "-9223372036854775808", "18446744073709551615", "1.797e308", "3276.7"])
def test_what_is_said_of_such_a_number_leaves_it_out(tmp_path: Path, cell: str) -> None:
    content = table(TIMES, VALUES).replace(f"{VALUES.tolist()[7]!r}\n", f"{cell}\n", 1)
    (said,) = of_kind(recorded(tmp_path, content), "sentinel")
    assert said.startswith(":9: outputs.S: 1 value is ")
    advice = yaml.safe_load(said[said.index("{missing:") : said.index("}; csv goes") + 1])
    left = recorded(tmp_path, content, {"csv": advice})
    assert left.outputs["S"].values.tolist() == np.delete(VALUES, 7).tolist()
    assert of_kind(left, "sentinel") == []


def test_a_number_larger_than_any_is_refused_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r":9: glucose: '1.8e308' is larger than any number"):
        recorded(tmp_path, table(TIMES, VALUES).replace(f"{VALUES.tolist()[7]!r}\n", "1.8e308\n", 1))


NANOSECONDS = 1732800000123456789


@pytest.mark.parametrize(
    ("stamps", "clock", "said"),
    [
        ([NANOSECONDS + 300 * k for k in range(9)], {"unit": "ns"}, "rounded to multiples of 256"),
        ([NANOSECONDS + 300 * k for k in range(9)], {"unit": "ns", "format": "unix"}, "rounded to multiples of 256"),
        ([f"17328000{k:02d}.12345678" for k in range(9)], {}, ""),
        (
            [f"1732800000.{12345000 + 1000 * k}" for k in range(9)],
            {"format": "unix"},
            "rounded to multiples of 2.38e-07",
        ),
        ([NANOSECONDS + 10**6 * k for k in range(9)], {"unit": "ns"}, ""),
        ([NANOSECONDS // 1000 + k for k in range(9)], {"unit": "us"}, ""),
        ([300 * k for k in range(9)], {"unit": "ns"}, ""),
    ],
)
def test_stamps_whose_steps_doubles_round_are_told(
    tmp_path: Path, stamps: list[int | str], clock: dict[str, str], said: str
) -> None:
    content = "t,glucose\n" + "".join(f"{stamp},{k % 3}\n" for k, stamp in enumerate(stamps))
    notes = of_kind(recorded(tmp_path, content, {"time": {"column": "t"} | clock}), "clock")
    assert [said in note for note in notes] == ([True] if said else [])


@pytest.mark.parametrize(
    ("stamps", "apart"),
    [
        ([NANOSECONDS + 100 * k for k in range(9)], "256"),
        ([f"1732800000.{123456700 + 100 * k}" for k in range(9)], "2.38e-07"),
        ([NANOSECONDS, NANOSECONDS + 1], "256"),
        ([NANOSECONDS + 10**9 * k for k in range(4)] + [NANOSECONDS + 3 * 10**9 + 1], "256"),
        ([1, 2, 3, 3], ""),
        (["0.1", "0.2", "0.2"], ""),
        (["1732800000.1", "1732800000.2", "1732800000.2"], ""),
    ],
)
def test_equal_stamps_may_be_so_only_as_doubles(tmp_path: Path, stamps: list[int | str], apart: str) -> None:
    content = "t,glucose\n" + "".join(f"{stamp},{k % 3}\n" for k, stamp in enumerate(stamps))
    with pytest.raises(ConfigError, match="has come before, on line") as caught:
        recorded(tmp_path, content)
    said = f"rounded, to multiples of {apart} here: numbers that count from the first one, or dates as text, are exact"
    assert (said in caught.value.message) is bool(apart)
