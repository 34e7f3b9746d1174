"""Flows that lose an observer with automatic steps are made again for it alone, in a file and in a stream alike."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import yaml
from examples import Block
from recordings import recording, signal, source

from hgorun.engine.again import Again
from hgorun.estimate.completed import streamed
from hgorun.estimate.estimate import estimate
from hgorun.estimate.stated_of_data import StatedOfData
from hgorun.estimate.stream.estimator import Estimator
from hgorun.result.result import Result
from hgorun.simulation.timeline import steps

GAP, COUNT, STD = 0.125, 17, 1e-4
END = GAP * (COUNT - 1)
PLANT: Block = {"states": ["x", "v"], "dynamics": {"x": "v", "v": "-sin(x)"}, "output": "x"}
START = {"x": 0.5, "v": 0.0}
UKF: Block = {"UKF": {"type": "ukf", "Q": {"v": 0.001}}}  # with P(0) = 1 beside a variance of 1e-8
SHGO: Block = {"SHGO": {"type": "shgo", "theta": 3, "poles": -1}}
NOMINAL = END / 1024
Row = tuple[float, float, float]  # known, taken, value


def rows_of(late: Sequence[int] = (), outlier: int | None = None) -> list[Row]:
    taken = GAP * np.arange(COUNT)
    y = np.cos(taken) + STD * np.random.default_rng(2).normal(size=COUNT)
    known = taken.copy()
    known[list(late)] += 1.5 * GAP
    if outlier is not None:
        y[outlier] += 1.0
    return list(zip(known.tolist(), taken.tolist(), y.tolist(), strict=True))


def config(observers: Block, late: str | None = None, output_step: float = GAP, **more: Block) -> Block:
    own = {"initial": START, **({"late": late} if late else {})}
    return {
        "plant": PLANT,
        "observers": {label: {**own, **block} for label, block in observers.items()},
        "time": {"start": 0.0, "end": END, "output_step": output_step},
        "measurement": {"noise": [{"type": "gaussian", "std": STD}]},
        **more,
    }


def of_file(text: Block, rows: Sequence[Row], gate: float | None = None) -> Result:
    known, taken, y = np.array(rows).T
    return estimate(source(text), recording(signal("x", taken, y, known, gate=gate)), sensitivity=False)


def step_of(result: Result) -> float | None:
    assert result.integration is not None
    return result.integration.step


def stream_of(text: Block, gate: float | None = None, remembered: int = 1000) -> Estimator:
    given = source(text)
    gates = {} if gate is None else {"x": gate}
    return Estimator(streamed(given, StatedOfData.of(given), "e"), gates=gates, remembered=remembered)


def taken_by(estimator: Estimator, rows: Sequence[Row]) -> None:
    for known, taken, y in sorted(rows):
        estimator.update(taken, {"x": y}, available=known)


def test_a_stream_and_a_file_follow_a_filter_that_their_steps_lose() -> None:
    text, rows = config({**UKF, **SHGO}), rows_of()
    result, estimator = of_file(text, rows), stream_of(text)
    assert step_of(result) == NOMINAL
    for k, row in enumerate(rows):
        taken_by(estimator, [row])
        for label, one in result.observers.items():
            assert one.status == "ok"
            np.testing.assert_array_equal(estimator.estimate()[label], one.xhat[k], err_msg=f"{label}, row {k}")
    short = of_file({**text, "solver": {"step": NOMINAL / 256}}, rows).observers["UKF"]
    np.testing.assert_allclose(result.observers["UKF"].xhat, short.xhat, rtol=0, atol=1e-8)
    np.testing.assert_array_equal(result.observers["SHGO"].xhat, of_file(config(SHGO), rows).observers["SHGO"].xhat)


def test_with_a_given_step_both_lose_it() -> None:
    text = config(UKF, solver={"step": NOMINAL})
    estimator = stream_of(text)
    taken_by(estimator, rows_of())
    assert estimator.any_lost
    assert not np.isfinite(of_file(text, rows_of()).observers["UKF"].xhat[-1]).any()


def test_it_is_lost_where_a_bound_is_given() -> None:
    text = config(UKF, solver={"divergence": 1e6})
    estimator = stream_of(text)
    taken_by(estimator, rows_of())
    assert estimator.any_lost
    assert of_file(text, rows_of()).observers["UKF"].status == "diverged"


@pytest.mark.parametrize(
    ("late", "which", "gate", "outlier"),
    [(None, (), 5.0, 6), ("replay", (3, 7), None, None), ("replay", (1, 7), 5.0, 9), ("drop", (1,), None, None)],
    ids=["gate", "late", "late and gate", "dropped"],
)
def test_with_gates_and_late_samples(late: str | None, which: Sequence[int], gate: float | None, outlier: int) -> None:
    text, rows = config(UKF, late=late), rows_of(which, outlier)
    result, estimator = of_file(text, rows, gate), stream_of(text, gate)
    taken_by(estimator, rows)
    assert step_of(result) == NOMINAL
    assert np.isfinite(result.observers["UKF"].xhat).all()
    np.testing.assert_array_equal(estimator.estimate()["UKF"], result.observers["UKF"].xhat[-1])


def test_output_points_in_between_are_those_of_the_shorter_steps() -> None:
    text, rows = config({**UKF, **SHGO}, output_step=GAP / 50), rows_of()
    result = of_file(text, rows)
    short = of_file({**text, "solver": {"step": NOMINAL / 256}}, rows)
    for label in ("UKF", "SHGO"):
        np.testing.assert_allclose(result.observers[label].xhat, short.observers[label].xhat, rtol=0, atol=1e-8)


def test_flows_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """A flow of many steps is several segments, which are made again together."""
    text, rows = config(UKF), rows_of()
    whole = of_file(text, rows).observers["UKF"].xhat
    monkeypatch.setattr(steps, "_PIECE", 24)
    monkeypatch.setattr("hgorun.engine.careful_session._AT_ONCE", 1)
    monkeypatch.setattr(
        "hgorun.simulation.timeline.tables._TABLES", type("None_", (), {"get": lambda _, key, make: make()})()
    )
    np.testing.assert_array_equal(of_file(text, rows).observers["UKF"].xhat, whole)


def test_what_is_lost_with_any_step_changes_nothing_of_others() -> None:
    """v' = 0.3 v^3 from 3 is infinite at t = 1/(0.6 9) = 0.19, and hardly corrected."""
    plant: Block = {"states": ["x", "v"], "dynamics": {"x": "v", "v": "0.3*v**3"}, "output": "x"}
    free: Block = {"FREE": {"type": "shgo", "theta": 1e-3, "poles": -1, "initial": {"x": 0.0, "v": 3.0}}}
    text = {**config({**free, **UKF}), "plant": plant}
    rows = rows_of()
    result, estimator = of_file(text, rows), stream_of(text)
    taken_by(estimator, rows)
    assert result.observers["FREE"].status == "diverged"
    assert estimator.lost == {"FREE": True, "UKF": False}
    alone = stream_of({**text, "observers": {"UKF": text["observers"]["UKF"]}})
    taken_by(alone, rows)
    for found in (result.observers["UKF"].xhat[-1], alone.estimate()["UKF"]):
        np.testing.assert_array_equal(estimator.estimate()["UKF"], found)


