"""Numbers that were counted, by an encoder or a converter: nothing takes them for angles or lengths without a word."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from logs import noisy, recorded, table

from hgorun.data.units.loose_units import remark_on_name
from hgorun.data.units.named_units import AnotherUnit, said_in_name
from hgorun.data.units.units import alike, converted, not_known
from hgorun.errors import Problem

OF_TURNS = "Counts are converted by how many make a turn, as `turn/8192`."


def refused(unit: str, wanted: str) -> str:
    with pytest.raises(Problem) as caught:
        converted(np.ones(1), unit, wanted, ())
    return caught.value.message


@pytest.mark.parametrize(("unit", "wanted"), [("counts", "rad"), ("%", "rad"), ("ppm", "deg"), ("count/s", "rad/s")])
def test_what_is_a_number_to_others_is_no_angle(unit: str, wanted: str) -> None:
    assert not alike(unit, wanted)
    assert "one counts turns or angles" in refused(unit, wanted)


def test_the_advice_is_a_unit_that_converts() -> None:
    assert refused("counts", "rad").endswith(OF_TURNS)
    assert refused("inc", "deg") == f"'inc' is not a known unit. {OF_TURNS}"
    assert refused("Ticks", "m").endswith("Counts are converted by what one of them is, as `0.01 m`.")
    assert converted(np.array([8192.0]), "turn/8192", "rad", ())[0] == pytest.approx(2 * np.pi)
    assert converted(np.array([3.0]), "0.01 m", "m", ())[0] == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("unit", "meant"),
    [("2*pi/8192", "turn/8192"), ("2π/4096 rad", "turn/4096"), ("pi/180", "deg"), ("(pi)/500", "turn/1000")],
)
def test_a_part_of_a_turn_is_asked_for_by_its_unit(unit: str, meant: str) -> None:
    """A radian has 1/(2 pi) turns."""
    assert refused(unit, "rad") == f"{unit!r} is not a known unit. Did you mean `{meant}`?"


def test_counts_in_the_name_of_a_column_are_told() -> None:
    for said in ("counts", "inc", "Ticks", "raw", "digits"):
        assert said_in_name(f"Pos [{said}]", "rad", stated=False) == ""
        told = f"column 'Pos [{said}]': its name says {said}, the model has rad: taken as they are. {OF_TURNS}"
        assert remark_on_name(f"Pos [{said}]", "rad") == told
    assert "`0.01 m`" in remark_on_name("h (counts)", "m")
    for name, wanted in (("h [raw]", "m"), ("n [counts]", "1"), ("n [counts]", "count"), ("Pos [left]", "rad")):
        assert remark_on_name(name, wanted) == ""


def test_counts_in_a_row_of_units_are_refused_or_told_with_the_advice() -> None:
    def told(found: str) -> str:
        another = AnotherUnit(
            column="Pos", file="log.csv", source="the file", found=found, wanted="rad", said=None, who="the model has"
        )
        return another.told()

    with pytest.raises(ValueError, match=r"rad takes the numbers as they are\. Counts are .* `turn/8192`"):
        told("counts")
    assert told("inc").endswith(f"which is not a known unit, the model has rad: taken as they are. {OF_TURNS}")
    assert told("whatever").endswith("taken as they are")


def test_advice_is_of_the_same_kind() -> None:
    """A millimole is no milligram, though it is written nearly so; German names of units are known as such."""
    assert refused("mmol/L", "g/L") == "mmol/L cannot be converted to the model's g/L: it is of another kind."
    assert refused("mL", "g/L").endswith("Did you mean `mg/L`?")
    assert not_known("gramm/L") == "'gramm/L' is not a known unit. Did you mean `g/L`?"
    assert refused("Umdrehungen", "rad").endswith("Did you mean `turn`?")


def test_what_is_implausible_is_said_in_the_unit_of_the_model(tmp_path: Path) -> None:
    """Limits in the unit of the column leave everything out."""
    times, values = noisy()
    for unit, said in (("mg/L", " g/L, the model's unit"), ("g/L", "")):
        column = {"column": "glucose", "unit": unit, "plausible": [0.02 if said else 20, 100]}
        (note, *_) = recorded(tmp_path, table(times, values), {"outputs": {"S": column}}, units={"S": "g/L"}).notes
        assert note.message.endswith(f"100]{said}")
