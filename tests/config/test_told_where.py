"""What is easily written wrong is answered where it is wrong, with what it means."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun import load
from hgorun.errors import ConfigError

TEXT = """time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics:
    x1: x2
    x2: -x1
  output: x1
  initial: {x1: 1, x2: 0}
observers:
  S: {type: shgo, theta: 2}
"""


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("x1: x2", "x1 = x2", "yaml:5: this line has no `:` after its key"),
        (", output_step: 0.1", "", "yaml:1: time.output_step: this key is missing: spacing of the output grid"),
        ("  S: {", "  plant: {", "yaml:10: observers.plant: an observer cannot be called plant"),
    ],
)
def test_what_is_wrong_is_told(right: str, wrong: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "experiment.yaml"
    file.write_text(TEXT.replace(right, wrong, 1), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        _ = load(file).observers
    assert message in str(raised.value)
