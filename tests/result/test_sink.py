"""Where HDF5 writes: failures are kept, and not shown to it."""

import os
import time
from concurrent.futures import ThreadPoolExecutor
from errno import ENOSPC, EOPNOTSUPP
from pathlib import Path

import h5py
import numpy as np
import pytest

from hgorun.errors import HgorunError
from hgorun.result.hdf5.sink import Sink, hdf5_and_sink, hdf5_written_whole


def test_what_is_written_is_there(tmp_path: Path) -> None:
    with Sink(tmp_path / "a") as sink:
        assert sink.write(b"abc") == 3
        assert sink.truncate(2) == 2
        assert sink.failed is None
    assert (tmp_path / "a").read_bytes() == b"ab"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_full_disk_is_told_afterwards() -> None:
    with Sink(Path("/dev/full")) as sink:
        assert sink.write(b"abc") == 3
        assert isinstance(sink.failed, OSError)
        assert sink.write(b"more") == 4
        assert sink.truncate(7) == 7
        sink.write_at(3, memoryview(b"and more"))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_full_disk_is_told_of_what_is_written_at_a_place() -> None:
    with Sink(Path("/dev/full")) as sink:
        sink.write_at(3, memoryview(b"abc"))
        assert isinstance(sink.failed, OSError)


def test_what_was_written_at_a_place_is_read_there(tmp_path: Path) -> None:
    pytest.importorskip("posix")
    room = bytearray(3)
    with Sink(tmp_path / "a") as sink:
        sink.write_at(2, memoryview(b"abcdef"))
        sink.read_at(4, memoryview(room))
        assert room == b"cde"
        with pytest.raises(EOFError, match="ends at byte 8"):
            sink.read_at(6, memoryview(room))


def test_room_is_taken_before_anything_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("posix")
    refused: list[OSError] = []

    def fallocate(*given: int) -> None:
        if refused:
            raise refused[0]
        os.truncate(*given[::2])

    monkeypatch.setattr(os, "posix_fallocate", fallocate, raising=False)
    with Sink(tmp_path / "a") as sink:
        sink.reserve(0, 10)
        assert (tmp_path / "a").stat().st_size == 10
        refused.append(OSError(EOPNOTSUPP, "this file system cannot"))
        sink.reserve(0, 20)
        assert sink.failed is None
        refused[0] = OSError(ENOSPC, "No space left on device")
        sink.reserve(0, 20)
        assert sink.failed is refused[0]


def test_a_file_of_which_room_was_reserved_has_all_its_room_when_it_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("posix")
    taken: list[tuple[int, int, int]] = []  # and how long the file was
    monkeypatch.setattr(
        os,
        "posix_fallocate",
        lambda handle, place, size: taken.append((place, size, os.fstat(handle).st_size)),
        raising=False,
    )
    with hdf5_and_sink(tmp_path / "a") as (file, sink):
        sink.reserve(5000, 10)
        file.attrs["what HDF5 writes"] = "itself"
    size = (tmp_path / "a").stat().st_size
    assert size > 0
    assert taken[1:] == [(0, size, size)]
    with hdf5_and_sink(tmp_path / "b") as (file, _):
        file.attrs["nothing"] = "was reserved"
    assert len(taken) == 2


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_length_that_cannot_be_set_is_told_afterwards() -> None:
    with Sink(Path("/dev/full")) as sink:
        assert sink.truncate(7) == 7
        assert isinstance(sink.failed, OSError)


def test_threads_write_one_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("posix")
    inside, most, real = [0], [0], os.pwrite

    def pwrite(file: int, data: memoryview, place: int) -> int:
        inside[0] += 1
        most[0] = max(most[0], inside[0])
        time.sleep(1e-3)
        done = real(file, data[:5], place)  # as a system may, not all at once
        inside[0] -= 1
        return done

    monkeypatch.setattr(os, "pwrite", pwrite)
    pieces = [bytes([97 + k]) * 12 for k in range(8)]
    with Sink(tmp_path / "file") as sink, ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda k: sink.write_at(12 * k, memoryview(pieces[k])), range(8)))
    assert (tmp_path / "file").read_bytes() == b"".join(pieces)
    assert most == [1]


class Full(Sink):
    def put(self, data: memoryview) -> int:
        raise OSError(28, "No space left on device")


def test_hdf5_reads_what_it_has_written_where_no_room_was_left_for_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It reads its own lists again, and crashed the process where these were something else."""
    monkeypatch.setattr("hgorun.result.hdf5.sink.Sink", Full)
    words = np.array([f"name {k} " * 60 for k in range(40)], dtype=object)

    def written() -> None:
        with hdf5_written_whole(tmp_path / "a.h5") as file:
            for number in range(50):
                data = file.create_dataset(f"names {number}", words.shape, h5py.string_dtype(), track_times=False)
                data[...] = words
            file.flush()
            np.testing.assert_array_equal(file["names 3"].asstr()[...], words)

    with pytest.raises(HgorunError, match="No space left on device"):
        written()
    assert list(tmp_path.iterdir()) == []


def test_what_is_lost_reads_as_zeros(tmp_path: Path) -> None:
    with Full(tmp_path / "a") as sink:
        sink.write(b"abcd")
        sink.seek(2)
        room = bytearray(b"xxxx")
        assert sink.readinto(room) == 4
        assert bytes(room) == b"cd\0\0"
