"""Statistics of ensembles as tables."""

from __future__ import annotations

import csv as csv_module
import io
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from hgorun.ensemble.collected.collected import Collected, last_point
from hgorun.ensemble.notebook import as_html
from hgorun.tables.ensemble import best, compared, text
from hgorun.tables.ensemble_data import as_json, csv
from hgorun.tables.ensemble_latex import latex
from hgorun.tables.uncertain import latex_uncertain, uncertain


def drawn(*, gap: float = 0.5, lost: int = 0) -> Collected:
    """The same members with seeds alone."""
    return replace(made(gap=gap, lost=lost), axes={"seed": np.arange(60)})


def made(seeds: int = 30, *, gap: float = 0.5, lost: int = 0) -> Collected:
    """Two gains, some seeds; F is better than S by a gap."""
    random = np.random.default_rng(1)
    theta, seed = np.repeat([2.0, 4.0], seeds), np.tile(np.arange(seeds), 2)
    noise = random.normal(size=(2 * seeds, 1, 2))
    values = (
        theta[:, None, None] + 0.2 * noise + np.array([0.0, gap])[:, None] + 0.01 * random.random((2 * seeds, 2, 2))
    )
    status = np.zeros((2 * seeds, 2), dtype=np.int8)
    status[:lost, 0] = 2
    values[:lost, 0] = np.inf
    return Collected(
        name="made",
        axes={"observers.F.theta": theta, "seed": seed},
        observers=("F", "S"),
        states=("x1", "x2"),
        metrics={"rmse": values, "tv": values},
        status=status,
        error=np.full(2 * seeds, "", dtype=object),
        planned=2 * seeds,
    )


@pytest.mark.parametrize(
    ("value", "half", "shown"),
    [
        (0.123456, 0.0056, "0.1235 ± 0.0056"),
        (123456.0, 1234.0, "123500 ± 1200"),
        (-1.5, 0.25, "-1.50 ± 0.25"),
        (0.0, 0.01, "0.000 ± 0.010"),
        (6.4e-4, 2.2e-5, "0.000640 ± 0.000022"),
        (3e-7, 1.5e-6, "(0.3 ± 1.5)e-06"),
        (1.0, 1.2e-9, "1.0000000000 ± 0.0000000012"),
        (1.0, 1e-16, "1.00000000000000 ± 1.0e-16"),
        (2.0, 0.0, "2.000"),
        (2.0, math.nan, "2.000"),
        (math.inf, math.nan, "inf"),
    ],
)
def test_numbers_have_the_digits_that_their_uncertainty_leaves(value: float, half: float, shown: str) -> None:
    assert uncertain(value, half) == shown


def test_uncertain_numbers_in_latex() -> None:
    assert latex_uncertain(0.123456, 0.0056) == r"$0.1235 \pm 0.0056$"
    assert latex_uncertain(1.0, 1e-16) == r"$1.00000000000000 \pm 1.0 \times 10^{-16}$"
    assert latex_uncertain(math.inf, math.nan) == r"$\infty$"
    assert latex_uncertain(math.nan, math.nan) == "--"


def test_text_has_every_statistic_and_the_failures() -> None:
    shown = text([compared(drawn(lost=3), ())])
    head = next(line for line in shown.splitlines() if line.startswith("rmse"))
    assert head.split() == ["rmse", "mean", "±", "sem", "q05", "q25", "median", "q75", "q95"]
    assert "60 members; seed 0 to 59 (60 values)" in shown
    assert "F: 3 diverged" in shown
    assert "F - S" in shown
    assert all(len(line) <= 100 for line in shown.splitlines())


def test_an_ensemble_divided_by_an_axis() -> None:
    found = compared(made(lost=2), ["observers.F.theta"], ["rmse"])
    shown = text([found])
    row = next(line for line in shown.splitlines() if line.startswith("theta = 2"))
    summary = found.points[0].summaries["F", "rmse", "x1"]
    assert f"{uncertain(summary.mean, summary.half)} (2)" in row
    assert "tv" not in shown
    points = as_json(found)["points"]
    assert [p["at"] for p in points] == [{"observers.F.theta": 2.0}, {"observers.F.theta": 4.0}]
    assert [p["observers"]["F"]["failed"] for p in points] == [2, 0]


