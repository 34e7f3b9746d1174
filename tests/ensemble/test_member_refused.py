"""Why a member cannot be prepared, with the place of what is wrong: an axis, or a line of the base."""

from __future__ import annotations

from typing import Any

import pytest
from ensembles import ensemble

from hgorun.ensemble.members.refused import told_where


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ({"observers.SHGO.theta": [-1, 2.0]}, "axis observers.SHGO.theta: expected a number above 0, found -1"),
        ({"observers.*.theta": [-1, 2.0]}, "axis observers.*.theta: observers.SHGO.theta: expected a number above 0"),
        ({"observers.SHGO.poles": ["1", "-1"]}, "axis observers.SHGO.poles: poles must have a negative real part"),
        ({"time.end": [1e9, 0.5]}, "test:3: time.output_step: the output grid has 1e+10 points"),
    ],
)
def test_the_axis_is_named_that_has_made_the_value(axes: dict[str, Any], words: str) -> None:
    """The base has another value at that key, in a line that nothing is wrong with."""
    assert told_where(ensemble(axes), 0, "recorded").startswith(words)
    assert told_where(ensemble(axes), 1, "recorded") == "recorded"
