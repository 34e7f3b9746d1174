"""A change by ``--set`` or ``--seed`` that does not reach a run is said."""

from __future__ import annotations

from pathlib import Path

import pytest
from shell import Shell

from hgorun.observers.shgo import StandardObserver
from hgorun.study.kept import kept_by_runs
from hgorun.study.loading import load

FILE = """
time: {end: 0.2, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
observers: {S: {type: shgo, theta: 2}, "T=1": {type: shgo, theta: 3}}
measurement: {sampling: {period: 0.1}}
runs:
  a: {observers: {S: {theta: 4}}, seed: 3}
  b: {measurement: {sampling: continuous}}
  c: {vary: {name: v, values: [2, 3], set: {observers.S.theta: v}}}
  d: {observers: {S: {type: ekf, q: 1, R: 1}}}
  e: {observers: {S: ~}}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "r.yaml"
    path.write_text(FILE)
    return path


OF_A = "the run a has the key observers.S.theta itself, which stays as it is; "
OF_C = "the run c varies observers.S.theta, whose values stay as they are"


@pytest.mark.parametrize(
    ("overrides", "seed", "run", "said"),
    [
        (
            ["observers.S.theta=9"],
            None,
            None,
            [
                f"--set observers.S.theta=9: {OF_A}`--set runs.a.observers.S.theta=9` changes it",
                f"--set observers.S.theta=9: {OF_C}",
            ],
        ),
        (["observers.S.theta=9"], None, "c", [f"--set observers.S.theta=9: {OF_C}"]),
        (["observers.S.theta=9"], None, "b", []),
        (["observers.S.theta=9"], None, "d", []),  # where S has no theta
        (["observers.S.theta=9"], None, "e", []),  # where there is no S
        (["observers.T=1.theta=9"], None, None, []),
        (["observers.S.theta=4"], None, "a", []),  # which is what it says
        (["runs.a.observers.S.theta=9"], None, None, []),
        (["runs.a.observers.S.theta=9", "observers.S.theta=8"], None, "a", []),
        (
            ["observers.*.theta=9"],
            5,
            "a",
            [
                f"--set observers.*.theta=9: {OF_A}`--set runs.a.observers.S.theta=9` changes it",
                "--seed 5: the run a has the key seed itself, which stays as it is; `--set runs.a.seed=5` changes it",
            ],
        ),
        (
            ["measurement.sampling.period=0.05"],
            None,
            None,
            [
                "--set measurement.sampling.period=0.05: the run b has the key measurement.sampling itself, which "
                "stays as it is"
            ],
        ),
        (
            ["observers.S={type: shgo, theta: 9}"],
            None,
            None,
            [
                "--set observers.S={type: shgo, theta: 9}: the runs a, d, e have the key observers.S themselves, "
                "which stays as it is; `--set 'runs.a.observers.S={type: shgo, theta: 9}'` changes it",
                "--set observers.S={type: shgo, theta: 9}: the run c varies observers.S, whose values stay as they are",
            ],
        ),
        (["title=mine"], None, None, []),
        (["figures={}"], None, None, []),
    ],
)
def test_runs_that_keep_what_they_have_are_named(
    file: Path, overrides: list[str], seed: int | None, run: str | None, said: list[str]
) -> None:
    assert list(kept_by_runs(file, overrides, seed, run)) == said


@pytest.mark.parametrize(("path", "theta"), [("observers.S.theta", 4), ("runs.a.observers.S.theta", 9)])
def test_what_is_advised_has_the_effect(file: Path, path: str, theta: float) -> None:
    observer = load(file, [f"{path}=9"], run="a").observers["S"]
    assert isinstance(observer, StandardObserver)
    assert observer.theta == theta


def test_many_runs_are_counted_and_a_file_without_runs_has_none(tmp_path: Path) -> None:
    many = "\n".join(f"  r{i}: {{observers: {{S: {{theta: 4}}}}}}" for i in range(9))
    (tmp_path / "many.yaml").write_text(FILE[: FILE.index("  a:")] + many)
    (said,) = kept_by_runs(tmp_path / "many.yaml", ["observers.S.theta=9"], None, None)
    assert ": the runs r0, r1, r2, r3, r4, r5 and 3 more have the key" in said
    (tmp_path / "one.yaml").write_text(FILE[: FILE.index("runs:")])
    assert list(kept_by_runs(tmp_path / "one.yaml", ["observers.S.theta=9"], 1, None)) == []


@pytest.mark.parametrize(
    "command",
    [
        "simulate",
        "compare --no-plots --run a",
        pytest.param("analyze --no-plots --run a", marks=pytest.mark.costly),
        "export --lang latex --run a",
    ],
)
def test_the_commands_say_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    shell = Shell(tmp_path, monkeypatch, capsys)
    (tmp_path / "r.yaml").write_text(FILE[: FILE.index("  b:")])
    name, *options = command.split()
    code, _, err = shell(name, "r.yaml", "--set", "observers.S.theta=9", "-q", *options)
    assert (code, f"hgorun: r.yaml: --set observers.S.theta=9: {OF_A}" in err) == (0, True), err