def test_samples_that_come_together_are_taken_one_by_one_for_it() -> None:
    text, rows = config({**UKF, **SHGO}), rows_of()
    one, several = stream_of(text), stream_of(text, remembered=0)
    taken_by(one, rows)
    taken_by(several, rows[:1])
    _, t, y = np.array(rows[1:]).T
    kinds = np.zeros(t.size, dtype=np.int64)
    assert several.at_once(t, kinds) == t.size
    found = several.update_many(t, kinds, y)
    for label, xhat in one.estimate().items():
        np.testing.assert_array_equal(found[label][0][-1], xhat)
        assert not found[label][1].any()
    np.testing.assert_array_equal(several.estimate()["UKF"], one.estimate()["UKF"])


def test_a_restored_stream_makes_flows_again(tmp_path: Path) -> None:
    text, rows = config(UKF), rows_of()
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(text))
    estimator, other = (Estimator.load(tmp_path / "config.yaml") for _ in range(2))
    taken_by(estimator, rows[:1])
    ahead = estimator.predict(GAP)["UKF"]
    other.restore(estimator.checkpoint())
    taken_by(other, rows[1:])
    result = of_file(text, rows).observers["UKF"].xhat
    np.testing.assert_array_equal(other.estimate()["UKF"], result[-1])
    assert np.isfinite(ahead).all()


EVEN: Block = {"theta": 3, "interval": GAP}


@pytest.mark.costly
@pytest.mark.parametrize(
    "block",
    [
        {"type": "ekf", "Q": {"v": 0.001}, "internal": {"P": 1e4 * STD**2}},
        {"type": "kalman_bucy", "Q": {"v": 0.001}, "R": {"x": 1e-3}, "internal": {"P": 10.0}},
        {"type": "hg_ekf", "theta": 3},
        {"type": "hg_ekf", "update": "jump", **EVEN},
        {"type": "aekf", "update": "jump", "theta_1": 3, "m": 0.05, "copies": 2, "interval": GAP},
        {"type": "shgo", "theta": 24, "poles": -1},  # much larger than these samples permit
    ],
    ids=lambda block: block["type"],
)
def test_a_stream_has_the_bits_of_a_file_with_automatic_steps(block: Block) -> None:
    text, rows = config({"O": block}), rows_of()
    result, estimator = of_file(text, rows).observers["O"], stream_of(text)
    assert result.status == "ok"
    for k, row in enumerate(rows):
        taken_by(estimator, [row])
        np.testing.assert_array_equal(estimator.estimate()["O"], result.xhat[k], err_msg=f"row {k}")


def test_which_observers_are_lost() -> None:
    again = Again([(0, 2, 3), (3, 4, 4)])
    assert not again.lost(np.array([1.0, -10.0, 99.0, 5.0]), 10.0)
    assert again.lost(np.array([1.0, np.nan, 2.0, -11.0]), 10.0) == {0, 1}
    assert list(again.more(1 << 18)) == [2, 4]
    assert len(list(again.more(3))) == 10
    assert not list(again.more(1 << 20))
