"""Ensembles from Python: what is no argument is refused in a sentence."""

from __future__ import annotations

from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest
from ensembles import base

import hgorun
from hgorun.ensemble import call
from hgorun.errors import ConfigError, HgorunError

AXES = {"seed": [1]}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"axes": None}, "axes: this key has no value"),
        ({"axes": [1]}, "axes: expected a mapping, found a list"),
        ({"axes": "a"}, "axes: expected a mapping, found 'a'"),
        ({"axes": {1: [1]}}, "expected text, found 1"),
        ({"axes": {"seed": 3}}, "3 seeds are the axis `seed: {count: 3}`"),
        ({"axes": {"solver.step": 3}}, "solver.step: expected [a, b, ...]"),
        ({"keep": "all"}, "keep: expected a mapping with keys metrics, quantities, trajectories; found 'all'"),
        ({"keep": []}, "keep: expected a mapping with keys metrics, quantities, trajectories; found a list"),
        ({"combine": 3}, "combine: expected 'product', 'zip' or 'sobol', found 3"),
        ({"executor": "threads"}, "executor: expected a function such as"),
        ({"output": 3}, "output: expected the path of a file, found 3"),
        ({"output": ""}, "output: expected the path of a file, found ''"),
        ({"experiment": "vdp.yaml"}, "experiment: expected an Experiment, found 'vdp.yaml'; hgorun.load reads one"),
        ({"experiment": None}, "experiment: expected an Experiment, found nothing"),
    ],
)
def test_arguments_of_other_kinds(arguments: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"experiment": base(), "axes": AXES} | arguments
    with pytest.raises(HgorunError) as caught:
        hgorun.sweep(**given)
    assert message in str(caught.value)


def test_mappings_need_not_be_dictionaries() -> None:
    keep = MappingProxyType({"metrics": ["rmse"]})
    assert list(hgorun.sweep(base(), MappingProxyType(AXES), keep).metrics) == ["rmse"]


def test_a_place_that_cannot_be_written_is_told_before_anything_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "folder.h5").mkdir()
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(call, "carry_out", None)
    for name, why in (("folder.h5", "it is a folder"), ("file/a.h5", f"{tmp_path}/file is a file, not a folder")):
        with pytest.raises(ConfigError) as caught:
            hgorun.sweep(base(), AXES, output=tmp_path / name)
        assert str(caught.value) == f"output: {tmp_path / name} cannot be written: {why}"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.h5"]
