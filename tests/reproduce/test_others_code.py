"""What is made again when the code of another package changes."""

from __future__ import annotations

from pathlib import Path

import pytest
from outside import installed

from hgorun import code
from hgorun.noise.base import NOISE
from hgorun.reproduce import state
from hgorun.result.metrics.base import METRICS
from hgorun.study.loading import load_study

STUDY = """
time: {end: 1, output_step: 0.1}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
measurement: {noise: [{type: ramp, slope: 0.1}]}
observers: {A: {type: shgo, theta: 2}}
solver: {step: 0.1}
"""
RAMP = """
import casadi as ca
from hgorun.config.types import Number
from hgorun.noise.base import TimeFunction
from ramp_helper import factor
import json, numpy

class Ramp(TimeFunction):
    slope: Number
    def symbol(self, t, numbers):
        return factor * self.slope * t
"""
METRIC = """
from hgorun.result.metrics.base import Metric

def measure(estimates):
    return abs(estimates.error).mean(axis=0)

MEAN = Metric(name="mean_size", meaning="mean", unit="state", measure=measure)
"""


@pytest.mark.slow
def test_noise_metrics_and_the_modules_beside_them_are_ingredients(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    helper = tmp_path / "ramp_helper.py"
    helper.write_text("factor = 1.0\n")
    with (
        installed(tmp_path, monkeypatch, NOISE, "ramp_noise", RAMP, ramp="Ramp"),
        installed(tmp_path, monkeypatch, METRICS, "mean_metric", METRIC, mean_size="MEAN"),
    ):
        run = load_study(tmp_path / "study.yaml").runs["study"]

        def ingredients() -> state.Ingredients:
            code._of_distribution.cache_clear()
            return state.of_run(run)

        before = ingredients()
        assert {name for name in before if name.startswith("module")} == {"module ramp_noise", "module mean_metric"}
        helper.write_text("factor = 1.0  # a comment\n")
        assert state.difference(before, ingredients()) is None
        for file, changed in (("ramp_helper", "ramp_noise"), ("ramp_noise", "ramp_noise"), ("mean_metric",) * 2):
            path = tmp_path / f"{file}.py"
            text = path.read_text()
            path.write_text(f"{text}\nADDED = 1\n")
            assert state.difference(before, ingredients()) == f"module {changed} changed"
            path.write_text(text)
        assert ingredients() == before
    code._of_distribution.cache_clear()


def test_a_package_is_hashed_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "their_package"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "other.py").write_text("value = 1\n")
    (folder / "kind.py").write_text("class Kind:\n    pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    from their_package.kind import Kind  # type: ignore[import-not-found]  # written above

    before = code.code_of([Kind])
    code._of_distribution.cache_clear()
    (folder / "other.py").write_text("value = 2\n")
    after = code.code_of([Kind])
    assert before.keys() == after.keys() == {"module their_package"}
    assert before != after


def test_hgoruns_own_and_pythons_are_passed_over() -> None:
    assert code.code_of([NOISE.find("gaussian"), Path, int]) == {}
