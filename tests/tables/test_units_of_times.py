"""Times in tables and for other programs stand with their unit; without one nothing is made up."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
import pytest

from hgorun import Experiment, simulate
from hgorun.analysis.report import analyze
from hgorun.benchmark.benchmark import Entry
from hgorun.benchmark.tables import table
from hgorun.result.result import Result
from hgorun.tables import metrics as tables
from hgorun.tables.axis_names import names_of_points, short_axis, unit_of_axis
from hgorun.tables.latex import latex
from hgorun.tables.tuning import TunedTable
from hgorun.tables.tuning import as_json as tuned_json
from hgorun.tables.tuning import text as tuned_text

STD = "measurement.noise.0.std"
PERIOD, THETA = "measurement.sampling.period", "observers.S.theta"


def experiment(unit: str) -> Experiment:
    config: dict[str, Any] = {
        "time": {"end": 2, "output_step": 0.05, "unit": unit},
        "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
        "observers": {"S": {"type": "shgo", "theta": 2}},
        "solver": {"step": 0.01},
    }
    return Experiment(config)


@pytest.fixture(scope="module")
def result() -> Result:
    return simulate(experiment("h"))


def test_of_a_run(result: Result) -> None:
    text = " ".join(tables.text([result]).split())
    assert "settling: 5 % of peak, in h" in text
    rows = list(csv.DictReader(io.StringIO(tables.csv([result], [{"S": {"delay_bound": 0.5, "theta": 2.0}}]))))
    units = {row["metric"]: row["unit"] for row in rows}
    assert (units["settling"], units["rmse"], units["tv"]) == ("h", "", "")
    assert (units["delay_bound"], units["theta"]) == ("h", "")
    assert "delay_bound [h]" in tables.text([result], [{"S": {"delay_bound": 0.5}}])
    assert tables.as_json(result)["units"] == {"time": "h"}
    assert latex([result], metrics=("settling",)).count("{[}h]") == 2
    assert "{[}" not in latex([result], metrics=("rmse",))


def test_without_a_unit_there_is_none() -> None:
    text = " ".join(tables.text([simulate(experiment("-"))]).split())
    assert "settling: 5 % of peak" in text
    assert ", in" not in text
    assert " -;" not in text


def test_of_an_analysis() -> None:
    found = json.loads(json.dumps(analyze(experiment("min"), []).as_json()))
    assert found["units"] == {"time": "min"}


def test_of_axes() -> None:
    points = [{PERIOD: 0.1, THETA: 2}, {PERIOD: 0.2, THETA: 2}]
    assert names_of_points(points, [PERIOD, THETA], {"time": "h"}) == (
        "",
        ["period = 0.1 h, theta = 2", "period = 0.2 h, theta = 2"],
    )
    levels = [{STD: 0.1}, {STD: 0.2}]
    assert names_of_points(levels, [STD], {STD: "m"}) == ("", ["std = 0.1 m", "std = 0.2 m"])
    assert names_of_points(points, [PERIOD], {})[1] == ["period = 0.1", "period = 0.2"]
    long = [{PERIOD: 0.1, THETA: 2, "measurement.delay_of_a_very_long_name_that_is_long": 1}]
    assert names_of_points(long, list(long[0]), {"time": "h"})[0].startswith("period [h], theta, ")


def test_of_gains_and_quantities() -> None:
    one = np.ones((1, 2))
    found = TunedTable(
        label="S", paths=(PERIOD, THETA), quantities=("settling(S, x1)", "rmse(S, x1)"), goals=2, gains=one, tuned=one,
        tuned_half=one, held_out=one, held_out_half=one, lost=np.zeros(1, dtype=np.int64), confidence=np.ones(1),
        chosen=0, runs=1, budget=1, ended="", seeds=1, held_out_seeds=1, units=("h", ""), of_gains={"time": "h"},
    )  # fmt: skip
    head = " ".join(tuned_text([found]).split())
    assert "period [h] theta settling(S, x1) [h] rmse(S, x1) " in head
    assert tuned_json([found], "a", [])["observers"]["S"]["units"] == {PERIOD: "h", "settling(S, x1)": "h"}


def test_of_a_benchmark() -> None:
    (row,) = csv.DictReader(io.StringIO(table([Entry("p", "calm", "C", "group", refused="no", time_unit="d")])))
    assert (row["time_unit"], row["converged"]) == ("d", "")


def test_an_axis_of_an_output_has_its_name() -> None:
    """Also where it is the only one; two kinds of noise of one output have their whole place."""
    std, delay = "measurement.outputs.phi.noise.0.std", "measurement.outputs.phi.delay"
    assert short_axis(std, [std]) == "std of phi"
    assert [short_axis(axis, [delay, delay.replace("phi", "y")]) for axis in (delay,)] == ["delay of phi"]
    both = [std, std.replace("0", "1")]
    assert [short_axis(axis, both) for axis in both] == ["std of outputs.phi.noise.0", "std of outputs.phi.noise.1"]
    assert short_axis("measurement.delay", ["measurement.delay", delay]) == "delay"
    assert unit_of_axis(delay, {"time": "h"}) == "h"
