"""A theta that is too large for how rarely or how late outputs come: named, with what would not be."""

from __future__ import annotations

import re

import numpy as np
import pytest
from examples import Block, chain, inline, simulated

from hgorun.simulation.error_dynamics import monodromy, small_errors

PERIOD, LATE = {"sampling": {"period": 0.1}}, {"delay": 0.1}
DUFFING = inline({"p": "q", "q": "p - p**3 - 0.2*q"}, "p") | {"initial": {"p": 1, "q": 0.5}}


def reason(plant: Block, observer: Block, measurement: Block, **more: object) -> str:
    (found,) = simulated(
        plant, {"S": observer}, measurement=measurement, **{"end": 10, "output_step": 0.1, **more}
    ).observers.values()
    assert found.status == "diverged"
    assert found.reason is not None
    return found.reason


@pytest.mark.costly
@pytest.mark.parametrize(
    ("what", "measurement", "limits"),
    [  # three integrators: theta T and theta d from which on errors grow, computed apart from this program
        ("period", PERIOD, [(28, 0.057), (30, 0.06)]),  # 2.896, 3.014
        ("delay", LATE, [(9.2, 0.018), (13, 0.027)]),  # 0.927, 1.400, the continuous output as 16 samples a delay
    ],
)
def test_the_limits_are_those_of_small_errors(what: str, measurement: Block, limits: list[tuple[float, float]]) -> None:
    """In two digits, rounded down."""
    observers: dict[str, Block] = {
        "S": {"type": "shgo", "theta": 50, "initial": {"x1": 1}},
        "F": {"type": "fhgo2", "r": 3, "theta": 50, "initial": {"x1": 1}},
    }
    result = simulated(chain(3), observers, measurement=measurement, end=4, step=0.005)
    for observer, (theta, other) in zip(result.observers.values(), limits, strict=True):
        assert observer.status == "diverged"
        assert observer.reason is not None
        assert observer.reason.endswith(
            f"theta = 50 is too large for the {what} 0.1 s, since even small errors grow: "
            f"they do not with theta of at most {theta}, or a {what} of at most {other:g} s"
        )


@pytest.mark.parametrize(
    ("observer", "said"),
    [  # on two integrators each is the SHGO of three with theta = 50, see above
        ({"type": "eso", "omega_o": 50}, "omega_o = 50 is too large for the period 0.1 s, .*: they do not with omega_o "
         "of at most 28, or a period of at most 0.057 s"),
        ({"type": "neso", "beta": [150, 7500, 125000], "alpha": [1, 1, 1], "delta": 1}, "the gains, which make it as "
         "fast as 50 per s, are too large for the period 0.1 s, .*: they do not with a period of at most 0.057 s"),
    ],
    ids=["one key", "none"],
)  # fmt: skip
def test_a_gain_of_another_name_is_told_of(observer: Block, said: str) -> None:
    start: Block = {"initial": {"x1": 1}}
    assert re.search(said + "$", reason(chain(2), observer | start, PERIOD, end=4, step=0.005))


