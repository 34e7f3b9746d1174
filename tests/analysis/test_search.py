"""The border of theta that is found by trying: of a step function exactly, of an observer by its runs."""

from __future__ import annotations

import numpy as np
import pytest
from examples import chain, experiment
from hypothesis import given
from hypothesis import strategies as st

from hgorun.analysis.finding import FINDINGS
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.search import critical_theta, smallest, works


@pytest.mark.costly
@given(st.floats(-9, 9), st.floats(-3, 3))
def test_the_border_of_a_step_function(border: float, start: float) -> None:
    """Found to 2 %, from above, wherever the search starts within ten doublings."""
    edge, theta = 2.0**border, 2.0**start
    tried: list[float] = []

    def holds(value: float) -> bool:
        tried.append(value)
        return value >= edge

    if abs(border - start) > 9.9:
        return
    found = smallest(holds, theta)
    assert edge <= found <= 1.02 * edge * (1 + 1e-12)
    assert len(tried) < 22


def test_the_border_is_that_of_the_range_around_the_start() -> None:
    """What works below the gap is not looked for: the name says below which range the theta is that fails."""

    def holds(value: float) -> bool:
        return 0.1 <= value <= 0.3 or value >= 2

    found = smallest(holds, 6.0)
    assert holds(found)
    assert not holds(found / 1.02)
    assert 2 <= found <= 2.04 * (1 + 1e-12)
    assert "largest theta that fails below the working range" in FINDINGS.find("theta_critical").meaning


@pytest.mark.parametrize(("answer", "words"), [(True, "down to 0.0009766"), (False, "up to 1024")])
def test_without_a_border_there_is_no_value(answer: bool, words: str) -> None:
    with pytest.raises(NoValue, match=words):
        smallest(lambda _: answer, 1.0)


def test_of_an_observer_that_must_be_fast_enough() -> None:
    """Poles -theta, twice, of an error without phi: e_1 falls like (1 + theta t/...) exp(-theta t)."""
    made = experiment(
        chain(2, start=0),
        {"o": {"type": "shgo", "theta": 8, "initial": {"x1": 1}}},
        end=10,
        step=0.01,
        measurement={"noise": [{"type": "uniform", "low": -1, "high": 1}]},
    )
    border = critical_theta(made, "o", 8.0)

    def left(theta: float) -> float:
        """The largest error of a component from t = 9.1 on, over that at the start."""
        t = np.linspace(9.1, 10, 100)
        x1 = (1 - theta * t) * np.exp(-theta * t)
        x2 = -(theta**2) * t * np.exp(-theta * t)
        return float(np.abs([x1, x2]).max())

    assert left(border) <= 0.01 < left(border / 1.03)


def test_a_run_that_cannot_be_made_does_not_work() -> None:
    made = experiment(chain(2), {"o": {"type": "shgo", "theta": 2}}, step=0.01)
    assert not works(made, "o", 1e200)
    assert not works(made, "o", 1e4)  # diverges with this step
