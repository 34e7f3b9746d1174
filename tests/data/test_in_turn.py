"""Two signals in turn in one column are told of; what switches at every sample is none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from logs import recorded, table
from test_healthy_logs import HEALTHY

from hgorun.data.in_turn import in_turn

K = np.arange(600.0)
NOISE = np.random.default_rng(6).normal(size=600)
WARM = 20 + 4 * np.sin(K / 90) + 0.02 * NOISE
HOT = 300 + 30 * np.cos(K / 150 + 1) + 0.2 * np.roll(NOISE, 7)
FIRST = K % 2 == 0
TWO = np.where(FIRST, WARM, HOT).round(2)


def notes(folder: Path, values: np.ndarray, **more: Any) -> list[str]:
    found = recorded(folder, table(K[: values.size], values), {"outputs": {"S": {"column": "glucose"} | more}})
    return [str(note) for note in found.notes if note.kind == "tags"]


def test_large_numbers_are_told_with_the_digits_that_tell_them_apart(tmp_path: Path) -> None:
    (said,) = notes(tmp_path, 6e6 + TWO)
    between = [float(end) for end in said.partition("plausible: ")[2].partition("]")[0].strip("[").split(",")]
    right = recorded(tmp_path, table(K, 6e6 + TWO), {"outputs": {"S": {"column": "glucose", "plausible": between}}})
    np.testing.assert_array_equal(right.outputs["S"].values, (6e6 + TWO)[FIRST])


def test_two_signals_in_turn_are_told_and_what_is_advised_takes_one(tmp_path: Path) -> None:
    (said,) = notes(tmp_path, TWO)
    place, told = said.split(": outputs.S: ")
    assert place == f"{tmp_path / 'log.csv'}:3"
    start, _, advised = told.partition("plausible: ")
    assert start.startswith("two signals may take turns in this column, row by row (")
    assert f"({TWO[0]:g}, {TWO[1]:g}, {TWO[2]:g}, ...)" in start
    between = [float(end) for end in advised.partition("]")[0].strip("[").split(",")]
    right = recorded(tmp_path, table(K, TWO), {"outputs": {"S": {"column": "glucose", "plausible": between}}})
    np.testing.assert_array_equal(right.outputs["S"].values, TWO[FIRST])
    assert notes(tmp_path, TWO, plausible=between) == []


def test_rows_that_are_lost_and_cells_that_are_empty_do_not_hide_them(tmp_path: Path) -> None:
    values = np.delete(TWO, [40, 101, 102, 300, 431])
    values[50] = np.nan
    assert len(notes(tmp_path, values)) == 1


def test_of_an_input_another_thing_is_right(tmp_path: Path) -> None:
    text = "t,glucose,u\n" + "".join(f"{k},{x},{u}\n" for k, x, u in zip(K, WARM.round(2), TWO, strict=True))
    found = recorded(tmp_path, text, {"inputs": {"u": "u"}})
    (said,) = [note.message for note in found.notes if note.kind == "tags"]
    assert said.endswith("an input needs a file with its own rows")


HALF = np.where(FIRST, 1.0, -1.0)
NOT_TWO = {
    "one of them": WARM,
    "square wave": np.where(FIRST, 0.0, 100.0),
    "square wave with noise": np.where(FIRST, 0.0, 100.0) + NOISE,
    "square wave whose supply sinks": np.where(FIRST, 0.0, 100 - 0.02 * K) + 0.01 * NOISE,
    "hum on top of a signal": WARM + 100 * HALF,
    "hum that grows and falls": HALF * (100 + 20 * np.sin(K / 90)) + 0.02 * NOISE,
    "hum whose mean goes with its height": (1 + 0.2 * np.sin(K / 90)) * (50 + 30 * HALF) + 0.02 * NOISE,
    "pulses of two samples": np.where(K % 4 < 2, WARM, HOT),
    "pulses of any width": np.where(np.sin(K**2 / 50) > 0, WARM, HOT),
    "signals that are not far apart": np.where(FIRST, WARM, WARM + 3 + np.cos(K / 40)),
    "noise": 5 * NOISE,
    "numbers of all sizes": np.where(FIRST, -1e308 * (1 + 0.1 * np.sin(K / 90)), 1.5e308),
    "few rows": TWO[:50],
    "hardly in turn": np.where(np.arange(600) % 15 < 2, HOT, np.where(FIRST, WARM, HOT)),
    "at first alone": np.concatenate([TWO[:500], WARM[:100].repeat(40)]),
    "one signal at rest": np.where(FIRST, WARM, 300.0),
}


@pytest.mark.parametrize("name", NOT_TWO)
def test_of_others_nothing_is_said(name: str) -> None:
    assert in_turn(NOT_TWO[name]) is None


@pytest.mark.parametrize("name", HEALTHY)
def test_nor_of_what_plants_write(name: str) -> None:
    values, digits = HEALTHY[name]
    assert in_turn(values.round(digits)) is None
