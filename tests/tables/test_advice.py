"""What ``analyze`` says first follows from its numbers, and from what is known of the error in closed form."""

from __future__ import annotations

import pytest

import hgorun
from hgorun import Experiment
from hgorun.analysis.report import Analysis
from hgorun.tables import advice as advised
from hgorun.tables.advice import _bound, advice
from hgorun.tables.layout import number


def said(
    period: float | None,
    *,
    theta: float = 2.0,
    noise: float = 0.01,
    delay: float = 0.0,
    end: float = 30.0,
    sampling: dict[str, float] | None = None,
    **keys: float,
) -> tuple[str, Analysis]:
    """Of a chain of two integrators, whose limits are known."""
    measurement: dict[str, object] = {"noise": [{"type": "gaussian", "std": noise, "hold": period or 0.01}]}
    if period is not None:
        measurement |= {"sampling": {"period": period, **(sampling or {})}, "delay": delay}
    analysis = hgorun.analyze(
        Experiment(
            {
                "time": {"end": end, "output_step": 0.01},
                "plant": {"type": "integrator_chain", "n": 2, "phi": "0", "initial": {"x1": 1, "x2": 1}},
                "measurement": measurement,
                "observers": {
                    "SHGO": {"type": "shgo", "theta": theta, **keys},
                    "EKF": {"type": "kalman_bucy", "Q": {"x1": 1, "x2": 1}, "R": 1},
                },
                "solver": {"method": "rk4", "step": 0.01},
            },
            name="chain",
        )
    )
    return "\n".join(advice(analysis)), analysis


@pytest.mark.costly
def test_decay_limits_and_the_gain_to_change() -> None:
    text, analysis = said(0.1)
    together = " ".join(text.split())
    assert "decays like exp(-2.000 t), t in s" in together  # poles -1 at theta = 1
    found = analysis.observers["SHGO"].values
    limit = found["period_critical_chain"]
    assert isinstance(limit, float)
    assert f"stable up to theta = {number(2 * limit / 0.1)}, {number(limit / 0.1)} times the present one" in together
    assert "period 0.1000 s: " in together
    assert "most of its error is noise: a smaller theta lowers it" in together
    assert "to change: Q against R" in together
    assert "least error in the steady window: x1" in together
    assert "no theorem bounds the error of this run" in together


def test_a_period_beyond_the_limit_is_told_to_be_too_long() -> None:
    """Samples of two integrators at theta = 2: the held innovation is unstable from a period of 2.5 on."""
    text, analysis = said(3.0, end=120.0)
    limit = analysis.observers["SHGO"].values["period_critical"]
    assert isinstance(limit, float)
    assert abs(limit - 2.5) < 1e-3  # 5/theta
    together = " ".join(text.split())
    assert f"period 3.000 s: too long: the linear error loses stability at {number(limit)} s" in together
    assert "to change: measure more often and sooner, or a smaller theta" in together


def test_how_far_theta_may_grow_is_not_said_where_poles_follow_from_it() -> None:
    """Limits of chains are in proportion to 1/theta with the same poles only."""
    assert "limit: a chain" in said(0.1, end=3.0)[0]
    assert "limit: a chain" not in said(0.1, end=3.0, poles_for_period=0.1)[0]


def test_a_period_and_a_delay_are_a_limit_of_theta_together() -> None:
    """From theta = 18.88 on the error grows: 25.48 is the limit by the delay with the period as it is."""
    text, analysis = said(0.1, theta=4.0, delay=0.1, end=3.0)
    alone = analysis.observers["SHGO"].values["delay_critical_chain"]
    assert isinstance(alone, float)
    assert number(4.0 * alone / 0.1) == "25.48"
    assert "stable up to theta = 18.88, 4.720 times the present one" in " ".join(text.split())


@pytest.mark.parametrize("sampling", [{"dropout": 0.3}, {"jitter": 0.04}])
def test_limits_are_told_to_be_those_without_jitter_and_dropout(sampling: dict[str, float]) -> None:
    """Longer gaps lower them: with a period of 0.25 and every third sample lost theta = 15 diverges, below 20."""
    together = " ".join(said(0.1, end=3.0, sampling=sampling)[0].split())
    regular = "without jitter and dropout"
    assert f"period 0.1000 s: {regular}, the linear error loses stability at" in together
    assert f"no delay: {regular}, the linear error loses stability at" in together
    assert f"limit: a chain measured like this, but {regular}, is stable up to theta = 50.00, 25.00 times" in together
    assert "; longer gaps lower it" in together


@pytest.mark.parametrize(
    ("room", "told"),
    [
        (10.0, "stable up to theta = 20.00, 10.00 times the present one"),
        (1.5, "stable up to theta = 3.000, 1.500 times the present one, which is near"),
        (0.75, "stable up to theta = 1.500 only, less than 2.000: the limits above are those of this run"),
    ],
)
def test_a_limit_is_no_advice_to_go_there(room: float, told: str) -> None:
    assert told in _bound("theta", 2.0, room)


def test_no_larger_gain_is_advised_where_its_limit_is_near(monkeypatch: pytest.MonkeyPatch) -> None:
    """A quarter of the way to the limit a larger theta lowers the error; near it other things come first."""
    for room, words in (
        (4.0, "a larger theta lowers what is left"),
        (1.5, "theta has little room: measure more often"),
    ):
        monkeypatch.setattr(advised, "_room", lambda *_, room=room: room)
        assert words in " ".join(said(0.1, end=3.0, noise=1e-6)[0].split())


