"""Functions for an experiment that are given something else, as in a notebook."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest

import hgorun


@pytest.mark.parametrize("function", [hgorun.analyze, hgorun.Estimator, hgorun.sweep])
@pytest.mark.parametrize(
    ("given", "found"),
    [
        ("vdp.yaml", "found 'vdp.yaml'; hgorun.load reads one from a file or a mapping"),
        (Path("vdp.yaml"), "hgorun.load reads one"),
        ({"plant": {}}, "hgorun.load reads one"),
        (None, "found nothing"),
        (3, "found 3"),
    ],
)
def test_what_is_no_experiment_is_refused_in_words(function: Any, given: object, found: str) -> None:
    more = ({"observers.S.theta": [1]},) if function is hgorun.sweep else ()
    with pytest.raises(hgorun.ConfigError, match="experiment: expected an Experiment, found") as refused:
        cast("Any", function)(given, *more)
    assert found in str(refused.value)
