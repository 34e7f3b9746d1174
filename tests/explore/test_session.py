"""What a live page is told, and what it writes: the numbers of ``hgorun simulate``."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml
from live import CLOSED, OSCILLATOR, Live

from hgorun import load, simulate
from hgorun.analysis.convergence.premises import premises_of
from hgorun.analysis.finding import FINDINGS
from hgorun.analysis.report import analyze
from hgorun.errors import ConfigError, HgorunError
from hgorun.explore.keeping import Keeper
from hgorun.explore.promises import AT_ONCE, LATER
from hgorun.explore.simulated import Simulated
from hgorun.reproduce.shipped import experiments, is_shipped
from hgorun.result.result import Result
from hgorun.tables.rows import rows_of

CHAIN = """\
time: {end: 2, output_step: 0.05}
plant: {type: integrator_chain, n: 2, phi: 0, initial: {x1: 1, x2: 0}}
observers:
  F: {type: fhgo2, r: 1, theta: 2, poles: -1}
  S: {type: shgo, theta: 2, poles: -1}
solver: {method: rk4, step: 0.01}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.yaml"
    path.write_text(OSCILLATOR)
    return path


def numbers(result: Result) -> dict[str, list[str]]:
    """All digits of all metrics, in the order of tables."""
    return {
        label: [repr(float(v)) for values in o.metrics.values() for v in values]
        for label, o in result.observers.items()
    }


def sorted_digits(found: dict[str, list[str]]) -> dict[str, list[str]]:
    return {label: sorted(digits) for label, digits in found.items()}


def written(live: Live, name: str = "b.yaml") -> Path:
    told = live.ask("write", file=name)
    assert "error" not in told or not told["error"], told
    return Path(told["written"])


def test_what_may_be_asked_for_is_compiled_before(file: Path) -> None:
    """All orders of the slider, of which the near ones are carried out, and every observer alone."""
    own = "plant: {states: [x1, x2], dynamics: {x1: x2, x2: -x1 - x1**3/7}, output: x1, "  # no other test compiles it
    file.write_text(OSCILLATOR.replace("plant: {type: van_der_pol, ", own))
    live = Live(file)
    live.set("observers.S.theta", 3.1)
    assert live.paper.told[-2]["busy"] == "compiling new equations"
    live.worker.finish()
    told = len(live.paper.told)
    live.set("observers.F.r", 2)
    assert {one["label"] for one in live.paper.told[-1]["theories"]} == {"F", "S"}
    live.set("observers.F.r", 6)
    live.set("observers.F.theta", 2.1)
    assert not any("busy" in one for one in live.paper.told[told:])
    live.set("observers.F.r", 7)  # beyond the slider
    assert live.paper.told[-2]["busy"] == "compiling new equations"


def test_a_page_begins_with_the_file(file: Path) -> None:
    live = Live(file)
    assert sorted_digits(live.digits) == sorted_digits(numbers(simulate(load(file))))
    assert live.begun["picture"]["status"] == "ok"
    assert (live.begun["query"], live.begun["off"], live.begun["undo"]) == ("", [], False)
    picture = live.paper.pictures[-1]
    assert [panel.name for panel in picture.panels] == ["x1", "x2"]
    assert picture.panels[0].measured.v.size == 41
    assert picture.panels[1].measured.v.size == 0


def test_the_text_of_the_file_is_kept(file: Path) -> None:
    live = Live(file)
    before = live.digits
    live.set("observers.F.theta", 2.0 + 1e-15)
    live.set("observers.S.poles.1", -2.25)
    path = written(live)
    text = OSCILLATOR.replace("theta: 2,", f"theta: {2.0 + 1e-15!r},").replace("-2]", "-2.25]")
    assert path.read_text() == text
    assert sorted_digits(numbers(simulate(load(path)))) == sorted_digits(live.digits)
    assert live.digits["S"] != before["S"]