def test_a_continuous_output_has_no_period() -> None:
    together = " ".join(said(None)[0].split())
    assert "no sampling: " in together
    assert "no delay: the linear error loses stability at" in together


def test_no_observers_have_no_advice() -> None:
    analysis = hgorun.analyze(
        Experiment(
            {
                "time": {"end": 1, "output_step": 0.1},
                "plant": {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
                "observers": {},
            },
            name="empty",
        )
    )
    assert advice(analysis)[-1] == "no observers"


def test_of_an_observer_corrected_by_samples_no_limit_is_said_once() -> None:
    analysis = hgorun.analyze(
        Experiment(
            {
                "time": {"end": 2, "output_step": 0.1},
                "plant": {"type": "integrator_chain", "n": 2, "phi": "0", "initial": {"x1": 1, "x2": 1}},
                "measurement": {"sampling": {"period": 0.1}},
                "observers": {"EKF": {"type": "ekf", "Q": {"x2": 1}, "R": 1}},
                "solver": {"method": "rk4", "step": 0.01},
            },
            name="chain",
        )
    )
    together = " ".join("\n".join(advice(analysis)).split())
    assert together.count("jump at the samples") == 1
    assert "no limit of the period or the delay is computed, since all observers here jump" in together


@pytest.mark.parametrize("recalls", [False, True])
def test_outputs_of_different_periods_have_a_limit_only_where_the_observer_knows_one(recalls: bool) -> None:
    """Of q nothing is known, and no limit is referred to; p declares the delay that it stands on chains."""
    observers = {"q": {"type": "shgo", "theta": 2}, "p": {"type": "predictor_chain", "theta": 2, "m": 1}}
    analysis = hgorun.analyze(
        Experiment(
            {
                "time": {"end": 1, "output_step": 0.1},
                "plant": {
                    "states": ["a", "b", "c"],
                    "dynamics": {"a": "b", "b": "-a - b", "c": "a - c"},
                    "output": {"y": "a", "z": "c"},
                    "initial": {"a": 1, "b": 0, "c": 1},
                },
                "measurement": {
                    "delay": 0.1,
                    "outputs": {"y": {"sampling": {"period": 0.1}}, "z": {"sampling": {"period": 0.2}}},
                },
                "observers": observers if recalls else {"q": observers["q"]},
                "solver": {"method": "rk4", "step": 0.01},
            },
            name="two",
        )
    )
    together = " ".join("\n".join(advice(analysis)).split())
    assert "no limit of the period or the delay is computed, since the outputs differ in their sampling" in together
    assert together.endswith("the limits above are those of the linear error" if recalls else "more than is needed")
    if recalls:
        declared = analysis.observers["p"].values["delay_critical_chain"]
        assert isinstance(declared, float)
        assert "period: the observer looks back at its own past" in together
        assert "delay: the observer looks back at its own past" in together
        assert f"on a chain without nonlinearity up to {number(declared)} s" in together


def test_no_larger_gain_is_recommended_to_an_observer_that_is_lost() -> None:
    """Near 0 the plant is stable, and the limits of its linear error are far; its cube drives a wrong start off."""
    analysis = hgorun.analyze(
        Experiment(
            {
                "time": {"end": 5, "output_step": 0.01},
                "plant": {
                    "states": ["a", "b"],
                    "dynamics": {"a": "b", "b": "-a - b + a**3"},
                    "output": {"y": "a"},
                    "initial": {"a": 0.1, "b": 0},
                },
                "measurement": {"sampling": {"period": 0.01}},
                "observers": {"SHGO": {"type": "shgo", "theta": 2, "initial": {"a": 0.1, "b": 500}}},
                "solver": {"method": "rk4", "step": 0.001},
            },
            name="cube",
        )
    )
    assert analysis.result.observers["SHGO"].lost
    together = " ".join("\n".join(advice(analysis)).split())
    assert "to change: a smaller theta, or an initial estimate nearer to the truth" in together
    assert "may grow" not in together
    assert "larger" not in together


@pytest.mark.parametrize("delay", [0.05, 0.0])
def test_without_corrections_no_gain_is_advised(delay: float) -> None:
    """Every sample but the one at the start is late, and left out."""
    blocks = {
        "S": ({"type": "shgo", "theta": 2}, "late: innovation or late: replay"),
        "K": ({"type": "ekf", "theta": 2}, "late: replay"),
        "T": ({"type": "super_twisting", "f": 2}, "measure without delay"),
    }
    config = {
        "time": {"end": 1, "output_step": 0.1},
        "plant": {"type": "integrator_chain", "n": 2, "phi": "0", "initial": {"x1": 1, "x2": 1}},
        "measurement": {"sampling": {"period": 0.1}, "delay": delay, "noise": [{"type": "gaussian", "std": 0.1}]},
        "observers": {label: block | {"late": "drop"} for label, (block, _) in blocks.items()},
        "solver": {"step": 0.05},
    }
    text = " ".join("\n".join(advice(hgorun.analyze(Experiment(config, name="chain")))).split())
    for _, remedy in blocks.values():
        assert (f"whatever its gains are to change: {remedy}" in text) == (delay > 0)
    assert ("decays like" in text) == (delay == 0)
    assert ("larger for a faster" in text or "a smaller theta" in text) == (delay == 0)
