"""LLVM IR to machine code through llvmlite, with a cache of compiled objects on disk.

The key is the hash of the IR, llvmlite's version and the processor's name and features. An entry starts
with the hash of its own content and is written whole, so a damaged file is compiled again. The folder is
``$HGORUN_CACHE_DIR``, or ``hgorun`` in the user's cache folder, private to the user: what is in it is
executed.

``$HGORUN_CPU`` names a processor to compile for in place of this one, as LLVM calls it: ``x86-64`` has nothing
beyond SSE2, ``x86-64-v3`` AVX2 and fma. Results are the same on each.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

_FORMAT = "3"
_LARGE = 4_000_000  # characters of IR: the code is the same, and takes half the time or less
_ALLOWED, _LARGEST = 2**28, 2**26  # bytes of all entries, and of one
_UNLISTED, _GRAIN = 2**24, 2**10  # bytes that are written before entries are listed again, and that are counted as one


class NativeModule:
    """Loaded machine code: it lives as long as this, or one of its functions that :meth:`function` has given.

    Keep it alive as long as what stands at one of its addresses is called.
    """

    def __init__(self, ir: str, exported: tuple[str, ...]) -> None:
        machine = _target_machine(len(ir))
        key = hashlib.sha256(
            "\0".join((_FORMAT, llvmlite.__version__, machine.triple, *processor(), ir)).encode()
        ).hexdigest()
        image = _read_cache(key)
        if image is not None:
            try:
                self._load(image, key, exported)
                return
            except (RuntimeError, KeyError):
                pass  # not what was compiled, in spite of its digest
        image = _compile(ir, machine)
        _write_cache(key, image)
        self._load(image, key, exported)

    def _load(self, image: bytes, key: str, exported: tuple[str, ...]) -> None:
        self._jit = llvm.create_lljit_compiler(_target_machine(), use_jit_link=_needs_jit_link())
        builder = llvm.JITLibraryBuilder().add_object_img(image).add_current_process()
        for name in exported:
            builder.export_symbol(name)
        self._library = builder.link(self._jit, f"hgorun-{key[:16]}-{id(self)}")
        self.address = {name: int(self._library[name]) for name in exported}

    def function(self, name: str, result: type[Any] | None, *arguments: type[Any]) -> Callable[..., Any]:
        """A function of C types, which keeps the code alive while somebody has it or is in it."""
        found = ctypes.CFUNCTYPE(result, *arguments)(self.address[name])
        vars(found)["module"] = self
        return found


def address_of(array: np.ndarray) -> int:
    """Where an array's memory starts: through its buffer, where that is given, in a quarter of the time."""
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]  # an array is a buffer
    except (TypeError, ValueError):  # it is empty, not to be written to, or not in one piece
        return int(array.__array_interface__["data"][0])


def _needs_jit_link() -> bool:
    return sys.platform == "linux" and os.uname().machine == "aarch64"


def processor() -> tuple[str, str]:
    """Name and features of the processor to compile for."""
    if chosen := os.environ.get("HGORUN_CPU"):
        return chosen, ""
    return _this_processor()


@cache
def _this_processor() -> tuple[str, str]:
    return str(llvm.get_host_cpu_name()), str(llvm.get_host_cpu_features().flatten())


_WIDTHS = {"x86-64": 2, "x86-64-v2": 2, "x86-64-v3": 4, "x86-64-v4": 8}


def vector_doubles() -> int:
    """How many doubles a vector register of the processor to compile for has."""
    name, features = processor()
    if name in _WIDTHS:
        return _WIDTHS[name]
    known = set(features.split(","))
    return 8 if "+avx512f" in known else 4 if "+avx" in known else 2