def test_a_file_that_extends_another_is_extended(file: Path, tmp_path: Path) -> None:
    over = tmp_path / "over.yaml"
    over.write_text("extends: a.yaml\n")
    live = Live(over, folder=tmp_path / "x" / "y")
    for name, value in {"measurement.noise.0.std": 0.03, "observers.F.initial error": 0.5, "seed": 3}.items():
        live.set(name, value)
    path = written(live)
    assert yaml.safe_load(path.read_text())["extends"] == "../../over.yaml"
    assert sorted_digits(numbers(simulate(load(path)))) == sorted_digits(live.digits)


def test_a_file_that_has_to_stand_alone_extends_nothing(file: Path, tmp_path: Path) -> None:
    """What is written of an experiment that lies in an installation is used elsewhere, without that."""
    over = tmp_path / "over.yaml"
    over.write_text("extends: a.yaml\ntitle: An oscillator\n")
    live = Live(over, folder=tmp_path / "x", alone=True)
    live.set("observers.F.theta", 2.5)
    path = written(live)
    file.unlink()
    assert "extends" not in (said := yaml.safe_load(path.read_text()))
    assert said["title"] == "An oscillator"
    assert sorted_digits(numbers(simulate(load(path)))) == sorted_digits(live.digits)


def test_what_is_written_of_a_shipped_experiment_stands_alone() -> None:
    shipped = experiments()["robles2023/chapter3/contois_te025"]
    assert is_shipped(shipped)
    assert not is_shipped(Path("contois_te025.yaml"))


def test_a_settling_time_that_noise_decides_is_never(file: Path) -> None:
    noisy = OSCILLATOR.replace("end: 4", "end: 12").replace("std: 0.01", "std: 0.03").replace("theta: 3", "theta: 6")
    file.write_text(noisy)
    live = Live(file)
    (row,) = (row for row in rows_of([simulate(load(file))]) if row.label == "S")
    shown = dict(zip(live.begun["picture"]["columns"], live.begun["picture"]["rows"][1]["cells"], strict=True))
    assert row.noisy("settling", "x2")
    assert shown["settling x2"] == ["never", repr(row.value("settling", "x2"))]


@pytest.mark.costly
def test_bounds_that_will_not_take_long_come_with_the_curves(file: Path) -> None:
    """Once it is known how long they take: in one message, and otherwise after the curves, with the same numbers."""
    told = {}
    for patience in (0.0, math.inf):
        live = Live(file, patience=patience)
        live.worker.finish()
        before = len(live.paper.told)
        with_curves = live.set("measurement.noise.0.std", 0.02, final=False)["theories"]
        assert len(with_curves) == (2 if patience else 0)
        live.worker.finish()
        messages = [one for one in live.paper.told[before:] if one.get("theories") and "drawn" in one["theories"][0]]
        assert len(messages) == 1
        told[patience] = live.theory()
        assert [one["drawn"] for one in told[patience].values()] == ["decay", "decay"]
    assert told[0.0] == told[math.inf]


