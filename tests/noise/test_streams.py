"""Draws of many generators are those of NumPy's, each alone."""

from __future__ import annotations

import numpy as np
import pytest

from hgorun.noise.normal import standard_normal
from hgorun.noise.streams import Streams

KEY = (0, 1, 2**32 - 1, 123456789)
SEEDS = np.concatenate([[0, 1, 2**31, 2**32 - 1, 2**32, 2**63 - 1], np.random.default_rng(0).integers(0, 2**63, 200)])


def test_states_are_numpys() -> None:
    streams = Streams(SEEDS, KEY)
    for i, state in enumerate(streams.states.tolist()):
        own = np.random.PCG64(np.random.SeedSequence(int(SEEDS[i]), spawn_key=KEY)).state["state"]
        assert own == {"state": state[0] | state[1] << 64, "inc": state[2] | state[3] << 64}


@pytest.mark.parametrize("count", [1, 7, 1000])
def test_uniform_draws_are_numpys(count: int) -> None:
    streams = Streams(SEEDS, KEY)
    draws = streams.uniform(count)
    for i in range(len(streams)):
        assert draws[i].tobytes() == streams.generator(i).random(count).tobytes()


@pytest.mark.parametrize("count", [1, 7, 5000])
def test_normal_draws_are_those_of_single_streams(count: int) -> None:
    streams = Streams(SEEDS[:50], KEY)  # 250,000 draws, 70 of them from the tail
    draws = streams.normal(count)
    for i in range(len(streams)):
        assert draws[i].tobytes() == standard_normal(streams.generator(i), count).tobytes()


def test_few_streams_draw_without_machine_code() -> None:
    many, few = Streams(SEEDS, KEY), Streams(SEEDS[:2], KEY)
    assert many.normal(100)[:2].tobytes() == few.normal(100).tobytes()
    assert many.uniform(100)[:2].tobytes() == few.uniform(100).tobytes()


def test_doubtful_draws_are_left_to_exact_decisions(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a bound that doubts every decision, all streams are drawn again: the bits stay."""
    from hgorun.noise import compiled

    sure = Streams(SEEDS[:8], KEY).normal(2000)
    with monkeypatch.context() as patched:
        patched.setattr(compiled, "SURE", 10.0)
        code = compiled._Code()
        patched.setattr(compiled, "_code", lambda: code)
        assert np.any(compiled.normal(Streams(SEEDS[:8], KEY).states, 2000)[1].argument == 0)
        assert Streams(SEEDS[:8], KEY).normal(2000).tobytes() == sure.tobytes()


@pytest.mark.parametrize("kind", ["normal", "uniform"])
def test_many_draws_of_one_generator_are_the_same_as_few(kind: str) -> None:
    """The first are those of NumPy's generator, and of this room's normal draws, whatever the count."""
    one = Streams(np.array([11]), (1, 2, 3, 4))
    many = getattr(one, kind)(150_000)[0]
    generator = one.generator(0)
    few = standard_normal(generator, 150_000) if kind == "normal" else generator.random(150_000)
    np.testing.assert_array_equal(many, few)
    np.testing.assert_array_equal(getattr(one, kind)(1_000)[0], many[:1_000])
