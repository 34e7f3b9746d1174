"""Two signs side by side are remarked on; what is written so on purpose is not."""

from __future__ import annotations

import pytest

from hgorun.config.yaml_source import parse
from hgorun.simulation.remarks.signs import sign_remarks


@pytest.mark.parametrize(
    ("text", "found"), [("x1 - + x2", 1), ("x1 + +x2", 1), ("x1 - -x2", 0), ("x1 + -x2", 0), ("+x1 - x2", 0)]
)
def test_a_sign_that_changes_nothing_is_told(text: str, found: int) -> None:
    source = parse(f"title: a - + b\nplant: {{dynamics: {{x1: {text}}}}}\n", "f.yaml")
    told = list(sign_remarks(source))
    assert len(told) == found
    assert all(remark.startswith(f"plant.dynamics.x1: `{text}`: two signs") for remark in told)