def test_no_error_of_the_integration_is_asked_for(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of given steps takes a run more."""
    asked: list[Result] = []

    def noted(result: Result) -> dict[str, object]:
        asked.append(result)
        return {}

    for name in ("unresolved", "integration_error"):
        monkeypatch.setattr(Result, name, property(noted))
    Live(file).set("observers.S.theta", 3.2)
    assert asked == []


def test_observers_that_are_off_are_left_out(file: Path) -> None:
    live = Live(file)
    live.set("observers.S.theta", 4.0)
    live.ask("observer", label="F", on=False)
    assert list(live.digits) == ["S"]
    assert live.paper.bounds["F"] == []
    path = written(live)
    result = simulate(load(path))
    assert sorted_digits(numbers(result)) == sorted_digits(live.digits)
    live.ask("observer", label="F", on=True)
    assert list(live.digits) == ["F", "S"]
    live.ask("observer", label="F", on=False)
    live.ask("observer", label="S", on=False)
    assert live.digits == {}


def test_one_run_of_several(file: Path) -> None:
    file.write_text(OSCILLATOR + "runs:\n  fast: {observers: {F: {theta: 5}}}\n  slow: {}\n")
    live = Live(file, run="fast")
    assert live.begun["values"]["observers.F.theta"] == 5
    live.set("observers.F.theta", 6.5)
    path = written(live)
    assert sorted_digits(numbers(simulate(load(path)))) == sorted_digits(live.digits)
    assert live.begun["command"] == f"hgorun explore {file} --run fast"


def test_nothing_is_written_elsewhere_or_twice(file: Path) -> None:
    live = Live(file)
    folder = live.keeper.folder
    for name in (
        "../b.yaml",
        "/tmp/b.yaml",
        "b",
        ".yaml",
        ".b.yaml",
        "b.yaml/",
        "a/b.yaml",
        "b.yaml\n",
        "",
        "b.h5",
        "a\\b.yaml",
    ):
        assert "expected the name of a YAML file" in live.ask("write", file=name)["error"]
    assert not folder.exists()
    assert written(live) == folder / "b.yaml"
    assert "exists already" in live.ask("write", file="b.yaml")["error"]
    (folder / "away.yaml").symlink_to(file.parent / "outside.yaml")
    assert "exists already" in live.ask("write", file="away.yaml")["error"]
    assert sorted(path.name for path in folder.iterdir()) == ["away.yaml", "b.yaml"]
    assert live.ask("write", file="a.explored.yaml")["file"] == "a.explored-2.yaml"
    assert file.read_text() == OSCILLATOR


def test_a_file_that_says_something_else_is_not_written(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live = Live(file)
    live.set("observers.F.theta", 3.0)
    monkeypatch.setattr(Keeper, "text", lambda *_: OSCILLATOR)
    assert "does not give the same configuration" in live.ask("write", file="b.yaml")["error"]
    assert list(live.keeper.folder.iterdir()) == []


def test_steps_are_undone(file: Path) -> None:
    live = Live(file)
    start = live.digits
    for value in (2.2, 2.4):
        live.set("observers.F.theta", value, final=False)
    told = live.set("observers.F.theta", 2.5)
    moved = live.digits
    assert told["query"] == "observers.F.theta=2.5"
    assert told["undo"]
    assert moved["F"] != start["F"]
    assert moved["S"] == start["S"]
    told = live.ask("undo")
    assert (told["undo"], told["redo"], live.digits == start) == (False, True, True)
    assert live.ask("redo")["values"]["observers.F.theta"] == 2.5
    assert live.digits == moved
    live.ask("reset")
    assert live.digits == start
    live.ask("undo")
    assert live.digits == moved


def test_an_address_restores(file: Path) -> None:
    live = Live(file)
    live.set("measurement.sampling.period", 0.2)
    told = live.ask("observer", label="S", on=False)
    again = Live(file, query=told["query"])
    assert again.digits == live.digits
    assert again.begun["values"] == told["values"]
    wrong = Live(file, query="observers.F.thata=2")
    assert "the file's own values are shown" in wrong.begun["error"]
    assert wrong.begun["picture"]["status"] == "ok"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("observers.F.theta", -1, "a.yaml:7: observers.F.theta: expected a number above 0, found -1.0"),
        ("observers.F.theta", "", "expected a number"),
        ("observers.F.r", 2.5, "expected a whole number"),
        ("measurement.sampling.period", 0, "expected a number above 0"),
        ("nothing", 1, "there is no such value"),
        ("observers.F.poles", 1, "poles must have a negative real part"),
        ("seed", -1, "seed"),
    ],
)
def test_what_does_not_fit_is_told_and_changes_nothing(file: Path, name: str, value: object, said: str) -> None:
    live = Live(file)
    before = live.digits
    told = live.set(name, value)
    assert said in told["error"]
    assert "Traceback" not in told["error"]
    assert (told["values"], told["query"]) == (live.begun["values"], "")
    assert live.digits == before
    assert len(live.paper.pictures) == 1
    assert not live.set("observers.F.theta", 2.5).get("error")


def test_a_gain_that_is_lost_is_told(file: Path) -> None:
    """Axes stay where the others are."""
    file.write_text(OSCILLATOR.replace("theta: 3,", "theta: 3, hold: {shrink: 0},"))
    live = Live(file)
    told = live.set("observers.S.theta", 60.0)
    row = next(row for row in told["picture"]["rows"] if row["label"] == "S")
    assert row["status"].startswith("diverged")
    assert told["picture"]["status"] == "diverged"
    assert any("observer S diverged" in words for words in told["picture"]["said"])
    assert {digits for _, digits in row["cells"]} == {"inf"}
    low, high = live.paper.pictures[-1].panels[0].limits
    assert -10 < low < high < 10


def test_peaks_beyond_the_axes_are_told(file: Path) -> None:
    file.write_text(OSCILLATOR.replace("theta: 3, poles: [-1, -2]", "theta: 20, poles: -2, initial: {x1: 3}"))
    live = Live(file)
    panel = live.paper.pictures[-1].panels[1]
    largest = simulate(load(file)).observers["S"].xhat[:, 1]
    far = largest[np.argmax(np.abs(largest))]
    assert not panel.limits[0] < far < panel.limits[1]
    assert f"S: x2 reaches {far:.4g}" in panel.beyond[0]
    assert panel.beyond[0] in live.begun["picture"]["said"]


def test_samples_beyond_the_axes_are_told(file: Path) -> None:
    file.write_text(OSCILLATOR.replace("std: 0.01", "std: 9").replace("theta: 2,", "theta: 0.1,").replace("S:", "# S:"))
    live = Live(file)
    panel = live.paper.pictures[-1].panels[0]
    samples = simulate(load(file)).measurements.y[:, 0]
    outside = samples[(samples < panel.limits[0]) | (samples > panel.limits[1])]
    assert 1 < outside.size < samples.size
    assert panel.beyond[-1].startswith(f"{outside.size} samples are beyond the axis of x1, the farthest ")
    assert panel.beyond[-1] in live.begun["picture"]["said"]


@pytest.mark.costly
def test_the_bounds_come_after_the_curves(file: Path) -> None:
    """Those that are known already come with them."""
    live = Live(file)
    live.worker.finish()
    changed = live.set("observers.S.theta", 3.5)
    assert [one["label"] for one in changed["theories"]] == ["F"]
    before = len(live.paper.told)
    live.worker.finish()
    assert [one["label"] for told in live.paper.told[before : before + 1] for one in told["theories"]] == ["S"]


@pytest.mark.costly
def test_bounds_have_the_names_of_their_equations(tmp_path: Path) -> None:
    """Two integrators: nothing but a late output keeps a theorem from holding."""
    (tmp_path / "a.yaml").write_text(CHAIN)
    live = Live(tmp_path / "a.yaml")
    live.worker.finish()
    words = {label: own["words"] for label, own in live.theory().items()}
    assert words["S"] == "dashed, the bound (3.22) of Robles Magdaleno 2023, whose assumptions this run meets"
    assert words["F"] == "dashed, the bound (3.34) of Robles Magdaleno 2023, whose assumptions this run meets"
    (tmp_path / "b.yaml").write_text(CHAIN + "measurement: {sampling: {period: 0.1}}\n")
    live = Live(tmp_path / "b.yaml")
    live.worker.finish()
    for own in live.theory().values():
        late = (
            "dotted, the bound (3.69) of Robles Magdaleno 2023 for an ideal run, without noise, delay and disturbance"
        )
        assert own["words"].startswith(
            f"{late}; this run does not meet what it assumes: d_M = 0.1 is not below delay_bound = "
        )


@pytest.mark.costly
def test_the_theory_follows(file: Path) -> None:
    """Its numbers are those of ``hgorun analyze``; what has not changed is not computed again."""
    file.write_text(OSCILLATOR.replace("  sampling: {period: 0.1}\n", "").replace("std: 0.01", "std: 0.01, hold: 0.1"))
    live = Live(file)
    live.set("observers.S.theta", 3.5)
    live.worker.finish()
    names = (*AT_ONCE, *LATER)
    analysis = analyze(load(file, ["observers.S.theta=3.5"]), [FINDINGS.find(name) for name in names])
    assert live.theory().keys() == {"F", "S"}
    for label, own in live.theory().items():
        for name in names:
            value = analysis.observers[label].values.get(name)
            shown = own["cells"].get(name)
            if value is None:
                assert shown is None
                assert own["reasons"][name] == analysis.observers[label].reasons[name]
            elif isinstance(value, dict):
                assert {state: float(digits) for state, (_, digits) in shown.items()} == value
            else:
                assert float(shown[""][1]) == value
    bound = live.paper.bounds["S"][0]
    transient = analysis.transients["S"]
    assert bound.holds == transient.holds
    assert [one.name for one in live.paper.bounds["S"]] == list(transient.names)
    drawn = transient.bound if transient.holds else transient.nominal
    assert drawn is not None
    assert np.nanmax(bound.bound.v) == pytest.approx(float(drawn[:, 0].max()))


def test_what_is_out_of_date_is_not_computed(file: Path) -> None:
    live = Live(file)
    live.set("observers.S.theta", 3.5)
    live.session.close()
    told = len(live.paper.told)
    live.worker.finish()
    live.session.ask('{"do": "set", "number": 9, "name": "observers.F.theta", "value": 4, "final": true}')
    assert len(live.paper.told) == told


def test_a_closed_loop(tmp_path: Path) -> None:
    """Every observer beside the plant that it drives; the theorems are not about that, and the page says so."""
    path = tmp_path / "c.yaml"
    path.write_text(CLOSED)
    live = Live(path)
    live.set("observers.S.theta", 6.0)
    live.worker.finish()
    panel = live.paper.pictures[-1].panels[0]
    assert set(panel.own_truths) == {"S"}
    assert "in a closed loop" in live.theory()["S"]["reason"]
    result = simulate(load(written(live)))
    assert sorted_digits(numbers(result)) == sorted_digits(live.digits)


def test_a_run_that_cannot_be_made_is_told(file: Path) -> None:
    file.write_text(OSCILLATOR.replace("x1: 1, x2: 0}}", "x1: 1, x2: 0}, parameters: {mu: 1}}"))
    live = Live(file)
    with pytest.raises(ConfigError):
        live.bench.state_of("observers.F.theta=-")
    with pytest.raises(HgorunError):
        live.bench.shown(live.bench.state_of("observers.F.theta=-1"))


def test_a_fault_inside_leaves_no_question_without_its_answer(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a page would say "computing" for ever."""
    live = Live(file)

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("hgorun.explore.simulated.simulate_prepared", broken)
    with pytest.raises(ZeroDivisionError):  # it is for the terminal
        live.set("observers.S.theta", 4)
    told = live.paper.told[-1]
    assert "by a fault of hgorun" in told["error"]
    assert (told["number"], told["values"]["observers.S.theta"]) == (live.number, 3)
    monkeypatch.undo()
    assert live.set("observers.S.theta", 4)["values"]["observers.S.theta"] == 4


def test_what_no_slider_changes_is_made_once(file: Path) -> None:
    """The coordinates of a theory and their functions stay while values change."""
    live = Live(file)
    charts = set()
    for theta in (3.0, 3.5, 4.0):
        shown = live.bench.shown(live.bench.state_of(f"observers.S.theta={theta}"))
        assert isinstance(shown, Simulated)
        charts |= {premises_of(subject).chart for subject in shown.subjects.values()}
    assert len(charts) == 1
