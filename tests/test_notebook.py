"""What notebooks show, and what may be given to hgorun.simulate in them."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import hgorun
from hgorun import ConfigError
from hgorun.markup import number, table

EVIL = "<img src=x onerror=alert(1)>"
CONFIG: dict[str, Any] = {
    "title": f"{EVIL} & more",
    "time": {"end": 2, "output_step": 0.1, "unit": "h"},
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0},
        "units": {"x1": "<b>g</b>"},
    },
    "observers": {EVIL: {"type": "shgo", "theta": 2}, "B": {"type": "shgo", "theta": 3}},
    "solver": {"method": "rk4", "step": 0.01},
}


@pytest.fixture(scope="module", name="result")
def simulated() -> hgorun.Result:
    return hgorun.simulate(CONFIG)


class Reader(HTMLParser):
    """The tags of a text, and its words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.tags.append(tag)
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1].append(data)


ALLOWED = {"div", "p", "b", "table", "thead", "tbody", "tr", "th", "td"}


def read(text: str) -> Reader:
    found = Reader(text)
    assert set(found.tags) <= ALLOWED
    assert "&lt;img src=x" in text
    return found


def test_a_result_is_a_table_of_its_metrics(result: hgorun.Result) -> None:
    found = read(result._repr_html_())
    head, *rows = found.rows
    assert head[:4] == ["observer", "status", "rmse x1 [<b>g</b>]", "rmse x2"]
    assert [row[0] for row in rows] == [EVIL, "B"]
    assert float(rows[1][2]) == pytest.approx(result.observers["B"].metrics["rmse"][0], rel=1e-3)
    assert found.tags.count("b") == 1  # the caption's own


def test_an_experiment_shows_its_plant_and_observers_without_being_built() -> None:
    experiment = hgorun.Experiment(CONFIG)
    found = read(experiment._repr_html_())
    assert found.rows == [["observer", "type", "keys"], [EVIL, "shgo", "theta: 2.0"], ["B", "shgo", "theta: 3.0"]]
    assert "plant" not in experiment.__dict__


def test_a_sweep_shows_axes_and_medians() -> None:
    found = hgorun.sweep(hgorun.Experiment(CONFIG), {"observers.B.theta": [2.0, 3.0, 4.0]})
    shown = found._repr_html_()
    assert "observers.B.theta: 2, 3, 4" in shown
    row = next(row for row in read(shown).rows if row[0] == "B")
    assert float(row[2]) == pytest.approx(np.median(found.metrics["rmse"][:, 1, 0]), rel=1e-3)


def test_tables_stay_small() -> None:
    text = table("many", [f"c{i}" for i in range(100)], [["x" * 1000] * 100] * 1000)
    assert len(text) < 60_000
    assert "970 more rows" in text
    assert "87 more columns" in text
    assert [number(v) for v in (np.nan, np.inf, -np.inf, 1234.56)] == ["–", "∞", "−∞", "1235"]


# What hgorun.simulate takes


def test_a_file_a_mapping_and_an_experiment_are_the_same(result: hgorun.Result, tmp_path: Path) -> None:
    file = tmp_path / "case.yaml"
    file.write_text(yaml.safe_dump(CONFIG))
    for given in (file, str(file), hgorun.load(file), hgorun.Experiment(CONFIG)):
        assert np.array_equal(hgorun.simulate(given).observers["B"].xhat, result.observers["B"].xhat)
    several = CONFIG | {"runs": {"one": {}, "two": {"seed": 3}}}
    file.write_text(yaml.safe_dump(several))
    assert hgorun.simulate(file, run="two").seed == 3


@pytest.mark.parametrize(
    ("given", "more", "words"),
    [
        (3, {}, "expected a file, a mapping or an Experiment, found 3"),
        ("missing.yaml", {}, "missing.yaml"),
        ("", {}, "empty text"),
        ("time: {end: 1}\nplant: {}", {}, "yaml.safe_load"),
        ({"runs": {}}, {}, "has to be a file"),
        ({}, {"run": "one"}, "names one of the runs of a file"),
        ({"time": {"end": 1, "output_step": 0.1}}, {}, "plant"),
        (CONFIG | {"observers": {"B": {"type": "shgo", "thetta": 1}}}, {}, "theta"),
        (CONFIG | {"extends": "other.yaml"}, {}, "only a file can extend"),
    ],
)
def test_what_is_no_experiment_is_refused(given: Any, more: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        hgorun.simulate(given, **more)
