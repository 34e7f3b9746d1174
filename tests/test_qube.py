"""A real rotary pendulum, recorded at 250 Hz: what observers say of the samples that they were not given.

The recordings are not shipped; HGORUN_DATA names the folder that has them as qube/run1.csv and so on.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from hgorun.result.reading import read

CONFIG = Path(__file__).parents[1] / "demos" / "qube" / "qube.yaml"
LOGS = Path(os.environ.get("HGORUN_DATA", "")) / "qube"

pytestmark = pytest.mark.skipif(
    not (LOGS / "run1.csv").is_file(), reason="HGORUN_DATA names no folder with qube/run1.csv"
)


@pytest.mark.parametrize("every", [5, 10])
def test_angles_between_samples(
    every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    header, *rows = (LOGS / "run1.csv").read_text().splitlines()
    given, aside = rows[::every], [row for i, row in enumerate(rows) if i % every]
    (tmp_path / "given.csv").write_text("\n".join([header, *given]))
    (tmp_path / "aside.csv").write_text("\n".join([header, *aside]))
    shell = Shell(tmp_path, monkeypatch, capsys)
    code, _, _ = shell(
        "estimate", str(CONFIG), "given.csv", "--holdout", "theta=aside.csv", "--holdout", "alpha=aside.csv",
        "--no-sensitivity", "--no-plots", "-o", "qube.h5",
    )  # fmt: skip
    assert code == 0
    found = read(tmp_path / "qube.h5")
    columns = header.split(",")
    place, clock = columns.index("theta"), columns.index("time")
    t, theta = (np.array([float(row.split(",")[k]) for row in given]) for k in (clock, place))
    later, true = (np.array([float(row.split(",")[k]) for row in aside]) for k in (clock, place))
    last = np.clip(np.searchsorted(t, later) - 1, 1, None)
    line = theta[last] + (theta[last] - theta[last - 1]) / (t[last] - t[last - 1]) * (later - t[last])
    for one in found.observers.values():
        assert one.status == "ok"
        assert one.assessed is not None
        scores = one.assessed.scores
        assert scores["holdout_rmse"]["alpha"] < 0.013  # rad; alpha itself falls by pi
        assert scores["holdout_rmse"]["theta"] < np.sqrt(np.mean((line - true) ** 2))
        assert scores["reference_rmse"]["alpha_dot"] < 1.5
        assert 0.9 <= scores["holdout_coverage"]["alpha"] <= 1.0
