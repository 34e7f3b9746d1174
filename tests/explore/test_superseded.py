"""What a live page computes is dropped for what is wanted since, and of a lost observer no bound is drawn."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from live import OSCILLATOR, Live

from hgorun.result.result import Result
from hgorun.simulation.simulate import simulate_prepared


@pytest.fixture
def live(tmp_path: Path) -> Live:
    path = tmp_path / "a.yaml"
    path.write_text(OSCILLATOR)
    return Live(path)


def ask_meanwhile(live: Live, monkeypatch: pytest.MonkeyPatch, name: str, value: float) -> list[str]:
    """Ask for another value as soon as something is simulated; what has become of the simulations."""
    real, ends = simulate_prepared, list[str]()

    def simulate(run: Any, *, progress: Any, known: Any) -> Result:
        monkeypatch.setattr("hgorun.explore.simulated.simulate_prepared", real)
        live.number += 1
        question = {"do": "set", "number": live.number, "name": name, "value": value, "final": False}
        live.session.ask(json.dumps(question))
        try:
            progress(0.5)
        except Exception as error:
            ends.append(type(error).__name__)
            raise
        ends.append("went on")
        return real(run, progress=progress, known=known)

    monkeypatch.setattr("hgorun.explore.simulated.simulate_prepared", simulate)
    return ends


def set_with_bounds(live: Live, name: str, value: float) -> None:
    """Set a value and draw the bounds that follow; nothing is compiled ahead."""
    live.worker.later.clear()
    live.set(name, value)
    live.worker.later[0]()


def test_a_newer_place_of_the_slider_ends_what_is_computed(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    ends = ask_meanwhile(live, monkeypatch, "observers.S.theta", 4.0)
    live.set("observers.S.theta", 3.5, final=False)
    assert ends == ["Superseded"]
    assert [(told["number"], told["values"]["observers.S.theta"]) for told in live.paper.told[-1:]] == [(3, 4.0)]
    assert len(live.paper.pictures) == 2  # the first one, and that of the newer place


def test_back_to_what_is_shown_ends_it_as_well(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is computed then, and what was on its way is not drawn in its place."""
    ends = ask_meanwhile(live, monkeypatch, "observers.S.theta", 3.0)
    live.set("observers.S.theta", 3.5, final=False)
    assert ends == ["Superseded"]
    assert live.session.history.shown.values == {}
    assert len(live.paper.pictures) == 1


def test_a_closed_page_has_nothing_computed(live: Live, monkeypatch: pytest.MonkeyPatch) -> None:
    real = simulate_prepared

    def simulate(run: Any, *, progress: Any, known: Any) -> Result:
        live.session.close()
        progress(0.5)
        return real(run, progress=progress, known=known)

    monkeypatch.setattr("hgorun.explore.simulated.simulate_prepared", simulate)
    with pytest.raises(StopIteration):  # no answer
        live.set("observers.S.theta", 3.5)


def test_nothing_is_drawn_of_the_bound_of_a_lost_observer(live: Live) -> None:
    """But for as long as it is lost."""
    live.worker.later[0]()
    assert live.paper.bounds["S"]
    live.set("measurement.sampling.period", 0.8)
    set_with_bounds(live, "observers.S.theta", 30.0)
    (picture,) = (told["picture"] for told in live.paper.told[-2:] if "picture" in told)
    assert picture["rows"][1]["status"].startswith("diverged")
    said = live.theory()["S"]
    assert live.paper.bounds["S"] == []
    assert (said["drawn"], said["words"]) == ("", "")
    assert said["reason"].startswith("its estimate is lost: diverged at t=")
    live.set("observers.S.theta", 3.0)
    set_with_bounds(live, "measurement.sampling.period", 0.1)
    assert live.paper.bounds["S"]
    assert not live.theory()["S"]["reason"]
