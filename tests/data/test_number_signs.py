"""Signs of decimals and between thousands: what is said of a number with other signs reads the file as it was meant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from logs import noisy, recorded

from hgorun.errors import ConfigError

TIMES, VALUES = noisy()
LARGE = np.round(VALUES * 100, 1)


def log(cells: list[str]) -> str:
    return "t;glucose\n" + "".join(f"{k};{cell}\n" for k, cell in enumerate(cells))


def advised(folder: Path, content: str, csv: dict[str, Any] | None = None) -> tuple[str, dict[str, Any] | None]:
    """What is said of a log, and the last ``csv`` in it."""
    with pytest.raises(ConfigError) as caught:
        recorded(folder, content, {"csv": csv or {}})
    said = caught.value.message
    return said, yaml.safe_load(said[said.rindex("csv: {") + 5 : said.rindex("}") + 1]) if "csv: {" in said else None


def with_signs(values: np.ndarray, thousands: str, decimal: str) -> list[str]:
    texts = (f"{v:,.1f}" for v in values.tolist())
    return [text.replace(",", "~").replace(".", decimal).replace("~", thousands) for text in texts]


@pytest.mark.parametrize(
    "thousands", [".", " ", "\u00a0", "\u202f", "\u2009", "\u2007", "'", "\u2019", "\u00b4", "\u02bc"]
)
@pytest.mark.parametrize("decimal", [",", "."])
def test_what_is_said_of_large_numbers_reads_them(tmp_path: Path, thousands: str, decimal: str) -> None:
    if thousands == decimal:
        return
    content = log(with_signs(LARGE, thousands, decimal))
    _, advice = advised(tmp_path, content)
    found = recorded(tmp_path, content, {"csv": advice}).outputs["S"].values
    np.testing.assert_array_equal(found, LARGE)


def test_signs_between_thousands_that_are_given_need_those_of_decimals(tmp_path: Path) -> None:
    content = log(with_signs(LARGE, " ", ","))
    said, advice = advised(tmp_path, content, {"thousands": " "})
    assert said.endswith(
        '; for signs between thousands and of decimals: csv: {thousands: " ", decimal: ","}; csv goes below data'
    )
    assert recorded(tmp_path, content, {"csv": advice}).outputs["S"].values.tolist() == LARGE.tolist()


@pytest.mark.parametrize("every", [2, 20])
@pytest.mark.parametrize("decimal", [None, ",", "."])
def test_a_comma_among_points_is_not_said_to_be_of_thousands(tmp_path: Path, every: int, decimal: str | None) -> None:
    cells = [f"{v:.3f}".replace(".", "," if k % every == 1 else ".") for k, v in enumerate(VALUES)]
    said, _ = advised(tmp_path, log(cells), {} if decimal is None else {"decimal": decimal})
    assert "decimals have a " in said
    assert "thousands" not in said


@pytest.mark.parametrize(
    ("cells", "may_be"),
    [
        (["990", "998", "1,020"], True),
        (["990.5", "998.5", "1,020"], False),  # without decimals
        (["990.5", "998.5", "1,020.5", "1,021.5"], True),
        (["990", "1998", "1,020"], False),  # a thousand without a sign
        (["990.5", "1,020.5"], True),
    ],
)
def test_thousands_are_said_where_all_cells_can_have_them(tmp_path: Path, cells: list[str], may_be: bool) -> None:
    said, _ = advised(tmp_path, log(cells), {"decimal": "."})
    assert ('{thousands: ","}' in said) == may_be
