"""Work in a process of its own."""

import gc
import os

import pytest

from hgorun.result.hdf5.guarded import guarded


@pytest.mark.skipif(os.name != "posix", reason="there processes are not forked")
def test_nothing_of_the_parent_is_finalised_in_the_child() -> None:
    """It might wait for threads that only the parent has."""
    assert gc.isenabled()
    assert guarded(gc.isenabled, seconds=10, memory=2**28) is False
    assert gc.isenabled()
