"""Tables and texts keep within the width that they are given, whatever it is."""

from __future__ import annotations

import os
import pty
import struct
import termios
from fcntl import ioctl

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun.tables.layout import Name, entry, packed, reflowed, width, wrapped
from hgorun.tables.typeset import columns

WORDS = st.text("abc 観é=._", min_size=1, max_size=60)
COLUMN = st.tuples(st.text("abcdefg ", min_size=1, max_size=30), st.lists(st.text("0123456789.e", min_size=1)))


@pytest.mark.costly
@given(
    st.lists(WORDS.filter(str.strip), min_size=1, max_size=4, unique=True),
    st.lists(st.text("abcdefg_ ", min_size=1, max_size=30).map(lambda head: f"<{head}>"), min_size=1, max_size=9),
    st.integers(20, 140),
    st.data(),
)
def test_no_line_of_a_table_is_longer_than_there_is_room_for(
    labels: list[str], heads: list[str], room: int, data: st.DataObject
) -> None:
    cells = st.lists(st.text("0123456789.e", min_size=1, max_size=30), min_size=len(labels), max_size=len(labels))
    groups = [[[head, *data.draw(cells)]] for head in heads]
    blocks = packed(labels, groups, room=room)
    lines = [line for block in blocks for line in block]
    assert max(map(columns, lines)) <= room
    shown = "".join("".join(lines).split())
    for (column,) in groups:
        for cell in column[1:]:
            assert cell in shown


def test_what_fits_side_by_side_is_side_by_side() -> None:
    (block,) = packed(["a", "b"], [[["x", "1.0", "2.0"]], [["y", "3.0", "4.0"]]], room=20)
    assert block == ["     x    y", "a  1.0  3.0", "b  2.0  4.0"]


def test_a_column_without_room_turns_the_table_on_its_side() -> None:
    (block,) = packed(["a", "b"], [[["a long head of a column", "1.0", "2.0"]]], room=25, title="what")
    assert block == ["what", "a", "  a long head of a", "    column: 1.0", "b", "  a long head of a", "    column: 2.0"]


def test_labels_give_room_to_their_columns() -> None:
    blocks = packed(["a very long name of one observer", "b"], [[["rmse of x1", "1.0", "2.0"]]], room=30)
    assert max(len(line) for line in blocks[0]) <= 30
    assert blocks[0][1].startswith("a very")
    assert blocks[0][1].endswith("1.0")


@pytest.mark.parametrize("limit", [12, 15, 20, 30])
def test_a_name_keeps_its_state_when_it_is_shortened(limit: int) -> None:
    name = Name("a very long label of an observer ", "omega_1", " [m^3/(kg h)]")
    found = name.within(limit)
    assert "omega_1" in found
    assert columns(found) <= max(limit, 5 + len("omega_1") + 5)
    assert Name("rmse ", "x", " [h]").within(limit) == "rmse x [h]"
    wide = Name("a", "a state that is as long as none is")
    assert wide.kept in wide.within(limit)


def test_rows_without_room_beside_their_columns_have_their_whole_names() -> None:
    rows = [Name("rmse ", "omega_1", " [m^3/(kg h)]"), Name("rmse ", "x_hat", " [%]")]
    (block,) = packed(rows, [[["a head that takes all", "1.0", "2.0"]]], room=36)
    assert block[0] == "rmse omega_1 [m^3/(kg h)]"
    (block,) = packed(rows, [[["a head of a column", "1.0", "2.0"]]], room=44)
    assert block[1].startswith("rmse omega_1 [m^3…")
    assert block[2].startswith("rmse x_hat [%]  ")


def test_a_long_title_stands_above() -> None:
    (block,) = packed(["a"], [[["x", "1.0"]]], title="error / that of the best of all", room=32)
    assert block == ["error / that of the best of all", "     x", "a  1.0"]


@pytest.mark.costly
@given(WORDS, st.integers(20, 80))
def test_wide_characters_count_as_two(words: str, room: int) -> None:
    lines = wrapped(words, room=room)
    assert all(columns(line) <= room + 1 for line in lines)  # a single wide character is not cut in two
    assert "".join("".join(lines).split()) == "".join(words.split())


def test_columns_decides_then_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "57")
    assert width() == 57
    monkeypatch.setenv("COLUMNS", "3")
    assert width() == 20
    for nonsense in ("", "0", "-5", "wide", "80.5"):
        monkeypatch.setenv("COLUMNS", nonsense)
        assert width() == 100
    monkeypatch.delenv("COLUMNS")
    outer, inner = pty.openpty()
    ioctl(inner, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 63, 0, 0))
    with os.fdopen(inner, "w") as terminal:
        monkeypatch.setattr("sys.stdout", terminal)
        assert width() == 63
    os.close(outer)


def test_names_stand_beside_their_meaning_or_above_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    assert entry("name", "its meaning", 8) == ["  name      its meaning"]
    assert entry("name", "", 8) == ["  name"]
    monkeypatch.setenv("COLUMNS", "30")
    assert entry("name", "its meaning", 12) == ["  name", "      its meaning"]


def test_paragraphs_are_filled_and_equations_keep_their_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "24")
    text = "A paragraph that is too long\nfor it.\n\n    eta' = -theta eta\n    e = y\n\nshort"
    assert reflowed(text) == [
        "A paragraph that is too",
        "long for it.",
        "",
        "    eta' = -theta eta",
        "    e = y",
        "",
        "short",
    ]
