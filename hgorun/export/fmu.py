"""An observer as one file that other simulators read: a unit of FMI, with its sources and, if possible, binaries."""

from __future__ import annotations

import hashlib
import io
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from hgorun.errors import HgorunError
from hgorun.export.c_code import Real
from hgorun.export.c_files import c_files
from hgorun.export.c_source import Source
from hgorun.export.fmu_code import wrapper
from hgorun.export.fmu_templates import Version
from hgorun.export.fmu_variables import variables_of
from hgorun.export.fmu_xml import build_description, description, model_identifier
from hgorun.export.observer import Exported

_OPTIONS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off")
_DATE = (1980, 1, 1, 0, 0, 0)  # of the files inside: equal units are equal files
_FOLDERS = {  # of FMI 2.0 and 3.0, and the ending of a library
    ("linux", "x86_64"): ("linux64", "x86_64-linux", ".so"),
    ("windows", "x86_64"): ("win64", "x86_64-windows", ".dll"),
    ("darwin", "x86_64"): ("darwin64", "x86_64-darwin", ".dylib"),
    ("linux", "aarch64"): ("", "aarch64-linux", ".so"),
    ("darwin", "aarch64"): ("", "aarch64-darwin", ".dylib"),
}
_ZIG = {"linux": "linux-gnu", "windows": "windows-gnu", "darwin": "macos"}


@dataclass(frozen=True)
class Compiler:
    """What makes a library for one kind of machine.

    Attributes
    ----------
    command : tuple of str
        Of the compiler, with what chooses the machine.
    system, machine : str
        Such as ``linux`` and ``x86_64``.
    """

    command: tuple[str, ...]
    system: str
    machine: str

    def place(self, version: Version, name: str) -> str | None:
        """Where its library lies in the unit; None where that version knows no such machine."""
        second, third, ending = _FOLDERS[self.system, self.machine]
        folder = second if version == "2.0" else third
        return f"binaries/{folder}/{name}{ending}" if folder else None


def compilers() -> list[Compiler]:
    """The compilers that there are: for all machines where the package ziglang is installed, else for this one.

    The environment variable ``CC`` names another one for this machine.
    """
    if "CC" not in os.environ and find_spec("ziglang") is not None:
        zig = (sys.executable, "-m", "ziglang", "cc")
        return [Compiler((*zig, "-target", f"{m}-{_ZIG[s]}"), s, m) for s, m in _FOLDERS]
    known = [os.environ["CC"]] if "CC" in os.environ else ["cc", "gcc", "clang"]
    command = next((shlex.split(name) for name in known if shutil.which((shlex.split(name) or [""])[0])), None)
    here = platform.system().lower(), {"amd64": "x86_64", "arm64": "aarch64"}.get(*[platform.machine().lower()] * 2)
    return [Compiler(tuple(command), *here)] if command and here in _FOLDERS else []


def fmu(observer: Exported, version: Version, made_by: Sequence[Compiler], *, single: bool = False) -> bytes:
    """The bytes of a unit.

    Parameters
    ----------
    observer : Exported
    version : "2.0" or "3.0"
    made_by : sequence of Compiler
        For which machines there are binaries.
    single : bool
        Numbers of type ``float`` inside.

    Raises
    ------
    HgorunError
        When a compiler fails.
    """
    variables = variables_of(observer)
    files = dict(c_files(observer, single=single))
    names = [f"{observer.name}.c", f"{observer.name}_fmi.c"]
    source = Source(observer, Real(single))
    token = hashlib.sha256("\0".join([version, *files.values()]).encode()).hexdigest()[:32]
    files[names[1]] = wrapper(source, variables, version, token)
    parts = {"modelDescription.xml": description(observer, variables, version, token, names)}
    parts |= {f"sources/{name}": text.encode() for name, text in files.items()}
    if version == "3.0":
        parts["sources/buildDescription.xml"] = build_description(observer, names)
    parts |= _binaries(files, names, model_identifier(observer), version, made_by)
    return _zipped(parts)


def _binaries(
    files: Mapping[str, str], sources: Sequence[str], name: str, version: Version, made_by: Sequence[Compiler]
) -> Iterator[tuple[str, bytes]]:
    with tempfile.TemporaryDirectory() as folder:
        for file, text in files.items():
            (Path(folder) / file).write_text(text, encoding="utf-8")
        for compiler in made_by:
            place = compiler.place(version, name)
            if place is not None:
                yield place, _compiled(Path(folder), sources, compiler, place.rpartition("/")[2])


def _compiled(folder: Path, sources: Sequence[str], compiler: Compiler, library: str) -> bytes:
    libm = [] if compiler.system == "windows" else ["-lm"]
    command = [*compiler.command, *_OPTIONS, *sources, *libm, "-o", library]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise HgorunError(f"the C compiler cannot be started: {compiler.command[0]}: {error.strerror}") from error
    if done.returncode:
        said = next((line for line in done.stderr.splitlines() if "error" in line), "") or done.stderr[-200:]
        raise HgorunError(f"the C compiler fails: {shlex.join(command)}: {said}")
    return (folder / library).read_bytes()


def _zipped(parts: Mapping[str, bytes]) -> bytes:
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            entry = zipfile.ZipInfo(name, _DATE)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, content)
    return memory.getvalue()
