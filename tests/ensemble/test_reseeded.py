"""Members whose seed moves or loses samples: prepared from one of them, they have their own times and noise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, experiment, inline

from hgorun import Experiment
from hgorun.ensemble.members.members import Members
from hgorun.ensemble.preparation import reseeded
from hgorun.ensemble.preparation.lot import times_of
from hgorun.ensemble.preparation.reseeded import reseeded_members, retimed_lots
from hgorun.measurement.chance import OfSeed, OfSeeds
from hgorun.noise.gaussian import GaussianNoise
from hgorun.simulation.passes.passes import as_given, plan_of
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

SAMPLINGS: dict[str, dict[str, Any]] = {
    "moved": {"sampling": {"period": 0.1, "jitter": 0.04}},
    "lost": {"sampling": {"period": 0.1, "dropout": 0.3}},
    "both, in one of two phases": {
        "phases": [{"until": 1, "sampling": {"period": 0.1, "jitter": 0.08, "dropout": 0.2}}, {"until": 9}],
    },
    "late": {"sampling": {"period": 0.1, "jitter": 0.04}, "delay": 0.07},
}
NOISE = [{"type": "gaussian", "std": 0.1}, {"type": "uniform", "low": -1, "high": 1, "hold": 0.1}]
HELD = {"phases": [{"until": 1, "noise": NOISE}, {"until": 9, "noise": NOISE[1:]}]}
SEEDS = np.arange(3, 23)


def base(case: str) -> Experiment:
    measurement = dict(SAMPLINGS[case])
    if "phases" in measurement:
        own = zip(measurement["phases"], HELD["phases"], strict=True)
        measurement["phases"] = [phase | noise for phase, noise in own]
    else:
        measurement["noise"] = NOISE
    return experiment(VAN_DER_POL, {"H": {"type": "shgo", "theta": 2}}, end=2.0, step=0.02, measurement=measurement)


def arrays(run: PreparedRun) -> list[np.ndarray]:
    """All that its seed decides."""
    found = [run.schedule.events, run.schedule.inward, run.schedule.variant, run.numbers.p, run.numbers.z0]
    for channel in run.heard:
        samples = channel.samples
        found += [samples.arrival, samples.taken, samples.number, samples.used, *channel.gain_and_bias]
        found += channel.held_changes
    return found


@pytest.mark.parametrize("case", SAMPLINGS)
def test_a_member_prepared_from_another_one_is_that_prepared_alone(case: str) -> None:
    of, members = base(case), Members.of({"seed": SEEDS})
    found = reseeded_members(of, members, np.arange(SEEDS.size))
    assert sorted(found) == list(range(SEEDS.size))
    for i, seed in enumerate(SEEDS.tolist()):
        alone = prepare(of.varied({"seed": seed}))
        assert found[i].structure is alone.structure
        assert found[i].schedule.variants == alone.schedule.variants
        for own, expected in zip(arrays(found[i]), arrays(alone), strict=True):
            np.testing.assert_array_equal(own, expected)


def test_members_that_differ_in_more_are_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each group is prepared from a member of its own; a group of a few is left to be prepared one by one."""
    members = Members.of({"seed": np.arange(20), "observers.H.theta": np.repeat([2.0, 3.0], [12, 8])[:20]})
    monkeypatch.setattr(reseeded, "_FEW", 10)
    found = reseeded_members(base("moved"), members, np.arange(20))
    assert sorted(found) == list(range(12))


def test_a_member_that_is_not_as_expected_leaves_all_to_be_prepared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reseeded, "_same", lambda run, other: False)
    assert not reseeded_members(base("moved"), Members.of({"seed": SEEDS}), np.arange(SEEDS.size))


def test_sizes_relative_to_the_output_are_left_to_be_prepared() -> None:
    measurement = SAMPLINGS["moved"] | {"noise": [{"type": "gaussian", "snr_db": 20}]}
    of = experiment(VAN_DER_POL, {"H": {"type": "shgo", "theta": 2}}, end=1.0, step=0.02, measurement=measurement)
    assert not reseeded_members(of, Members.of({"seed": SEEDS}), np.arange(SEEDS.size))


