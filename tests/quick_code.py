"""Machine code compiled by LLVM without optimisation: the same bits, in less than half of the time.

Compiling what users get would be a sixth of what the tests take. That is compiled where no turn is given, for an
eighth of the files with each turn, and always in processes that tests start.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm


@contextmanager
def compiled_quickly() -> Iterator[None]:
    """What is compiled inside, here and in forks; it is kept apart from what is compiled as users get it."""
    compiler: Any = sys.modules.get("hgorun.native.compiler")  # not imported here: its lines are measured
    if compiler is None:
        yield
        return
    as_users_get_it, format_of_entries = compiler._target_machine, compiler._FORMAT

    def quick(size: int = 0) -> Any:
        if not size:  # it loads what is compiled
            return as_users_get_it()
        cpu, features = compiler.processor()
        as_users_get_it()  # it initialises LLVM
        target = llvm.Target.from_default_triple()
        return target.create_target_machine(cpu=cpu, features=features, opt=0, reloc="pic", jit=False)

    compiler._target_machine, compiler._FORMAT = quick, f"{format_of_entries}, quick"
    try:
        yield
    finally:
        compiler._target_machine, compiler._FORMAT = as_users_get_it, format_of_entries
