"""In Python the block ``data`` says of samples what it says to ``hgorun estimate CONFIG -``: the same lines."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

import hgorun
from hgorun.errors import ConfigError
from hgorun.estimate.stream.estimator import Estimator

CONFIG = """
plant:
  states: [a, b]
  dynamics: {a: b, b: -sin(a) - 0.1*b + u}
  output: {ya: a, yb: b}
data:
  file: none.csv
  time: t
  outputs:
    ya: {column: one, std: 0.02, gate: 4}
    yb: {column: two, std: 0.05, gate: 6}
  inputs: {u: force}
observers:
  S: {type: kalman_bucy, Q: {b: 0.1}, R: {ya: 0.1, yb: 0.1}, initial: {a: 0.2}}
  E: {type: ekf, Q: {b: 0.1}, initial: {a: 0.2}}
solver: {step: 0.01}
"""
WHOLE = ["time={end: 9, output_step: 0.1}", "plant.initial={a: 0, b: 0}", "plant.inputs={u: 0}"]
OUT = 30


def rows() -> list[tuple[float, str, float]]:
    found = []
    for k in range(1, 50):
        t = round(0.1 * k, 10)
        found.append((t, "ya", float(0.3 * np.sin(t)) + 3.0 * (k == OUT)))
        if k % 3 == 0:
            found += [(t, "u", 0.1 * (-1) ** k), (t, "yb", float(0.3 * np.cos(t)))]
    return found


@pytest.fixture(name="config")
def written(tmp_path: Path) -> Path:
    path = tmp_path / "pair.yaml"
    path.write_text(CONFIG)
    return path


def lines_of(estimator: Estimator) -> list[str]:
    found = []
    for t, name, y in rows():
        if name == "u":
            estimator.update(t, {}, u={"u": y})
        else:
            estimator.update(t, {name: y})
        found += [f"{t!r},{label},{','.join(map(repr, x.tolist()))},ok" for label, x in estimator.estimate().items()]
    return found


@pytest.mark.costly
@pytest.mark.parametrize("sampling", [[], ["measurement={sampling: {period: 0.1}}"]])
def test_python_has_the_lines_of_the_command(
    config: Path, sampling: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "t,signal,y\n" + "".join(f"{t!r},{name},{y!r}\n" for t, name, y in rows())
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    changes = [*WHOLE, *sampling] if sampling else []
    command = ["estimate", str(config), "-", *(word for change in changes for word in ("--set", change))]
    code, out, _ = Shell(config.parent, monkeypatch, capsys)(*command)
    assert code == 0
    wanted = out.splitlines()[1:]
    estimator = Estimator(hgorun.load(config, changes)) if sampling else Estimator.load(config)
    assert lines_of(estimator) == wanted
    assert {label: of["ya"][0] for label, of in estimator.gated.items()} == {"S": 1, "E": 1}


def test_what_is_given_counts_and_nothing_is_none(config: Path) -> None:
    """As in a configuration with these keys, or without them."""
    changes = [*WHOLE, "measurement={sampling: {period: 0.1}}"]
    experiment = hgorun.load(config, changes)
    without = lines_of(Estimator(experiment, gates={}))
    noisy = lines_of(Estimator(experiment, std={"ya": 0.1, "yb": 0.3}))
    with pytest.raises(ConfigError, match="the output has no noise"):
        Estimator(experiment, std={})
    config.write_text(CONFIG.replace("gate: 4", "gate: 1e9").replace(", gate: 6", ""))
    assert lines_of(Estimator(hgorun.load(config, changes))) == without
    config.write_text(CONFIG.replace("std: 0.02", "std: 0.1").replace("std: 0.05", "std: 0.3"))
    assert lines_of(Estimator(hgorun.load(config, changes))) == noisy
    assert len({*map(tuple, (without, noisy, lines_of(Estimator(experiment))))}) == 3


def test_a_wrong_block_is_told_with_its_line(config: Path) -> None:
    config.write_text(CONFIG.replace("gate: 4", "gate: -4"))
    with pytest.raises(ConfigError, match=r"pair\.yaml:10: data\.outputs\.ya\.gate"):
        Estimator.load(config)


@pytest.mark.parametrize("first", ["auto", 3])
def test_a_start_from_samples_that_are_not_there_yet_is_refused(
    config: Path, first: object, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file would begin elsewhere. It is the same start if the observers have all of theirs."""
    whole = [f"observers.{label}.initial={{a: 0.2, b: 0}}" for label in "SE"]
    wanted = lines_of(Estimator.load(config, whole))
    change = f"data.first_samples={first}"
    told = (
        r"data\.first_samples: .* are not there when a stream begins, and S has no start for b: give observers\.S\.in"
    )
    with pytest.raises(ConfigError, match=told):
        Estimator.load(config, [change])
    with pytest.raises(ConfigError, match=told):
        Estimator(
            hgorun.load(config, [*WHOLE, "measurement={sampling: {period: 0.1}}", change]), gates={}, std={}, inputs=()
        )
    monkeypatch.setattr(sys, "stdin", io.StringIO("t,signal,y\n0.1,ya,0.2\n"))
    code, out, error = Shell(config.parent, monkeypatch, capsys)("estimate", str(config), "-", "--set", change)
    assert (code, out) == (2, "")
    assert "first_samples: 1" in error
    assert lines_of(Estimator.load(config, [change, *whole])) == wanted
