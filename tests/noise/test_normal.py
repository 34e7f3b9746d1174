"""Normal draws: NumPy's, but for the last bit of those that a C library has a part in."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf

from hgorun.noise.normal import _is_below, standard_normal
from hgorun.noise.ziggurat import EDGES


def draws(seed: int, count: int) -> np.ndarray:
    return standard_normal(np.random.default_rng(seed), count)


@pytest.mark.parametrize("seed", range(3))
def test_they_are_those_of_numpy(seed: int) -> None:
    found, expected = draws(seed, 300_000), np.random.default_rng(seed).standard_normal(300_000)
    different = found != expected
    assert np.all(np.abs(found[different]) > EDGES[-1])  # behind the last layer NumPy takes the library's logarithm
    np.testing.assert_allclose(found, expected, rtol=4e-16)
    assert different.sum() <= 10


@pytest.mark.parametrize("count", [0, 1, 2, 7, 100, 5000])
def test_the_first_draws_do_not_depend_on_the_count(count: int) -> None:
    assert np.array_equal(draws(3, count), draws(3, 20_000)[:count])


def test_words_that_all_decide_slowly_are_enough() -> None:
    """Where every draw takes several words, more of them are asked for."""

    class Bits:
        def random_raw(self, count: int) -> np.ndarray:
            # the lowest layer, all the way to its end: a draw of the tail each time, from two more words
            return np.tile(np.array([(2**52 - 1) << 9, 1 << 63, 1 << 62], dtype=np.uint64), count)[:count]

    class Generator:
        bit_generator = Bits()

    found = standard_normal(Generator(), 1000)  # type: ignore[arg-type]  # all that is asked of one
    assert np.all(np.abs(found) > EDGES[-1])


def test_what_is_too_close_for_floats_is_decided_exactly() -> None:
    mp.dps = 60
    for layer in (1, 2, 100, 254, 255):
        low, high = mpf(EDGES[layer]), mpf(EDGES[layer - 1] if layer > 1 else 0)
        x = float(0.3 * low + 0.7 * high)
        f_low, f_high, f_x = (mp.exp(-(mpf(v) ** 2) / 2) for v in (low, high, x))
        border = (f_x - f_low) / (f_high - f_low)
        u = float(border)
        near = [float(np.nextafter(u, side)) for side in (0.0, 1.0)]
        assert [_is_below(x, layer, v) for v in (*near, u)] == [True, False, mpf(u) < border]
