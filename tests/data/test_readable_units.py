"""What may be a unit to the library is told without it: a text that is none costs no import of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from hgorun.data.units import readable_units, units
from hgorun.data.units.named_units import convertible_in_name, foreign_in_name
from hgorun.data.units.readable_units import may_be_read, registry
from hgorun.data.units.units import alike, converted, is_unit


@pytest.fixture
def without_library(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Nothing may ask the library."""
    asked: list[object] = []
    monkeypatch.setattr(units, "registry", lambda: asked.append(1))
    yield
    assert not asked


@pytest.fixture
def read_again() -> Iterator[None]:
    """The lists are read anew, and once more afterwards."""
    readable_units._listed.cache_clear()
    yield
    readable_units._listed.cache_clear()


def test_what_the_library_reads_may_be_read() -> None:
    another = registry.__wrapped__()  # another one, to which no test has added prefixes
    names = sorted(another._units)
    assert len(names) > 500
    assert [name for name in names if not may_be_read(name)] == []
    behind_prefixes = [prefix + name + end for prefix in another._prefixes for name in names[::9] for end in ("", "s")]
    assert [name for name in behind_prefixes if not may_be_read(name)] == []
    for text in ("meter per second", "cubic feet", "inch squared", "sq mile", "°F", "delta_degC"):
        another.Unit(text)
        assert may_be_read(text), text


@pytest.mark.parametrize("text", ["sensor 3", "inlet", "A1", "TI101", "raw", "left", "measured*2", "meter of tank"])
def test_what_the_library_cannot_read(text: str) -> None:
    with pytest.raises(Exception, match=r".+"):
        registry().Unit(text)
    assert not may_be_read(text)


@pytest.mark.usefixtures("without_library")
@pytest.mark.parametrize("text", ["sensor 3", "inlet", "TI101", "raw", "1st floor"])
def test_a_remark_behind_a_name_is_no_unit(text: str) -> None:
    assert convertible_in_name(f"T [{text}]", "K") == ""
    assert foreign_in_name(f"T [{text}]", "K") == ""
    assert not alike(text, "K")
    assert not is_unit(text)


@pytest.mark.usefixtures("without_library")
@pytest.mark.parametrize(
    ("unit", "wanted"), [("°C", "degC"), ("m³", "m^3"), ("m3", "m^3"), ("L-1", "L^-1"), ("r.p.m.", "rpm")]
)
def test_one_unit_in_two_notations_is_not_converted(unit: str, wanted: str) -> None:
    assert alike(unit, wanted)
    assert converted(np.array([1.5, 20.0]), unit, wanted, ()).tolist() == [1.5, 20.0]


@pytest.mark.usefixtures("read_again")
def test_without_its_lists_the_library_is_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(readable_units, "find_spec", lambda _: None)
    assert may_be_read("sensor")
    readable_units._listed.cache_clear()
    monkeypatch.setattr(readable_units, "find_spec", lambda _: type("Spec", (), {"origin": str(tmp_path / "pint.py")}))
    assert may_be_read("sensor")
