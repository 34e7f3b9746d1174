"""Machine code of large programs compiled by LLVM without optimisation: the same bits, in a sixth of the time.

Compiling is more than half of what the tests take. What users get is compiled where no turn is given, for an eighth of
the files with each turn, and always in processes that tests start.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm

_SMALL = 30_000  # characters of IR, below which compiling takes no time


@contextmanager
def compiled_quickly() -> Iterator[None]:
    """What is compiled inside, here and in forks; it is kept apart from what is compiled as users get it."""
    compiler: Any = sys.modules.get("hgorun.native.compiler")  # not imported here: its lines are measured
    if compiler is None:
        yield
        return
    as_users_get_it, format_of_entries = compiler._target_machine, compiler._FORMAT

    def quick(size: int = 0) -> Any:
        if size <= _SMALL:
            return as_users_get_it(size)
        cpu, features = compiler.processor()
        as_users_get_it()  # it initialises LLVM
        target = llvm.Target.from_default_triple()
        return target.create_target_machine(cpu=cpu, features=features, opt=0, reloc="pic", jit=False)

    compiler._target_machine, compiler._FORMAT = quick, f"{format_of_entries}, quick"
    try:
        yield
    finally:
        compiler._target_machine, compiler._FORMAT = as_users_get_it, format_of_entries
