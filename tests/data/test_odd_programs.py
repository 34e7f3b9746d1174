"""What programs write into logs beside numbers: ends of DOS, blocks of zeros, events, texts that are numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from logs import noisy, recorded, table

from hgorun.errors import ConfigError, Problem

TIMES, VALUES = noisy()
LOG = table(TIMES, VALUES)


@pytest.mark.parametrize("end", ["\x1a", "\x1a\x1a", "# the end\n\x1a"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_the_sign_that_ends_a_text_of_dos_is_no_row(tmp_path: Path, end: str, encoding: str) -> None:
    for text in (LOG, LOG.rstrip("\n")):
        if end[0] == "#" and text[-1] != "\n":
            continue
        found = recorded(tmp_path, (text + end).encode(encoding)).outputs["S"].values
        np.testing.assert_array_equal(found, VALUES)


def test_a_last_number_in_front_of_that_sign_is_whole(tmp_path: Path) -> None:
    fixed = "t,glucose\n" + "".join(f"{k},{v:.3f}\n" for k, v in enumerate(VALUES))
    found = recorded(tmp_path, f"{fixed}40,22.4\x1a")
    assert found.outputs["S"].values[-1] == 22.4
    assert not found.notes


def test_a_file_of_that_sign_alone_is_empty(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="this file is empty"):
        recorded(tmp_path, "\x1a")


@pytest.mark.parametrize(
    ("zeros", "said"),
    [
        (
            b"\0" * 4096,
            ":22: 4,096 zero bytes in a text: nothing was written there, as where power fails",
        ),
        (b"\0", ":22: a zero byte in a text: nothing was written there"),
    ],
)
def test_zeros_in_a_text_make_it_no_other_encoding(tmp_path: Path, zeros: bytes, said: str) -> None:
    lines = LOG.encode().splitlines(keepends=True)
    with pytest.raises(ConfigError) as caught:
        recorded(tmp_path, b"".join([*lines[:21], zeros, *lines[21:]]))
    assert said in str(caught.value)
    assert "utf-16" not in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark_is_told(tmp_path: Path, encoding: str) -> None:
    with pytest.raises(ConfigError, match=r":1: a zero byte: .*csv: {encoding: utf-16}"):
        recorded(tmp_path, LOG.encode(encoding))
    np.testing.assert_array_equal(
        recorded(tmp_path, LOG.encode(encoding), {"csv": {"encoding": "utf-16"}}).outputs["S"].values, VALUES
    )


@pytest.mark.parametrize("form", ['="{}"', '"=""{}"""', ' ="{}" '])
@pytest.mark.parametrize("dated", [False, True])
def test_numbers_that_a_spreadsheet_is_to_take_as_texts(tmp_path: Path, form: str, dated: bool) -> None:
    times = [f"2024-05-31 10:00:{k:02d}" if dated else f"{k}.0" for k in range(40)]
    cells = (f"{form.format(t)},{form.format(v)}\n" for t, v in zip(times, VALUES.tolist(), strict=True))
    signal = recorded(tmp_path, "t,glucose\n" + "".join(cells)).outputs["S"]
    np.testing.assert_array_equal(signal.values, VALUES)
    np.testing.assert_array_equal(signal.taken, np.arange(40.0))
    with pytest.raises(ConfigError, match=r":3: glucose: expected a number, found 'x'"):
        recorded(tmp_path, 't,glucose\n="0.0",="1"\n="1.0",="x"\n')


def test_events_of_wincc_are_no_samples(tmp_path: Path) -> None:
    rows = [f'"level";{k};{v};1' for k, v in enumerate(VALUES)]
    rows[30] = '"$RT_OFF$";30;0;2'
    text = "\n".join(["VarName;t;glucose;Validity", *rows, ""])
    with pytest.raises(ConfigError, match=r":32: '\$RT_OFF\$' is no sample, .* take it out, or quality: ") as caught:
        recorded(tmp_path, text)
    advice = yaml.safe_load(caught.value.message[caught.value.message.index("quality: ") :])
    column: dict[str, Any] = {"column": "glucose", **advice}
    found = recorded(tmp_path, text, {"outputs": {"S": column}})
    np.testing.assert_array_equal(found.outputs["S"].values, np.delete(VALUES, 30))


@pytest.mark.parametrize(
    ("header", "column", "said"),
    [
        ("t,µS", "μS", r"Did you mean `µS`\? It looks the same, and has other characters \(U\+00B5\): copy it\."),
        ("t,de\u0301bit", "d\u00e9bit", r"It looks the same, and has other characters \(U\+0065 and U\+0301\)"),
    ],
)
def test_names_that_look_alike_are_told(tmp_path: Path, header: str, column: str, said: str) -> None:
    with pytest.raises(Problem, match=said):
        recorded(tmp_path, LOG.replace("t,glucose", header), {"outputs": {"S": column}})


def test_columns_of_one_name_need_names_of_their_own(tmp_path: Path) -> None:
    with pytest.raises(Problem, match=r"has 2 columns called 't': give each a name of its own in the header"):
        recorded(tmp_path, "t,glucose,t\n0,1,0\n1,2,1\n")
