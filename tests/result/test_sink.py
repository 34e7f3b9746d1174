"""Where HDF5 writes: failures are kept, and not shown to it."""

import os
from pathlib import Path

import pytest

from hgorun.result.sink import Sink


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


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no device that is always full")
def test_a_length_that_cannot_be_set_is_told_afterwards() -> None:
    with Sink(Path("/dev/full")) as sink:
        assert sink.truncate(7) == 7
        assert isinstance(sink.failed, OSError)
