"""Many bytes are written to a place of a file piece by piece."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from hgorun.result.hdf5 import written_at
from hgorun.result.hdf5.sink import Sink

fcntl = pytest.importorskip("fcntl")
PIECE = written_at._PIECE
BYTES = memoryview(np.random.default_rng(3).bytes(3 * PIECE + 7))


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("size", [1, PIECE, PIECE + 1, 2 * PIECE, 3 * PIECE + 7])
def test_all_bytes_are_written(size: int, known: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if not known:
        monkeypatch.setattr(written_at, "_KNOWN", False)
    with (tmp_path / "a").open("wb") as file:
        assert written_at.write_at(file.fileno(), BYTES[:size], 5) == size
    assert (tmp_path / "a").read_bytes() == bytes(5) + BYTES[:size].tobytes()


@pytest.mark.skipif(sys.platform != "linux", reason="there are no files that may not grow")
def test_where_it_ends_is_told_and_then_why() -> None:
    file = os.memfd_create("full", os.MFD_ALLOW_SEALING)
    try:
        os.ftruncate(file, 2 * PIECE + 10)
        fcntl.fcntl(file, fcntl.F_ADD_SEALS, fcntl.F_SEAL_GROW)
        assert written_at.write_at(file, BYTES, 0) == 2 * PIECE
        assert os.pread(file, 4 * PIECE, 0) == BYTES[: 2 * PIECE].tobytes() + bytes(10)
        with pytest.raises(PermissionError):
            written_at.write_at(file, BYTES[2 * PIECE :], 2 * PIECE)
    finally:
        os.close(file)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_full_disk_is_told_of_many_bytes() -> None:
    with Sink(Path("/dev/full")) as sink:
        sink.write_at(3, BYTES)
        assert isinstance(sink.failed, OSError)
        assert "No space left" in str(sink.failed)
