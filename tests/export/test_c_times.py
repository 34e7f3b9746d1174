"""What an exported observer does at times that are none, later than now, or those of the sample before."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from examples import Block, chain, experiment, inline
from exported_c import Compiled, load_all

from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator
from hgorun.export.c_files import c_files
from hgorun.export.prepared import Wanted, exported
from hgorun.observers.base import CorrectedObserver
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun

OK, OLD, NOT_FINITE, BAD_TIME, TOO_FAR, INCOMPLETE, BAD_GAP = range(7)
CHAIN = chain(2, "-x1", 1.0)
SAMPLED: Block = {"sampling": {"period": 0.1}}
NOISE = [{"type": "gaussian", "std": 0.1}]
STEPPING: dict[str, Block] = {
    "levant": {"type": "levant", "G": 2, "discretisation": "implicit"},
    "reduced_sampled": {"type": "reduced_sampled", "H": 2},
    "deadbeat": {"type": "deadbeat"},
    "hgo_fd": {"type": "hgo_fd", "eps": 0.4},
    "hgo_sa": {"type": "hgo_sa", "eps": 0.4},
}


def run_of(plant: Block, blocks: Mapping[str, Block], measurement: Block) -> PreparedRun:
    return prepare(experiment(plant, dict(blocks), measurement=measurement, step=0.01, end=3.0))


def started(one: Compiled) -> Compiled:
    return Compiled(one.library, one.observer, one.single)


@pytest.mark.parametrize("late", [0.0, 0.25])
def test_a_sample_of_later_than_now_counts_as_now(late: float, tmp_path: Path) -> None:
    """With a history and without one: what comes after it is taken as ever."""
    run = run_of(CHAIN, {"O": {"type": "shgo", "theta": 2}}, SAMPLED)
    one = load_all(tmp_path, exported(run, Wanted(late=late)), "-O0")["O"]
    other = started(one)
    for k in range(1, 8):
        for each, ahead in ((one, 0.0), (other, 1e9 if k == 3 else 1e-9)):
            assert each.predict(k / 10) == OK
            assert each.update(k / 10 + ahead, [0.5], 1) == OK
        assert one.memory.raw == other.memory.raw


@pytest.mark.costly
@pytest.mark.parametrize("single", [False, True])
def test_no_step_leads_to_a_second_sample_of_one_time(single: bool, tmp_path: Path) -> None:
    """Also to one of the start; an infinite time leaves an observer that stands still where it is."""
    for one in load_all(tmp_path, exported(run_of(CHAIN, STEPPING, SAMPLED)), "-O0", single=single).values():
        other = started(one)
        for t in np.arange(8) / 10:
            for each in (one, other):
                assert each.predict(t) == each.update(t, [np.cos(t)], 1) == OK
            before = one.memory.raw
            assert one.update(t, [np.cos(t)], 1) == one.update(t + 1, [0.3], 1) == OLD
            assert one.update(np.inf, [0.3], 1) == one.predict(np.inf) == BAD_TIME
            assert one.memory.raw == before == other.memory.raw
        assert np.isfinite(one.estimate).all()


@pytest.mark.costly
@pytest.mark.parametrize("n", [3, 5])
def test_a_second_sample_of_one_time_but_for_its_rounding(n: int, tmp_path: Path) -> None:
    """In `float` powers of such a step are zero, and the estimate was no number for ever."""
    run = run_of(chain(n, "-x1", 1.0), {"levant": STEPPING["levant"]}, SAMPLED)
    (one,) = load_all(tmp_path, exported(run), "-O0", single=True).values()
    other = started(one)
    for t in np.arange(8) / 10:
        for each in (one, other):
            assert each.predict(t) == each.update(t, [np.cos(t)], 1) == OK
        for later in (1e-16 + np.spacing(t), 1e-13, 9e-8):
            assert (one.predict(t + later), one.update(t + later, [np.cos(t)], 1)) == (OK, OLD)
        np.testing.assert_array_equal(one.estimate, other.estimate)
    assert (one.predict(0.7002), one.update(0.7002, [0.7], 1)) == (OK, OK)
    assert np.isfinite(one.estimate).all()


@pytest.mark.parametrize(
    "block", [{"type": "ekf", "Q": {"x1": 0.1}}, {"type": "savgol", "window": 3}, STEPPING["deadbeat"]]
)
def test_late_samples_of_observers_that_jump_are_refused(block: Block) -> None:
    run = run_of(CHAIN, {"O": block}, {**SAMPLED, "noise": NOISE})
    assert exported(run)
    with pytest.raises(ConfigError, match=f"exported code of {block['type']} takes samples when .*leave --late out"):
        exported(run, Wanted(late=0.3))


@pytest.mark.costly
def test_times_of_what_is_continuous(tmp_path: Path) -> None:
    """One that is none changes nothing, nor does a number that is none; an earlier one is now."""
    plant = inline({"a": "b", "b": "-a + u - v"}, ["a", "b"], inputs={"u": "0", "v": "0"})
    run = run_of(plant, {"O": {"type": "shgo_riccati", "theta": 2}}, {})
    one = load_all(tmp_path, exported(run, Wanted(inputs_given=True)), "-O0")["O"]
    other = started(one)
    for each in (one, other):
        assert each.measure(0.0, [1.0, 0.5], 3) == each.input(0.0, [1.0, 2.0]) == each.predict(0.5) == OK
    before = one.memory.raw
    for t in (np.nan, -1.0, np.inf, -np.inf):
        assert one.measure(t, [7.0, 7.0], 3) == one.input(t, [7.0, 7.0]) == BAD_TIME
    assert one.measure(0.6, [7.0, np.nan], 3) == one.input(0.6, [7.0, np.inf]) == NOT_FINITE
    assert one.memory.raw == before
    for each, t in ((one, 0.2), (other, 0.5)):
        assert each.measure(t, [0.9, 0.4], 3) == each.input(t, [0.3, 0.1]) == OK
    assert before != one.memory.raw == other.memory.raw


OF_ONE_PERIOD: dict[str, Block] = {
    "luenberger_exact": {"type": "luenberger_exact", "poles": [-1, -2]},
    "extended": {"type": "aekf", "update": "jump", "theta_1": 2.0, "m": 0.05, "copies": 1, "extend": 1},
    "any": {"type": "ekf", "Q": {"x2": 0.01}},
}
TIMES = [0.0, 0.1, 0.2 + 1e-8, 0.35, 0.4, 0.4, 0.41, 0.499, 0.9, 1.0 + 3e-7, 1.25, 2.0, 2.1]


@pytest.mark.costly
@pytest.mark.parametrize("name", OF_ONE_PERIOD)
def test_samples_that_are_not_whole_periods_apart(name: str, tmp_path: Path) -> None:
    """What a stream refuses is not used, and changes nothing."""
    noisy = {**SAMPLED, "noise": NOISE}
    run = run_of(chain(2, "-x1", 1.0), {"O": OF_ONE_PERIOD[name]}, noisy)
    one, stream, refused = load_all(tmp_path, exported(run), "-O0")["O"], Estimator(run.experiment), []
    for t in TIMES:
        stream.update(t, {})  # as far as the other, in the same steps
        assert one.predict(t) == OK
        before, found = one.memory.raw, one.update(t, [np.cos(t)], 1)
        try:
            stream.update(t, {"x1": np.cos(t)})
        except ValueError:
            refused.append(t)
            assert found == BAD_GAP
            assert one.memory.raw == before
        else:
            assert found == OK
            np.testing.assert_allclose(one.estimate, stream.estimate()["O"], rtol=0, atol=1e-12)
    assert refused == ([] if name == "any" else [0.35, 0.41, 0.499, 1.0 + 3e-7, 1.25])
    assert one.update(2.1, [np.nan], 1) == NOT_FINITE


def test_the_period_stands_in_the_header() -> None:
    """Of an observer whose times matter, also with unknown inputs."""
    for name, told in (("luenberger_exact", True), ("any", False)):
        (one,) = exported(run_of(CHAIN, {"O": OF_ONE_PERIOD[name]}, {**SAMPLED, "noise": NOISE}))
        assert ("Whole periods of 0.1 after the last one: at other times BAD_GAP." in c_files(one)["O.h"]) is told
    sampled = {**SAMPLED, "noise": NOISE}
    extended = experiment(CHAIN, {"O": OF_ONE_PERIOD["extended"]}, measurement=sampled, step=0.01).designs["O"]
    assert isinstance(extended.observer, CorrectedObserver)
    assert extended.observer.whole_periods(extended.form) == pytest.approx(0.1)