def test_rows_of_axes_that_end_alike_have_names_of_their_own() -> None:
    members = made()
    theta = members.axes["observers.F.theta"]
    axes = {"observers.FHGO.theta": theta, "observers.SHGO.theta": np.tile([5.0, 7.0, 9.0], 20)}
    shown = text([compared(replace(members, axes=axes), list(axes), ["rmse"])])
    rows = {line[: line.index("  ")] for line in shown.splitlines() if " = " in line}
    assert "theta of FHGO = 2, theta of SHGO = 5" in rows
    assert len(rows) == 6


def test_rows_tell_points_apart_however_long_or_near_they_are() -> None:
    members = made()
    kind = np.array([f"{'a' * 45}{i % 3}{'b' * 45}" for i in range(60)], dtype=object)
    near = np.where(members.axes["observers.F.theta"] > 2, 1.00001, 1.00002)
    axes = {"plant.parameters.a_long_name_of_a_parameter": kind, "plant.parameters.near": near}
    shown = text([compared(replace(members, axes=axes), list(axes), ["rmse"])])
    assert "rows: a_long_name_of_a_parameter, near" in shown
    rows = [line.split("  ")[0] for line in shown.splitlines() if line.startswith("aaa")]
    assert len(set(rows)) == 6


def test_numbers_that_are_not_known_are_dashes() -> None:
    shown = text([compared(made(lost=60), (), ["rmse"])])
    assert "nan" not in shown


def test_members_that_are_pooled_have_no_intervals_and_the_table_says_why() -> None:
    found = compared(made(), (), ["rmse"])
    shown = " ".join(text([found]).split())
    assert "pooled over all values of theta, which were chosen and not drawn" in shown
    assert "--by AXIS" in shown
    assert not any(sign in shown for sign in ("±", "*", "95 %"))
    assert r"\pm" not in latex([found])
    assert as_json(found)["pooled"] == ["observers.F.theta", "seed"]
    assert as_json(found)["paired"][0]["p_holm"] is None
    divided = text([compared(made(), ["observers.F.theta"], ["rmse"])])
    assert "pooled" not in divided
    assert "±" in divided


def test_json_has_the_keys_that_were_promised() -> None:
    found = json.loads(json.dumps(as_json(compared(made(lost=1), (), file="m.sweep.h5")), allow_nan=False))
    assert (found["name"], found["members"], found["file"]) == ("made", 60, "m.sweep.h5")
    assert found["status"] == "diverged"
    assert set(found["observers"]["F"]["rmse"]["x1"]) == {
        "mean", "median", "sem", "ci95", "q05", "q25", "q75", "q95", "n"
    }  # fmt: skip
    assert found["observers"]["F"]["failed"] == 1
    assert found["observers"]["F"]["statuses"] == {"ok": 59, "diverged": 1}
    assert {(d["a"], d["b"], d["metric"], d["state"], d["n"]) for d in found["paired"]} == {
        ("F", "S", metric, state, 59) for metric in ("rmse", "tv") for state in ("x1", "x2")
    }


def test_csv_has_all_digits() -> None:
    members = made()
    rows = list(csv_module.DictReader(io.StringIO(csv([compared(members, ["observers.F.theta"])]))))
    first = next(r for r in rows if (r["observer"], r["metric"], r["state"]) == ("F", "rmse", "x2"))
    assert float(first["mean"]) == pytest.approx(members.metrics["rmse"][:30, 0, 1].mean(), rel=1e-14)
    assert first["observers.F.theta"] == "2.0"
    difference = next(r for r in rows if r["observer"] == "F - S")
    assert float(difference["p_holm"]) < 1e-9
    assert difference["median"] == ""


