"""One rule for units: a time has a unit of time, and a unit that nobody knows is said to be a label."""

from __future__ import annotations

import sys
from fractions import Fraction

import pytest
from examples import VAN_DER_POL, experiment, inline

from hgorun import ConfigError
from hgorun.config.time_units import SECONDS, SHORT
from hgorun.data.units import _registry, not_known
from hgorun.simulation.scheduling import remarks

OBSERVER = {"S": {"type": "shgo", "theta": 2}}


@pytest.mark.parametrize("unit", ["s", "h", "days", "µs", "week", "year", "-", "", "samples"])
def test_units_of_time_are_taken(unit: str) -> None:
    made = experiment(VAN_DER_POL, OBSERVER).varied({"time.unit": unit})
    assert made.blocks.time.unit == unit


@pytest.mark.parametrize(
    ("unit", "told"),
    [("kg", ""), ("hz", " Did you mean"), ("hour s", " Did you mean `hours`?"), ("m", ""), ("Tag", ""), ("msekk", "")],
)
def test_other_units_of_time_are_refused(unit: str, told: str) -> None:
    with pytest.raises(ConfigError, match=f"time.unit: '{unit}' is not a unit of time.{told}") as caught:
        experiment(VAN_DER_POL, OBSERVER).varied({"time.unit": unit})
    assert "Known: ns, us, ms, s, min, h, d, week, month, year" in str(caught.value)


def test_units_of_time_are_as_long_as_those_of_a_library() -> None:
    for name in (*SECONDS, *SHORT):
        assert _registry().Quantity(1, name).to("ns").magnitude == pytest.approx(
            float(SECONDS[SHORT.get(name, name)] / Fraction(1, 10**9))
        )


def test_a_unit_of_a_state_that_is_not_known_is_told() -> None:
    plant = inline({"x1": "x2", "x2": "-x1"}, "x1", units={"x1": "kgg", "x2": "mm/s^2"})
    (found,) = remarks(experiment(plant, OBSERVER))
    assert found.endswith(
        "plant.units.x1: 'kgg' is not a known unit. Did you mean `kg`? It is taken as a label, and converted "
        "to no other"
    )


@pytest.mark.parametrize(
    "unit", ["g/L", "g/(L h)", "1/h", "rad/s", "m**2", "m s^-1", "mV", "degC", "-", "", "1", "kPa"]
)
def test_usual_units_are_known_without_the_library_which_knows_them_too(
    unit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "pint", None)
        _registry.cache_clear()
        assert not_known(unit) == ""
    if unit not in ("", "-"):
        _registry().Unit(unit)


@pytest.mark.parametrize("unit", ["fortnight", "parsec", "°C", "USD", "m3", "kg kg kgg"])
def test_what_is_unusual_is_asked_of_the_library(unit: str) -> None:
    known = unit in ("fortnight", "parsec", "°C", "m3")
    assert (not_known(unit) == "") is known