def test_draws_made_together_are_those_of_each_seed() -> None:
    """Whatever the counts, which grow and fall from one run to the next."""
    together, item = OfSeeds(SEEDS), GaussianNoise(type="gaussian", std=2.0)
    for i, count in ((0, 5), (3, 40), (7, 12)):
        alone = OfSeed(int(SEEDS[i]))
        np.testing.assert_array_equal(together.of(i).uniform(count, "a", 1), alone.uniform(count, "a", 1))
        drawn = together.of(i).draws(item, count, "b"), alone.draws(item, count, "b")
        np.testing.assert_array_equal(*drawn)


def test_members_of_one_seed_are_known_to_have_the_same_times() -> None:
    """Though each group makes its samples anew: else every member makes a lot of its own."""
    members = Members.of({"seed": np.tile(SEEDS, 2), "observers.H.theta": np.repeat([2.0, 2.1], SEEDS.size)})
    found = reseeded_members(base("late"), members, np.arange(len(members)))
    times = [times_of(found[i]) for i in range(len(members))]
    assert times[: SEEDS.size] == times[SEEDS.size :]
    assert len(set(times)) == SEEDS.size


RETIMED: dict[str, dict[str, Any]] = {
    "moved": {"noise": NOISE[:1], "sampling": {"period": 0.1, "jitter": 0.04}},
    "multiplied, not from the start": {
        "mode": "multiplicative",
        "noise": [*NOISE[:1], {"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3}]}],
        "sampling": {"period": 0.1, "jitter": 0.02, "offset": 0.05},
    },
    "lost": {"sampling": {"period": 0.1, "jitter": 0.04, "dropout": 0.1}},
}


@pytest.mark.parametrize("case", RETIMED)
def test_the_tables_of_many_members_are_those_of_each_of_them(case: str) -> None:
    """With kinks of an input between the samples, near the start, and where the order of both differs."""
    plant = inline(
        {"x1": "x2", "x2": "u - x1"}, "x1", inputs={"u": "abs(sin(7*t)) + abs(t - 1)"}, initial={"x1": 1, "x2": 0}
    )
    observers, count = {"H": {"type": "shgo", "theta": 2}}, 60
    of = experiment(plant, observers, end=2.0, step=0.02, measurement=RETIMED[case])
    lots = list(retimed_lots(of, Members.of({"seed": np.arange(count)}), np.arange(count)))
    members = np.concatenate([lot.which for lot in lots])
    assert len(set(members.tolist())) == members.size == count
    for lot in lots:
        assert lot.plans is not None
        for i, plan in list(zip(lot.which.tolist(), lot.plans, strict=True))[::3]:
            alone = prepare(of.varied({"seed": i}))
            own, start = plan_of(alone, as_given(alone))
            assert alone.structure is lot.run.structure
            for name in ("spans", "counts", "actions", "gain", "bias", "holds", "grid"):
                assert getattr(plan, name).tobytes() == getattr(own, name).tobytes(), (i, name)
            assert plan.slots == own.slots
            np.testing.assert_array_equal(start.z[:, 0], lot.numbers.z0[:, 0])


def test_events_that_are_too_near_are_left_to_be_prepared() -> None:
    """Samples that jitter moves onto a kink, or past each other, and noise that is held."""
    plant = inline({"x1": "x2", "x2": "u - x1"}, "x1", inputs={"u": "abs(t - 1)"}, initial={"x1": 1, "x2": 0})
    members, which = Members.of({"seed": np.arange(40)}), np.arange(40)

    def bulk(measurement: dict[str, Any]) -> int:
        of = experiment(plant, {"H": {"type": "shgo", "theta": 2}}, end=2.0, step=0.02, measurement=measurement)
        return sum(lot.which.size for lot in retimed_lots(of, members, which))

    assert bulk({"sampling": {"period": 0.5, "dropout": 1e-9}}) == 0  # a sample at the kink
    assert 0 < bulk({"sampling": {"period": 0.1, "jitter": 0.06}}) < 40
    assert bulk({"sampling": {"period": 0.1, "jitter": 0.04}, "noise": NOISE}) == 0
