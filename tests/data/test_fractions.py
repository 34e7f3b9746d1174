"""Fractions of a second without zeros in front: they are told, or refused where stamps run backwards."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from logs import recorded

from hgorun.data.recording import Recording
from hgorun.errors import ConfigError

START = datetime(2024, 5, 31, 13, 45, 10)
FORMS: dict[str, tuple[str, str | None]] = {
    "ISO": ("%Y-%m-%dT%H:%M:%S.", None),
    "pattern": ("%d.%m.%Y %H:%M:%S.", "%d.%m.%Y %H:%M:%S.%f"),
    "colon": ("%H:%M:%S:", "%H:%M:%S:%f"),
}
TOLD = "fractions of a second have several widths, and none begins with 0: if they are whole milliseconds"


def log(folder: Path, form: str, step: int, digits: Callable[[int], str], end: str = "") -> Recording:
    """Samples every so many milliseconds."""
    front, pattern = FORMS[form]
    content = "t;glucose\n"
    for k in range(200):
        date = START + timedelta(milliseconds=k * step)
        content += f"{date:{front}}{digits(date.microsecond // 1000)}{end};{k % 7}\n"
    return recorded(folder, content, {"time": {"column": "t", "format": pattern}} if pattern else {})


@pytest.mark.parametrize("form", FORMS)
def test_numbers_without_zeros_are_told(tmp_path: Path, form: str) -> None:
    (told,) = [
        note.message
        for note in log(tmp_path, form, 2013, str).notes
        if note.kind == "clock" and "'t'" in note.message and "one day" not in note.message
    ]
    assert TOLD in told
    assert "write these into the file (.027 for 27 ms)" in told


@pytest.mark.parametrize("form", FORMS)
def test_they_are_refused_where_stamps_run_backwards(tmp_path: Path, form: str) -> None:
    with pytest.raises(ConfigError, match=rf"log\.csv:2: t: '.*': {TOLD}"):
        log(tmp_path, form, 370, str)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("step", [13, 370, 2013])
@pytest.mark.parametrize(
    "digits", ["{:03d}".format, lambda ms: f"{ms:03d}".rstrip("0") or "0", lambda ms: f"{ms:03d}000"]
)
def test_others_are_read(tmp_path: Path, form: str, step: int, digits: Callable[[int], str]) -> None:
    found = log(tmp_path, form, step, digits)
    assert not any(TOLD in note.message for note in found.notes)
    assert np.allclose(found.outputs["S"].taken, np.arange(200) * step / 1000, rtol=0, atol=1e-9)


def test_zones_behind_them_are_no_digits(tmp_path: Path) -> None:
    assert any(TOLD in note.message for note in log(tmp_path, "ISO", 2013, str, "+02:00").notes)
    assert not any(TOLD in note.message for note in log(tmp_path, "ISO", 2013, "{:03d}".format, "Z").notes)