def test_bold_is_what_is_significantly_best() -> None:
    clear, chance, failing = (compared(one, ()) for one in (drawn(gap=0.5), drawn(gap=0.0), drawn(lost=1)))
    assert best(clear.whole, "rmse", "x1") == "F"
    assert best(chance.whole, "rmse", "x1") is None
    assert best(failing.whole, "rmse", "x1") is None  # who drops out looks better than he is
    assert latex([clear, clear]).count("% needs \\usepackage{booktabs}\n\\begin{tabular}") == 1
    assert latex([clear]).count(r"\mathbf") == 4
    said = re.findall(r"\{l\}\{(.*)\} ", latex([clear]))
    assert said[1:] == [
        "bold: the best mean, which differs from all others (paired tests,",
        r"Holm-adjusted p \textless{} 0.05)",
    ]
    assert not re.search(r"\\mathbf|bold", latex([chance]))
    assert "F: 1 of 60 without numbers" in latex([failing])


def test_latex_has_units_members_and_mathematics() -> None:
    members = replace(made(), units={"x1": "g/L^2", "time": "h"})
    table = latex([compared(members, ["observers.F.theta"], ["rmse"])])
    assert r" & {[}g/L$^{2}$] &  \\" in table
    assert r"$\theta$ $= 2$" in table
    assert r"mean $\pm$ 95 \% interval of 30 members (seed)" in table
    both = {"observers.F.theta": members.axes["observers.F.theta"], "observers.S.theta": np.tile([1e-7, 2e-7], 30)}
    table = latex([compared(replace(members, axes=both), list(both), ["rmse"])])
    assert r"$\theta$ of F $= 2$, $\theta$ of S $= 1 \times 10^{-7}$" in table
    kinds = {"observers.F.type": np.array(["fhgo_2", "shgo"] * 30, dtype=object)}
    assert r"$\mathrm{type}$ = fhgo\_2" in latex([compared(replace(members, axes=kinds), list(kinds), ["rmse"])])


def test_latex_rows_have_one_width() -> None:
    made_rows = [
        line
        for line in latex([compared(made(), ["observers.F.theta"])]).splitlines()
        if "&" in line and "multicolumn" not in line
    ]
    assert {line.count("&") for line in made_rows} == {2}


def test_many_values_of_an_axis_are_told_by_their_ends() -> None:
    found = as_json(compared(made(1001), ()))
    assert found["axes"]["seed"] == {"first": 0, "last": 1000, "count": 1001}
    assert found["axes"]["observers.F.theta"] == [2.0, 4.0]


@pytest.mark.parametrize(("fast", "never"), [(0.03, True), (1e-4, False)])
def test_a_settling_time_that_noise_decides_has_no_mean_and_no_star(fast: float, never: bool) -> None:
    """F's error is lifted above 5 % of its peak by noise: its last such time is a chance of the last samples."""
    members = drawn()
    one = np.ones_like(members.metrics["rmse"])
    hf = one * np.array([fast, 1e-4])[:, None]
    numbers = {"sup": 0.1 * one, "peak": one, "hf": hf, "settling": members.metrics["rmse"]}
    found = compared(replace(members, metrics=numbers), (), ["settling"])
    shown = text([found])
    assert ("never" in shown, "*" in shown.partition("F - S")[2].partition("paired")[0]) == (never, not never)
    assert ("settling: never, where noise lifts the error" in shown) == never
    tabular = latex([found])
    assert ("never" in tabular, r"\mathbf" in tabular) == (never, not never)
    assert found.whole.summaries["F", "settling", "x1"].mean == pytest.approx(members.metrics["rmse"][:, 0, 0].mean())
    assert not compared(replace(members, metrics=numbers, settling=0.5), (), ["settling"]).whole.never


@pytest.mark.parametrize(("late", "word"), [(1.0, "never"), (0.25, "members never settle"), (0.0, "")])
def test_the_end_of_the_run_is_not_a_settling_time(late: float, word: str) -> None:
    members = drawn()
    size = len(members)
    values = np.full_like(members.metrics["rmse"], 3.0)
    values[: round(late * size), 0] = 24.9
    numbers = {"settling": values}
    found = compared(replace(members, metrics=numbers, end=24.9 - 1e-7), (), ["settling"])
    shown = text([found])
    assert ("never" in shown) == bool(word)
    assert word in shown
    if 0 < late < 1:
        assert f"settling of F x1: {round(late * size)} of {size}" in " ".join(shown.split())
    assert not compared(replace(members, metrics=numbers), (), ["settling"]).whole.never  # ends that differ


