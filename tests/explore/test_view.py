"""What is drawn on a live page: the numbers of a simulation, and no more than has changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live import CLOSED, OSCILLATOR, Live, recorded

pytest.importorskip("bokeh", reason="needs hgorun[explore]")

from bokeh.document import Document

from hgorun import load, simulate
from hgorun.explore.state import State
from hgorun.explore.view import View


class Drawn(Live):
    """A session that draws on a document of bokeh; the page's part of that is done here.

    Attributes
    ----------
    sent : list
        Of every message the names of what it changes.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.document = Document()
        self.sent: list[dict[str, Any]] = []
        self.told: dict[str, Any] = {}
        self.view = View(self.document, self.bench, self.keeper, self.bench.shown(State()))
        self.view.send = self._arrived
        self.session.page = Both(self)
        self.ask("begin")

    def _arrived(self, message: bytes) -> None:
        """Give the models what the page gives its own."""
        end = 8 + int.from_bytes(message[:8], "little")
        self.told = json.loads(message[8:end])
        drawn = self.told["drawn"]
        self.sent.append(drawn)
        assert end % 8 == 0
        points = np.frombuffer(message[end:])
        assert 2 * sum(drawn["curves"].values()) in (0, points.size)
        for name, count in drawn["curves"].items():
            self.document.get_model_by_id(name).data = {"t": points[:count], "v": points[count : 2 * count]}
            points = points[2 * count :]
        for name, (low, high) in drawn["limits"].items():
            self.document.get_model_by_id(name).update(start=low, end=high)
        for name, dashes in drawn["dashes"].items():
            self.document.get_model_by_id(name).line_dash = dashes

    def lines(self, figure: str) -> dict[str, np.ndarray]:
        """The lines of a figure that have points, by colour and style."""
        plot = self.document.get_model_by_name(figure)
        found = {}
        for renderer in plot.renderers:
            values = renderer.data_source.data["v"]
            if len(values):
                glyph = renderer.glyph
                dashes = getattr(glyph, "line_dash", "dots")
                found[f"{glyph.line_color} {glyph.line_width} {dashes}"] = np.asarray(values)
        return found


class Both:
    """The paper of the tests, and the view."""

    def __init__(self, drawn: Drawn) -> None:
        self._each = drawn.paper, drawn.view

    def __getattr__(self, name: str) -> Any:
        def both(*arguments: Any) -> None:
            for one in self._each:
                getattr(one, name)(*arguments)

        return both


@pytest.fixture
def drawn(tmp_path: Path) -> Drawn:
    path = tmp_path / "a.yaml"
    path.write_text(OSCILLATOR)
    return Drawn(path)


@pytest.mark.costly
def test_curves_are_those_of_a_simulation(drawn: Drawn) -> None:
    for value in (2.0, 4.0):
        drawn.set("observers.F.theta", value)
        result = simulate(load(drawn.bench.path, [f"observers.F.theta={value}"]))
        lines = list(drawn.lines("estimate1").values())
        for expected in (result.x[:, 1], *(o.xhat[:, 1] for o in result.observers.values())):
            assert any(np.array_equal(expected, one) for one in lines)
        assert len(lines) == 3
        assert len(drawn.lines("estimate0")) == 4  # with the samples
    assert drawn.told == {**drawn.paper.told[-1], "drawn": drawn.sent[-1]}


@pytest.mark.costly
def test_only_what_has_changed_is_sent(drawn: Drawn) -> None:
    """A small change of one observer redraws that one, in one message; nothing, nothing."""
    drawn.worker.finish()  # all code is compiled: otherwise a message would say so
    drawn.sent.clear()
    drawn.set("observers.F.theta", 2.001)
    (message,) = drawn.sent
    assert 0 < len(message["curves"]) <= 6  # an estimate, an error and its bound of two states
    drawn.set("observers.F.theta", 2.0011, final=False)
    drawn.set("observers.F.theta", 2.0011)
    assert drawn.sent[1]["curves"]
    assert not any(drawn.sent[2].values())


@pytest.mark.costly
def test_an_observer_that_is_off_has_no_lines(drawn: Drawn) -> None:
    drawn.worker.finish()
    before = len(drawn.lines("error0"))
    drawn.ask("observer", label="S", on=False)
    drawn.worker.finish()
    assert len(drawn.lines("estimate1")) == 2
    assert len(drawn.lines("error0")) < before
    drawn.ask("undo")
    drawn.worker.finish()
    assert len(drawn.lines("error0")) == before


@pytest.mark.costly
def test_bounds_are_beside_errors(drawn: Drawn) -> None:
    """In a figure of its own where the coordinates of the theory are no states."""
    drawn.worker.finish()
    names = [bound.name for bound in drawn.paper.bounds["S"]]
    figure = "error0" if names == ["x1", "x2"] else "other0"
    bound = drawn.paper.bounds["S"][0].bound.v
    assert any(np.array_equal(bound, values, equal_nan=True) for values in drawn.lines(figure).values())


def test_theories_in_other_coordinates(tmp_path: Path) -> None:
    path = tmp_path / "b.yaml"
    plant = (
        "plant: {type: contois, inputs: {D: 0.5}, initial: {x1: 1.5, x2: 15}, parameters: {mu: 1, k_c: 4, s_in: 20}}"
    )
    path.write_text(
        f"time: {{end: 4, output_step: 0.05}}\n{plant}\nsolver: {{step: 0.01}}\n"
        "observers: {S: {type: shgo, theta: 2, poles: -1, initial: {x1: 1, x2: 14}}}\n"
    )
    found = Drawn(path)
    found.worker.finish()
    assert found.theory()["S"]["others"] == ["z1", "z2"]
    assert len(found.lines("other0")) == 2
    plot = found.document.get_model_by_name("other0")
    error = found.paper.bounds["S"][0].error.v
    assert plot.y_range.start < np.nanmax(error) <= plot.y_range.end


def test_a_closed_loop_shows_every_plant(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    path.write_text(CLOSED)
    found = Drawn(path)
    result = simulate(load(path))
    lines = list(found.lines("estimate0").values())
    assert any(np.array_equal(result.closed_loop["S"].x[:, 0], one) for one in lines)
    assert found.document.template_variables["closed"] is True
    assert found.document.get_model_by_name("other0") is None


def test_recorded_data_have_innovations_and_no_errors(tmp_path: Path) -> None:
    found = Drawn(recorded(tmp_path / "demo"))
    found.worker.finish()
    innovations = found.paper.pictures[-1].innovations[0].estimates
    lines = list(found.lines("innovation0").values())
    assert len(lines) == 2
    assert all(any(np.array_equal(curve.v, one) for one in lines) for curve in innovations.values())
    assert len(found.lines("estimate0")) == 4  # two estimates, the samples, and those that were held out
    assert len(found.lines("estimate1")) == 3  # two estimates, and what was measured for comparison
    assert [found.document.get_model_by_name(name) for name in ("error0", "other0")] == [None, None]
    found.set("observers.F.theta", 3.0)
    moved = [not np.array_equal(new, old) for new, old in zip(found.lines("innovation0").values(), lines, strict=True)]
    assert sorted(moved) == [False, True]  # of the observer whose theta it is, alone
