"""Settling times that the integration does not resolve are marked: beside errors that are known in closed form."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import h5py
import numpy as np
import pytest
from examples import Block, inline, simulated

import hgorun
from hgorun import Result
from hgorun.errors import HgorunError
from hgorun.tables import metrics as tables
from hgorun.tables.latex import latex

# x' = -x and an observer with the gain theta: its error is e(0) exp(-(1 + theta) t), which settles below 5 % of e(0) at
# ln(20)/(1 + theta), however small e(0) is
DECAY, THETA, STEP = inline({"x": "-x"}, "x") | {"initial": {"x": 1}}, 1.0, 0.01
EXACT = np.log(20) / (1 + THETA)


def decayed(start: float, step: float | None = 0.01) -> Result:
    observer: Block = {"type": "shgo", "theta": THETA, "initial": {"x": start}}
    return simulated(DECAY, {"S": observer}, end=10.0, output_step=STEP, step=step)


@pytest.fixture(scope="module")
def rounded() -> Result:
    """With an error of 45 roundings, of which 5 % are two."""
    return decayed(1 + 1e-14)


@pytest.mark.parametrize("step", [0.01, None])
@pytest.mark.parametrize("start", [0.5, 1 + 1e-6])
def test_a_time_that_is_right_has_no_mark(start: float, step: float | None) -> None:
    result = decayed(start, step)
    assert abs(result.observers["S"].metrics["settling"][0] - EXACT) <= STEP
    assert result.unresolved == {}
    assert "~" not in tables.text([result])


def test_a_time_that_rounding_decides_has_a_mark(rounded: Result) -> None:
    assert abs(rounded.observers["S"].metrics["settling"][0] - EXACT) > 5 * STEP
    assert rounded.unresolved == {"S": {"settling": ("x",)}}
    assert decayed(1 + 1e-14, None).unresolved == rounded.unresolved


def test_tables_and_json_have_the_mark(rounded: Result) -> None:
    shown = f"{rounded.observers['S'].metrics['settling'][0]:.3f}"
    text = tables.text([rounded])
    assert f" ~{shown}" in text
    assert "~: the integration" in text
    assert tables.as_json(rounded)["observers"]["S"]["unresolved"] == {"settling": ["x"]}
    notes = {row["metric"]: row["note"] for row in csv.DictReader(io.StringIO(tables.csv([rounded])))}
    assert {metric for metric, note in notes.items() if note == "not resolved"} == {"settling"}
    assert rf"$\sim {shown}$" in latex([rounded])
    assert r"}{l}{$\sim$: not resolved by the integration} \\" in latex([rounded])
    assert r"\sim" not in latex([rounded], ["rmse"])


def test_files_keep_the_mark(rounded: Result, tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    rounded.save(path)
    assert hgorun.read(path).unresolved == rounded.unresolved
    with h5py.File(path, "r+") as file:
        file.attrs["unresolved"] = '{"S": {"settling": "x"}}'
    with pytest.raises(HgorunError, match=r"attribute unresolved: S is .* expected metrics with lists of states"):
        hgorun.read(path)


def test_passes_that_differ_by_less_than_the_bound_resolve_it() -> None:
    """Steps of 0.5 are wrong by far more than shorter ones, and by less than 5 % of an error of 0.5."""
    result = decayed(0.5, 0.5)
    assert result.integration_error is not None
    assert result.integration_error["S"] > 0.1
    assert result.unresolved == {}
