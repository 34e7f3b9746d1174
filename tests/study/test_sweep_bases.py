"""The base of a sweep file: which run of it members vary, and where what is wrong in it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun.errors import ConfigError
from hgorun.study.sweep_file import load_sweep

BASE = """\
time: {end: 0.2, output_step: 0.01}
plant: {type: van_der_pol, initial: {x1: 1, x2: -1}}
observers: {S: {type: shgo, theta: 3}}
"""
RUNS = """\
runs:
  one: {seed: 5}
  seeds: {seeds: 3}
  gains: {vary: {name: th, values: [2, 3], set: {observers.S.theta: th}}}
"""


def refused(path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_sweep(path)
    return str(caught.value).removeprefix(f"{path.parent}/")


@pytest.mark.parametrize("here", [True, False])
@pytest.mark.parametrize(
    ("run", "message"),
    [
        ("", "run: expected one of one."),
        ("run: on\n", "run: expected one of one. Did you mean `one`?"),
        ("run: seeds\n", "run: the run 'seeds' is an ensemble itself, by seeds; members vary a single run"),
        ("run: gains\n", "run: the run 'gains' is an ensemble itself, by vary; members vary a single run"),
    ],
)
def test_members_vary_a_single_run(tmp_path: Path, here: bool, run: str, message: str) -> None:
    (tmp_path / "base.yaml").write_text(BASE + RUNS)
    base = "base:\n" + "".join(f"  {line}\n" for line in (BASE + RUNS).splitlines()) if here else "base: base.yaml\n"
    rest = "axes: {observers.S.theta: [2, 3]}\n"
    assert message in refused(tmp_path / "a.yaml", base + run + rest)
    (tmp_path / "a.yaml").write_text(f"{base}run: one\n{rest}")
    assert load_sweep(tmp_path / "a.yaml").base.blocks.seed == 5


def test_faults_of_a_base_that_is_written_here_have_its_key(tmp_path: Path) -> None:
    text = "base:\n  time: {end: 1, output_step: 0.1}\n  plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}\n"
    text += "  observers:\n    S: {type: shgo, theta: 3, rho: 4}\naxes: {seed: [1]}\n"
    assert refused(tmp_path / "a.yaml", text).startswith("a.yaml:5: base.observers.S.rho: unknown key 'rho'")


def test_runs_are_no_axis(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(BASE)
    text = "base: base.yaml\naxes: {runs.one.seed: [1, 2]}\n"
    assert "'runs' stands at the top of a file, and is not a key of a single run" in refused(tmp_path / "a.yaml", text)
