"""An estimate beyond a point where the observability map is singular: what is measured looks the same there."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun import load
from hgorun.analysis.report import analyze
from hgorun.tables.advice import advice

# y = x - x^3 = g(x) has the same value on both sides of its extremum at x = 1/sqrt(3)
CONFIG = """time: {{end: 20, output_step: 0.01, unit: s}}
plant:
  states: [x, w]
  dynamics: {{x: 0.1*w/(1-3*x**2), w: -w}}
  output: x-x**3
  initial: {{x: 1, w: 0.5}}
measurement:
  noise: [{{type: gaussian, std: 1e-4, hold: 0.05}}]
observers:
  S: {{type: shgo, theta: 2, initial: {{x: {start}, w: 0}}}}
"""


@pytest.mark.measured("0.1-True")
@pytest.mark.costly
@pytest.mark.parametrize(("start", "apart"), [(0.1, True), (0.9, False)])
def test_no_gain_is_recommended_on_the_wrong_branch(tmp_path: Path, start: float, apart: bool) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(CONFIG.format(start=start))
    said = " ".join(" ".join(advice(analyze(load(path)))).split())
    assert ("no gain brings the estimate across" in said) is apart
    assert ("theta" in said.partition("to change: ")[2].partition(" no theorem")[0]) is not apart