def test_a_long_label_leaves_states_and_units_their_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    long = "a very long label that nobody would want to have in a legend but has"
    units = {"x1": "m^3/(kg h)", "x2": "%"}
    shown = text([compared(replace(drawn(), observers=(long, "S"), units=units), (), ["rmse"])])
    for row in ("rmse x1 [m^3/(kg h)]  ", "rmse x2 [%]  ", "a very long la…legend but has - S"):
        assert row in shown
    assert max(map(len, shown.splitlines())) <= 100


def late(counts: dict[float, int]) -> Collected:
    """At each theta so many members of F in x1 settle at the end of the run, at 24.9; all others at 3."""
    members = made()
    values = np.full_like(members.metrics["rmse"], 3.0)
    for theta, count in counts.items():
        values[np.flatnonzero(members.axes["observers.F.theta"] == theta)[:count], 0, 0] = 24.9
    return replace(members, metrics={"settling": values}, end=24.9 - 1e-7, units={"time": "s"})


def one_line(shown: str) -> str:
    return " ".join(shown.split())


def test_rows_tell_which_times_never_come_and_how_many_a_mean_counts() -> None:
    found = compared(late({2.0: 7, 4.0: 29}), ("observers.F.theta",))
    shown = one_line(text([found]))
    assert "theta = 4 never" in shown
    assert "settling: never, where noise lifts the error" in shown
    assert "settling of F x1: 7 of 30 members never settle, in the row with most of them; they count with" in shown
    assert "never" not in text([compared(late({}), ("observers.F.theta",))])
    worse = one_line(text([compared(late({2.0: 7, 4.0: 9}), ("observers.F.theta",))]))
    assert "settling of F x1: 9 of 30 members never settle" in worse
    assert "settling: never" not in worse


@pytest.mark.parametrize("by", [(), ("observers.F.theta",)])
def test_latex_tells_of_times_that_never_come(by: tuple[str, ...]) -> None:
    members = late({2.0: 7, 4.0: 9})
    tabular = latex([compared(members, by)])
    below = tabular.rpartition("\\midrule")[2].partition("\\bottomrule")[0].splitlines()
    lines = [line.removeprefix("\\multicolumn{3}{l}{").removesuffix("} \\\\") for line in below if line]
    assert max(map(len, lines)) < 80
    most, size = (9, 30) if by else (16, 60)
    assert f"settling of F x1: {most} of {size} members never settle" in " ".join(lines)
    assert "settling: never" in one_line(latex([compared(late({4.0: 30}), ())]))
    assert "settle" not in latex([compared(replace(members, metrics={"rmse": members.metrics["settling"]}), by)])


def test_csv_and_json_count_times_that_never_come() -> None:
    found = compared(late({2.0: 7, 4.0: 29}), ("observers.F.theta",))
    rows = list(csv_module.DictReader(io.StringIO(csv([found]))))
    counts = {(row["observers.F.theta"], row["observer"], row["state"]): row["never"] for row in rows}
    assert [counts[theta, "F", "x1"] for theta in ("2.0", "4.0")] == ["7", "29"]
    assert counts["2.0", "S", "x1"] == "0"
    assert counts["2.0", "F - S", "x1"] == ""
    points = as_json(found)["points"]
    assert [point["observers"]["F"]["settling"]["x1"]["never"] for point in points] == [7, 29]
    assert "never" not in as_json(compared(made(), ()))["observers"]["F"]["rmse"]["x1"]


def test_a_notebook_has_never_where_tables_have_it() -> None:
    shown = as_html(late({2.0: 20, 4.0: 20}))
    assert shown.count(">never<") == 1
    assert ">never<" not in as_html(late({2.0: 20}))
    assert ">3<" in as_html(late({2.0: 20})) or ">3.000<" in as_html(late({2.0: 20}))


def test_the_last_output_point() -> None:
    assert last_point(0.0, 25.0, 0.1) == pytest.approx(25.0, abs=1e-6)
    assert last_point(1.0, 2.05, 0.1) == pytest.approx(2.0, abs=1e-6)
    assert last_point(0.0, 0.3, 0.1) <= 0.3
