"""What docs/recordings.md says of the block is what its models know."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
import yaml

from hgorun.config.data import Csv, Data, Faults, Measured, Recorded
from hgorun.config.types import Block

PAGE = (Path(__file__).parents[2] / "docs" / "recordings.md").read_text(encoding="utf-8")


def test_the_block_of_the_page_is_one() -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    block = Data.model_validate(yaml.safe_load(text)["data"])
    assert block.outputs["S"].plausible == (0, 60)


@pytest.mark.parametrize("model", [Data, Csv, Faults, Measured, Recorded])
def test_every_key_is_on_the_page(model: type[Block]) -> None:
    assert [key for key in model.model_fields if f"`{key}`" not in PAGE and f"`{key}:" not in PAGE] == []


def test_everything_that_may_be_done_about_a_fault_is_on_the_page() -> None:
    for key, field in Faults.model_fields.items():
        row = " ".join(re.findall(rf"^\| `{key}` .*$", PAGE, re.MULTILINE))
        for choice in get_args(get_args(field.annotation)[0]):
            assert f"`{choice}`" in row, (key, choice)
