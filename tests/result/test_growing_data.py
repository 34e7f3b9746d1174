"""Data sets that are written in a thread, piece by piece."""

from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest

from hgorun.result.hdf5.growing import Background, Constant, Growing
from hgorun.result.hdf5.sink import hdf5_and_sink

ROWS = np.arange(60.0).reshape(20, 3)


def test_pieces_make_the_whole_and_its_digest(tmp_path: Path) -> None:
    with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
        growing = Growing(file, "x", 20, ROWS, background)
        for some in (slice(0, 7), slice(7, 7), slice(7, 20)):
            growing.append(ROWS[some])
        assert growing.finished().attrs["sha256"] == sha256(ROWS.tobytes()).hexdigest()
        assert np.array_equal(growing.read(5, 12), ROWS[5:12])
        assert growing.read(3, 3).shape == (0, 3)
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["x"][:], ROWS)


def test_data_sets_that_grow_side_by_side_keep_their_order(tmp_path: Path) -> None:
    names = "abc"
    with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
        growing = [Growing(file, name, 2000, ROWS, background) for name in names]
        for k in range(100):
            for number, one in enumerate(growing):
                one.append(ROWS + 100 * k + 10000 * number)
        digests = [one.finished().attrs["sha256"] for one in growing]
    whole = np.concatenate([ROWS + 100 * k for k in range(100)])
    with h5py.File(tmp_path / "a.h5") as file:
        for number, (name, digest) in enumerate(zip(names, digests, strict=True)):
            assert np.array_equal(file[name][:], whole + 10000 * number)
            assert digest == sha256((whole + 10000 * number).tobytes()).hexdigest()


@pytest.mark.parametrize("value", [0.0, np.nan])
@pytest.mark.parametrize("same", [1, 90_000, 200_000])
def test_rows_that_do_not_change_take_no_room(value: float, same: int, tmp_path: Path) -> None:
    whole = np.full((200_000, 2), value)
    whole[same:, 1] = -value if value == 0 else 1.0  # another number, bit by bit
    with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
        growing = Growing(file, "x", len(whole), whole[:70_000], background)
        for first in range(0, len(whole), 70_000):
            growing.append(whole[first : first + 70_000])
        assert growing.finished().attrs["sha256"] == sha256(whole.tobytes()).hexdigest()
        assert growing.read(10, 20).tobytes() == whole[10:20].tobytes()
    assert ((tmp_path / "a.h5").stat().st_size < 10_000) == (same == len(whole))
    with h5py.File(tmp_path / "a.h5") as file:
        assert file["x"][:].tobytes() == whole.tobytes()


@pytest.mark.parametrize("value", [np.float64(np.nan), np.int8(1)])
def test_one_number_takes_no_room(value: np.generic, tmp_path: Path) -> None:
    shape = 200_000, 2
    with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
        data = Constant(file, "x", shape, value, background).finished()
        assert data.attrs["sha256"] == sha256(np.full(shape, value).tobytes()).hexdigest()
    assert (tmp_path / "a.h5").stat().st_size < 10_000
    with h5py.File(tmp_path / "a.h5") as file:
        assert np.array_equal(file["x"][:], np.full(shape, value), equal_nan=True)


def test_a_disk_that_is_full_is_told_and_leaves_nothing(tmp_path: Path) -> None:
    def fill() -> None:
        with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
            growing = Growing(file, "x", 20, ROWS, background)
            sink.failed = OSError(28, "No space left on device")
            growing.append(ROWS)
            growing.finished()

    with pytest.raises(Exception, match="No space left"):
        fill()
    assert list(tmp_path.iterdir()) == []


def test_what_fails_in_the_thread_is_raised_outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise RuntimeError("broken")

    def fill() -> None:
        with hdf5_and_sink(tmp_path / "a.h5") as (file, sink), Background(sink) as background:
            growing = Growing(file, "x", 20, ROWS, background)
            monkeypatch.setattr(growing, "write", broken)
            growing.append(ROWS)
            growing.finished()

    with pytest.raises(RuntimeError, match="broken"):
        fill()
    assert list(tmp_path.iterdir()) == []
