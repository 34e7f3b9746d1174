"""Outputs belong to states by what they measure, not by their names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import examples
import pytest

import hgorun
from hgorun.config.study import Figure
from hgorun.errors import Problem
from hgorun.figures.names import check, names_of


def simulated(output: Any) -> hgorun.Result:
    plant = {
        "states": ["T", "q"],
        "dynamics": {"T": "q - 0.2*(T - 20)", "q": "-0.1*q"},
        "output": output,
        "initial": {"T": 25, "q": 5},
    }
    return hgorun.simulate(examples.experiment(plant, {}, end=2, measurement={"sampling": {"period": 0.5}}))


@pytest.mark.parametrize(
    ("output", "outputs"),
    [({"gauge": "T"}, ("gauge",)), ({"T": "1.8*T + 32"}, ()), ({"q": "T", "T": "q"}, ("q",)), ("T", ("T",))],
)
def test_outputs_are_matched_by_what_they_measure(tmp_path: Path, output: Any, outputs: tuple[str, ...]) -> None:
    result = simulated(output)
    assert result.outputs_of("T") == outputs
    assert hgorun.read(result.save(tmp_path / "run.h5")).outputs_of("T") == outputs
    figure = {"one": Figure.model_validate({"panels": [{"state": "T", "measurements": True}]})}
    if not outputs:
        with pytest.raises(Problem, match="no output is the state 'T'"):
            check(figure, names_of([result]))
    else:
        check(figure, names_of([result]))