@pytest.mark.costly
def test_what_is_advised_holds_for_a_plant_of_ones_own() -> None:
    """Where the estimate stays bounded, too."""
    shgo: Block = {"type": "shgo", "theta": 80, "initial": {"p": 1, "q": 0.4}}
    grid: Block = {"step": 0.01, "output_step": 0.01}
    advice = reason(DUFFING, shgo, PERIOD, **grid)
    said = re.search(r"theta of at most (\S+), or a period of at most (\S+) s$", advice)
    assert said is not None
    theta, period = map(float, said.groups())
    for one, other in ((theta, 0.1), (80.0, period)):
        sampled: Block = {"sampling": {"period": other}}
        result = simulated(DUFFING, {"S": shgo | {"theta": one}}, measurement=sampled, end=20, **grid)
        assert result.observers["S"].status == "ok"
        assert np.all(np.abs(result.observers["S"].xhat[-1] - result.x[-1]) < 0.01)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("period", "delay", "theta"),
    [(0.1, 0.05, 80), (0.1, 0.3, 10), (0.01, 0.9, 60)],  # the delay alone is too much for theta, or nearly so
)
def test_with_a_delay_the_theta_that_is_advised_settles(
    period: float, delay: float, theta: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And few samples on their way are ever looked at, so that advice comes at once."""
    real, waiting = monodromy.on_their_way, list[int]()

    def on_their_way(*times: float) -> tuple[int, float]:
        found = real(*times)
        waiting.append(found[0])
        assert found[0] <= 16
        return found

    monkeypatch.setattr(small_errors, "on_their_way", on_their_way)
    swinging = inline({"p": "q", "q": "-p"}, "p") | {"initial": {"p": 1, "q": 0}}
    late: Block = {"sampling": {"period": period}, "delay": delay}
    grid: Block = {"step": 0.01, "output_step": 0.01, "end": 20}
    shgo: Block = {"type": "shgo", "theta": theta, "initial": {"p": 0.5}}
    advice = reason(swinging, shgo, late, **grid)
    what = f"the period {period} s with the delay {delay} s"
    said = re.search(rf"{what}, since .*: they do not with theta of at most (\S+)$", advice)
    assert said is not None
    assert 0 < len(waiting) < 100
    advised = float(said[1])
    assert 1.5 < advised * (period + delay) < 5  # not so small that anything would do
    long: Block = {"end": 600, "output_step": 0.1}  # near the limit errors fade slowly
    result = simulated(swinging, {"S": shgo | {"theta": advised}}, measurement=late, **(grid | long))
    assert result.observers["S"].status == "ok"
    error = np.abs(result.observers["S"].xhat - result.x)
    assert np.max(error[-100:]) < 0.1 * np.max(error[:100])


def test_nothing_is_said_where_it_is_not_theta() -> None:
    """A gain that is unstable with a continuous output, too."""
    shgo: Block = {"type": "shgo", "theta": 2, "gains": [-2, 1]}
    assert "too large" not in reason(chain(2), shgo, PERIOD, end=100, step=0.01)


def test_two_times_in_one_reason_are_told_apart() -> None:
    """The estimate has left at a point of the grid; controlled steps give up a little later."""
    shgo: Block = {"type": "shgo", "theta": 200}
    cubic = inline({"p": "q", "q": "p**3 - p"}, "p") | {"initial": {"p": 0.5, "q": 0}}
    found = reason(cubic, shgo, {"sampling": {"steps": "0.1"}}, end=1, output_step=0.01)
    said = re.search(r"leaves the truth for good at t = (\S+), and from t = (\S+) on no step is small enough", found)
    assert said is not None
    left, given_up = map(float, said.groups())
    assert 0.2 < left < given_up < 0.23


@pytest.mark.measured("5.0-")
@pytest.mark.costly
@pytest.mark.parametrize(("theta_2", "beside"), [(40.0, " with theta_2 below it"), (5.0, "")])
def test_of_two_gains_the_larger_is_told_of(theta_2: float, beside: str) -> None:
    """Errors beyond d go at theta_1; what is advised holds."""
    swinging = inline({"p": "q", "q": "-p"}, "p") | {"initial": {"p": 1, "q": 0}}
    grid: Block = {"step": 0.01, "output_step": 0.05, "end": 60}
    sampled: Block = {"sampling": {"period": 0.2}}
    block: Block = {"type": "piecewise", "theta_1": 60, "theta_2": theta_2, "d": 0.1, "initial": {"p": 0.5}}
    advice = reason(swinging, block, sampled, **grid)
    said = re.search(
        r"theta_1 = 60 is too large for the period 0.2 s, since large errors grow: they do not with theta_1 of at most "
        rf"([0-9.]+){beside}, or a period of at most ([0-9.]+) s$",
        advice,
    )
    assert said is not None
    theta, period = map(float, said.groups())
    assert theta * 0.2 > 3
    slower: Block = {"theta_1": theta, "theta_2": min(theta_2, 0.9 * theta)}
    for keys, T in ((slower, 0.2), ({}, period)):
        result = simulated(swinging, {"S": block | keys}, measurement={"sampling": {"period": T}}, **grid)
        assert result.observers["S"].status == "ok"
