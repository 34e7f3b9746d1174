"""Many bytes to a place in a file, in machine code: piece by piece, and Python goes on meanwhile."""

from __future__ import annotations

import os
import sys

import numpy as np

from hgorun.native.ir import Function
from hgorun.native.passes import Passes

# Linux keeps what is written in blocks of memory as large as the pieces. Many a virtual machine has given large blocks
# that are free back to its host, and to get them again takes several times as long as to fill them; up to this size it
# mostly takes others. Where memory is not given back, pieces of this size cost no more than large ones.
_PIECE = 1 << 15
_KNOWN = sys.platform == "linux" and sys.maxsize > 2**32  # what pwrite takes


def write_at(file: int, data: memoryview, place: int) -> int:
    """Write bytes at a place of a file.

    Parameters
    ----------
    file : int
        Its descriptor.
    data : memoryview
        In one piece; some bytes.
    place : int

    Returns
    -------
    int
        How many of the first ones have been written.

    Raises
    ------
    OSError
        When not one could be.
    """
    done = 0
    if _KNOWN and data.nbytes > _PIECE:
        done = _passes("write", (np.frombuffer(data, dtype=np.uint8),), (data.nbytes, file, place))
    return done or os.pwrite(file, data, place)  # which tells what is wrong


def _write(f: Function) -> None:
    """How many bytes have been written before one piece could not be."""
    data, size, file, place = f.word("%taken", 0, "ptr"), *(f.word("%taken", i) for i in (1, 2, 3))
    f.declarations.add("declare i64 @pwrite(i32, ptr, i64, i64)")
    handle, done = f.let(f"trunc i64 {file} to i32"), f.slot("i64")
    f.store("0", done, "i64")
    with f.loop() as after:
        at = f.load(done, "i64")
        left = f.scalar("sub", size, at)
        f.leave_if(f.test("sle", left, "0"), after)
        whole = f.test("sgt", left, str(_PIECE))
        count = f.let(f"select i1 {whole}, i64 {_PIECE}, i64 {left}")
        start = f.let(f"getelementptr i8, ptr {data}, i64 {at}")
        arguments = f"i32 {handle}, ptr {start}, i64 {count}, i64 {f.scalar('add', place, at)}"
        written = f.call("pwrite", arguments, "i64")
        f.leave_if(f.test("sle", written, "0"), after)
        f.store(f.scalar("add", at, written), done, "i64")
    f.do(f"ret i64 {f.load(done, 'i64')}")


_passes = Passes({"write": _write})
