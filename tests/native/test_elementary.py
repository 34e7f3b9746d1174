"""Elementary functions of arrays: those of the compiled code, whatever the shapes."""

from __future__ import annotations

import numpy as np
import pytest
from compiled_functions import bits, compiled

from hgorun.native import elementary

X, Y = np.random.default_rng(0).uniform(0.01, 0.99, (2, 1001))


@pytest.mark.parametrize("name", elementary.NAMES)
def test_they_are_those_of_the_compiled_code(name: str) -> None:
    arguments = (X, Y) if name in ("atan2", "pow", "hypot", "fmod") else (X + (name == "acosh"),)
    expected = compiled(8)(name, *arguments)
    assert np.array_equal(bits(elementary.apply(name, *arguments)), bits(expected))


def test_arguments_are_broadcast() -> None:
    found = elementary.apply("atan2", X[:6].reshape(2, 3), 0.5)
    assert found.shape == (2, 3)
    assert found[1, 2] == elementary.apply("atan2", X[5], 0.5)
    assert elementary.apply("sin", 0.5).shape == ()
    assert elementary.apply("sin", np.zeros((0, 2))).shape == (0, 2)