def _target_machine(size: int = 0) -> Any:
    """The compiler for modules of a size in characters of IR: of large ones, of a thousand observers, it is quicker."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = processor()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=1 if size > _LARGE else 2, reloc="pic", jit=False
    )


def _compile(ir: str, machine: Any) -> bytes:
    module = llvm.parse_assembly(ir)
    module.triple = machine.triple
    module.data_layout = str(machine.target_data)
    module.verify()
    # The IR comes unrolled and with its common subexpressions shared. The passes of -O2 take 40 times as long
    # as these two, most of the time of a compilation, for code that is no faster.
    passes = llvm.create_new_module_pass_manager()
    passes.add_always_inliner_pass()
    passes.add_sroa_pass()
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    return bytes(machine.emit_object(module))


def cache_folder() -> Path:
    """Where compiled code is kept."""
    if configured := os.environ.get("HGORUN_CACHE_DIR"):
        return Path(configured)
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return Path(base) / "hgorun"


def why_not_kept() -> str | None:
    """Why compiled code cannot be kept, or None: whether it can is tried."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not _private(folder):
            return "others can write there, and what they wrote is not run"
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_GRAIN))
    except OSError as error:
        return f"it cannot be written: {error.strerror}"
    return None


def _private(folder: Path) -> bool:
    """Whether only this user can write into the folder; nothing from another one is ever executed."""
    if not hasattr(os, "getuid"):
        return True
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _own_file(path: str, flags: int) -> int:
    """An opener: a regular file of this user; OSError for anything else."""
    # not followed where it is a link, not waited for where it is a pipe
    handle = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o600)
    status = os.fstat(handle)
    mine = not hasattr(os, "getuid") or status.st_uid == os.getuid()
    if stat.S_ISREG(status.st_mode) and mine:
        return handle
    os.close(handle)
    raise OSError("no file of ours")


def _entry(path: Path) -> bytes:
    """What is in an entry, which counts as used now; OSError where it is none of ours."""
    with open(path, "rb", opener=_own_file) as file:
        if os.fstat(file.fileno()).st_size > _LARGEST:
            raise OSError("no entry of ours")
        content = file.read()
    with suppress(OSError):  # where nothing can be written, nothing is removed either
        os.utime(path)
    return content


def _make_room(folder: Path, size: int) -> None:
    """Keep the cache to its size once an entry has been written.

    To list thousands of entries takes longer than to compile one. So every process appends to a file, a byte for each
    KiB that it has written; whoever finds it full removes it, and lists. What others write meanwhile counts anew.
    """
    tally = folder / ".written"
    try:
        with open(tally, "ab", buffering=0, opener=_own_file) as file:  # each appends in one piece
            file.write(bytes(-(-size // _GRAIN)))
            written = file.tell() * _GRAIN
    except OSError:  # whatever stands there counts nothing: entries are listed
        written = _UNLISTED
    if written >= _UNLISTED:
        with suppress(OSError):
            tally.unlink(missing_ok=True)
        _prune(folder, _ALLOWED - _UNLISTED)


def _prune(folder: Path, allowed: int) -> None:
    """Leave out the entries that were used longest ago, once all take more than is allowed."""
    entries = []
    with os.scandir(folder) as found:
        for entry in found:
            with suppress(FileNotFoundError):  # another process prunes, too
                status = entry.stat(follow_symlinks=False)
                if stat.S_ISREG(status.st_mode):
                    entries.append((status, entry.path))
    left = sum(status.st_size for status, _ in entries)
    for status, path in sorted(entries, key=lambda entry: entry[0].st_mtime):
        if left <= allowed:
            return
        Path(path).unlink(missing_ok=True)
        left -= status.st_size


def _read_cache(key: str) -> bytes | None:
    folder = cache_folder()
    try:
        if not _private(folder):
            return None
        content = _entry(folder / f"{key}.o")
    except OSError:
        return None
    digest, image = content[:32], content[32:]
    return image if _digest(key, image) == digest else None


def _digest(key: str, image: bytes) -> bytes:
    """With the key: code of another program under this name is none of this one."""
    digest = hashlib.sha256(key.encode())
    digest.update(image)
    return digest.digest()


def _write_cache(key: str, image: bytes) -> None:
    """A cache that cannot be written costs time, not the run."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        if not _private(folder):
            return
        handle, name = tempfile.mkstemp(dir=folder, prefix=".new-")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(_digest(key, image) + image)
            os.replace(name, folder / f"{key}.o")
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
        _make_room(folder, len(image))
    except OSError:
        return
