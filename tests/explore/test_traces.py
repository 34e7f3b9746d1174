"""Of observers that stay as they are nothing is made anew, and all that is drawn is that of the run that is shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from live import CLOSED, OSCILLATOR, Live
from scipy.ndimage import maximum_filter1d

from hgorun import load, simulate
from hgorun.explore.picture import Panel


def page(folder: Path, text: str = OSCILLATOR) -> Live:
    path = folder / "a.yaml"
    path.write_text(text)
    return Live(path)


@pytest.mark.parametrize(("text", "points"), [(OSCILLATOR, 1), (CLOSED, 3)], ids=["simulated", "driven"])
def test_curves_are_those_of_the_run(tmp_path: Path, text: str, points: int) -> None:
    """All points of so short a run are drawn; the window of errors is a hundredth of 4 s, steps are 0.05 or 0.02."""
    live = page(tmp_path, text)
    for theta in (2.5, 4.0, 2.5):
        live.set("observers.S.theta", theta)
        result = simulate(load(tmp_path / "a.yaml", overrides=[f"observers.S.theta={theta}"]))
        for i, panel in enumerate(live.paper.pictures[-1].panels):
            assert list(panel.estimates) == list(panel.errors) == list(result.observers)
            assert np.array_equal(panel.truth.v, result.x[:, i])
            for label, observer in result.observers.items():
                truth = result.closed_loop[label].x if result.closed_loop else result.x
                error = maximum_filter1d(np.abs(observer.xhat[:, i] - truth[:, i]), points)
                assert np.array_equal(panel.estimates[label].v, observer.xhat[:, i])
                assert np.array_equal(panel.errors[label].v, np.where(error > 0, error, np.nan), equal_nan=True)
                if result.closed_loop:
                    assert np.array_equal(panel.own_truths[label].v, truth[:, i])


def test_only_what_has_changed_is_drawn_anew(tmp_path: Path) -> None:
    live = page(tmp_path)
    before = live.paper.pictures[-1].panels
    live.set("observers.F.theta", 3)
    after = live.paper.pictures[-1].panels
    live.set("measurement.noise.0.std", 0.02)
    noisier = live.paper.pictures[-1].panels

    def kept(one: tuple[Panel, ...], other: tuple[Panel, ...], label: str) -> list[bool]:
        pairs = list(zip(one, other, strict=True))
        assert all(a.truth is b.truth for a, b in pairs)
        return [a.estimates[label] is b.estimates[label] and a.errors[label] is b.errors[label] for a, b in pairs]

    assert (kept(before, after, "S"), kept(before, after, "F")) == ([True, True], [False, False])
    assert kept(after, noisier, "S") == kept(after, noisier, "F") == [False, False]


@pytest.mark.costly
def test_bounds_of_an_observer_that_stays_are_drawn_with_the_curves(tmp_path: Path) -> None:
    live = page(tmp_path)
    live.worker.finish()
    before = dict(live.paper.bounds)
    assert before["S"]
    live.set("observers.F.theta", 3)
    assert live.paper.bounds["S"] is before["S"]
    live.worker.finish()
    assert live.paper.bounds["F"] is not before["F"]
