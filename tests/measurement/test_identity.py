"""When samples are known to be the same: their times are compared where they are few."""

from __future__ import annotations

import numpy as np

from hgorun.measurement.samples import _COMPARED, Samples


def of_size(size: int) -> Samples:
    k = np.arange(size)
    return Samples(k + 0.5, k.astype(float), k, np.zeros_like(k), np.ones(size, dtype=bool))


def test_few_samples_are_the_same_by_their_numbers_and_many_by_being_one_object() -> None:
    assert of_size(10).identity == of_size(10).identity
    assert of_size(10).identity != of_size(11).identity
    many = of_size(_COMPARED + 1)
    assert many.identity == many.identity
    assert many.identity != of_size(_COMPARED + 1).identity
