"""What tests compile quickly has the bits of the arithmetic that is written, and users never get it."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest
from quick_code import compiled_quickly

from hgorun.native.compiler import NativeModule

STEPS = 400  # enough to be compiled quickly
STEP = """
  %a{k} = fmul double %b{before}, 0x3FF0000002AF31DC
  %c{k} = fsub double %a{k}, %x
  %b{k} = fdiv double %c{k}, 0x3FEFFFFFFF768FA1
"""


def written() -> str:
    steps = "".join(STEP.format(k=k, before=k - 1) for k in range(1, STEPS))
    begun = "define dso_local double @f(double %x) {\n  %b0 = fadd double %x, 0.0\n"
    return f"{begun}{steps}  ret double %b{STEPS - 1}\n}}"


def by_hand(x: float) -> float:
    a, b = float.fromhex("0x1.0000002AF31DCp0"), float.fromhex("0x1.FFFFFFF768FA1p-1")
    value = x
    for _ in range(1, STEPS):
        value = (value * a - x) / b
    return value


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_the_bits_are_those_of_the_operations(folder: Path) -> None:
    text = written()
    with compiled_quickly():
        quick = NativeModule(text, ("f",))
    users = NativeModule(text, ("f",))
    for module in (quick, users):
        value = module.function("f", ctypes.c_double, ctypes.c_double)
        assert [value(x) for x in (0.1, -3.7e5)] == [by_hand(x) for x in (0.1, -3.7e5)]
    entries = [path.read_bytes() for path in folder.glob("*.o")]  # neither is taken for the other
    assert (len(entries), entries[0] == entries[1]) == (2, False)
    NativeModule(text, ("f",))
    assert len(list(folder.glob("*.o"))) == 2  # afterwards all is as before
