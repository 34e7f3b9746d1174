"""Why some observers have no limits on chains of integrators, in words of the user's own file."""

from __future__ import annotations

from typing import Any

import pytest
from examples import Block, chain, experiment, inline

from hgorun.analysis.reasons import NoValue
from hgorun.analysis.stability.critical import chain_system
from hgorun.errors import ConfigError, HgorunError, SimulationError
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

CHAIN = chain(3, start=0)
SAMPLED: Block = {"measurement": {"sampling": {"period": 0.1}}}
UNEVEN = inline({"x1": "x3", "x2": "-x2", "x3": "-x1"}, {"y1": "x1", "y2": "x2"}, initial={"x1": 1, "x2": 0, "x3": 0})


def prepared_run(observers: dict[str, Block], plant: Block = CHAIN, **more: Any) -> PreparedRun:
    return prepare(experiment(plant, observers, end=5, output_step=0.005, **more))


@pytest.mark.parametrize(
    ("block", "more", "reason"),
    [
        ({"type": "ekf", "Q": {"x2": 0.1}, "R": 1}, SAMPLED, "the observer is corrected by samples alone"),
        ({"type": "ekf", "q": 0.4, "R": 1}, SAMPLED, "the observer is corrected by samples alone"),
        ({"type": "impulsive", "theta": 2}, SAMPLED, "the observer is corrected by samples alone"),
        ({"type": "hgo_fd", "eps": 0.5}, SAMPLED, "the observer jumps at the samples"),
        ({"type": "kalman_bucy", "Q": {"x2": 1}, "R": 1}, {}, "the observer has no copy of the plant in chains"),
        ({"type": "shgo_riccati", "theta": 2}, {"plant": UNEVEN}, "blocks of different sizes, of 2 and 1 states"),
    ],
)
def test_an_observer_without_limits_on_chains_is_told_why(block: Block, more: Block, reason: str) -> None:
    run = prepared_run({"o": block}, **more)
    with pytest.raises(NoValue, match=f"^{reason}"):
        chain_system(run, "o")


def test_a_key_about_the_plants_own_output_is_named_as_written() -> None:
    run = prepared_run(
        {"o": {"type": "kalman_bucy", "theta": 2, "R": {"x1": 1}}}, inline({"x1": "x2", "x2": "0"}, "x1")
    )
    reason = "the observer does not take a chain of integrators: `R.x1` is about x1 of this plant"
    with pytest.raises(NoValue, match=f"^{reason}$"):
        chain_system(run, "o")


@pytest.mark.parametrize("error", [SimulationError("why"), ConfigError("why", file="chain", line=18, key="why")])
def test_no_file_is_named_that_nobody_has(monkeypatch: pytest.MonkeyPatch, error: HgorunError) -> None:
    run = prepared_run({"o": {"type": "shgo", "theta": 1}})

    def refuse(_: object) -> None:
        raise error

    monkeypatch.setattr("hgorun.analysis.linear.nominal.prepare", refuse)
    with pytest.raises(NoValue, match=r"^the observer does not take a chain of integrators: (why: )?why$"):
        chain_system(run, "o")
