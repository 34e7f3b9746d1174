"""Recorded data on a live page: the scores of ``hgorun estimate``, and no truth."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from live import Live, recorded
from shell import Shell

from hgorun.estimate.carrying import one_pass
from hgorun.explore.bench import Bench


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return recorded(tmp_path / "demo")


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


def estimated(config: Path, shell: Shell) -> dict[str, dict[str, Any]]:
    """The scores of the command."""
    code, out, _ = shell("estimate", str(config), "--json", "--no-plots", "-o", str(config.with_suffix(".h5")))
    assert code == 0
    return {label: of["scores"] for label, of in json.loads(out)["observers"].items()}


def shown(live: Live) -> dict[str, dict[str, Any]]:
    """The scores of the page, once everything has been computed."""
    live.worker.finish()
    picture = next(told["picture"] for told in reversed(live.paper.told) if "picture" in told)
    found: dict[str, dict[str, Any]] = {}
    for row in picture["rows"]:
        own = found.setdefault(row["label"], {})
        for name, (_, digits) in zip(picture["columns"], row["cells"], strict=True):
            if digits:
                score, of = name.split(" ")
                own.setdefault(score, {})[of] = float(digits)
    return found


def test_scores_are_those_of_the_command(file: Path, shell: Shell) -> None:
    """Of the file, of its text with other values, and of a whole configuration where an observer is left out."""
    live = Live(file, folder=file.parent.parent / "out")
    assert "innovation_rms x" in live.begun["picture"]["columns"]
    assert shown(live) == estimated(file, shell)
    before = shown(live)
    for name, value in {"observers.F.theta": 3.25, "observers.E.Q.v": 0.1, "observers.E.initial.v": 0.8}.items():
        live.set(name, value)
    first = Path(live.ask("write", file="b.yaml")["written"])
    assert "# filtered" in first.read_text()
    found = shown(live)
    assert found == estimated(first, shell)
    assert found["F"] != before["F"]
    assert found["E"] != before["E"]
    live.set("data.outputs.x.std", 0.2)  # the log is read again
    live.set("data.period", 0.6)
    live.ask("observer", label="F", on=False)
    second = Path(live.ask("write", file="c.yaml")["written"])
    assert yaml.safe_load(second.read_text())["data"]["file"] == "../demo/log.csv"
    assert list(shown(live)) == ["E"]
    assert shown(live) == estimated(second, shell)
    assert shown(live)["E"]["innovation_rms"] != found["E"]["innovation_rms"]


def test_what_can_be_varied(file: Path) -> None:
    bench: Bench = Live(file).bench
    assert {knob.name: knob.start for knob in bench.knobs.values()} == {
        "observers.F.theta": 2.0,
        "observers.F.r": 1.0,
        "observers.F.poles": -1.0,
        "observers.F.initial.x": 0.2,
        "observers.E.Q.x": 0.01,
        "observers.E.Q.v": 0.02,
        "observers.E.initial.v": 0.5,
        "data.outputs.x.std": 0.05,
        "data.outputs.x.gate": 6.0,
        "data.period": 0.3,
    }
    theta = bench.knobs["observers.F.theta"]
    assert (theta.low, theta.high, theta.scale) == (0.5, 50.0, "log")  # where the file seeks it


def test_what_is_drawn(file: Path) -> None:
    """Estimates with what was measured, and innovations; no truth, no errors, and no theory."""
    live = Live(file)
    x, v = live.paper.pictures[-1].panels
    (innovation,) = live.paper.pictures[-1].innovations
    assert (x.truth.v.size, x.measured.v.size, x.unseen.v.size) == (0, 40, 80)
    assert (v.truth.v.size, v.measured.v.size, v.unseen.v.size) == (0, 0, 120)
    assert set(innovation.estimates) == {"F", "E"}
    assert innovation.estimates["E"].v.size == 40
    assert (x.unit, innovation.unit) == ("mm", "mm")
    live.worker.finish()
    assert live.theory() == {}
    assert live.paper.bounds == {}


def test_while_a_slider_is_held_no_other_gains_are_tried(file: Path) -> None:
    live = Live(file)
    live.set("observers.F.theta", 2.5, final=False)
    live.worker.finish()
    assert "sensitivity theta" not in live.paper.told[-1]["picture"]["columns"]
    live.set("observers.F.theta", 2.5)
    assert shown(live)["F"]["sensitivity"]["theta"] != 0


def test_what_does_not_fit_is_told(file: Path) -> None:
    live = Live(file)
    before = shown(live)
    assert "expected a number above 0" in live.set("data.outputs.x.std", -1)["error"]
    assert shown(live) == before


def test_counts_are_whole_numbers(file: Path) -> None:
    """Of forty samples one is far off, and the gate of either observer leaves it out."""
    log = file.parent / "log.csv"
    lines = log.read_text().splitlines()
    t, _, w = lines[61].split(",")
    lines[61] = f"{t},9.0,{w}"
    log.write_text("\n".join(lines))
    picture = Live(file).begun["picture"]
    place = picture["columns"].index("gated x")
    assert [row["cells"][place] for row in picture["rows"]] == [["1", "1.0"]] * 2


def test_a_given_step_is_carried_out_once(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """How large its error is the page does not show; one that is sought follows from two passes."""
    passes: list[float | None] = []

    def counted(*arguments: Any, **named: Any) -> Any:
        passes.append(arguments[3] if len(arguments) > 3 else None)
        return one_pass(*arguments, **named)

    monkeypatch.setattr("hgorun.estimate.carrying.one_pass", counted)
    Live(file)
    assert len(passes) == 2 * passes.count(None)
    assert passes.count(None) >= 1
    passes.clear()
    file.write_text(file.read_text() + "solver: {method: rk4, step: 0.01}\n")
    Live(file)
    assert passes == [None]
