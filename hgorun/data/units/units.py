"""Numbers from one unit to another."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from hgorun.config.expressions import nearest
from hgorun.config.time_units import SECONDS, SHORT, meant_unit, without_length
from hgorun.data.units.factored_units import asked, has_number, joined, parted
from hgorun.data.units.meant_units import german_degrees, meant_by
from hgorun.data.units.readable_units import may_be_read, registry
from hgorun.data.units.turns import counted_by, counts_of, exponents, is_counted, part_of_turn, turns_alone
from hgorun.data.units.usual_units import in_other_letters, is_usual, unusual
from hgorun.data.units.written_units import (
    in_usual_notation,
    is_misread,
    temperature_in,
    with_temperatures,
    without_points,
    without_reference,
)
from hgorun.errors import KeyPath, Problem

if TYPE_CHECKING:
    import pint

_COMMON = """
    mg/L g/L ug/L kg/m^3 mol/L mmol/L mol/m^3 g kg mg mol mL L m^3 m cm mm km m/s m/s^2 km/h rad deg rad/s deg/s rpm
    1/s 1/min 1/h 1/d Hz L/h L/min mL/min m^3/h m^3/s kg/h kg/s g/h degC degF K Pa kPa mbar bar V mV A mA W kW J kJ N
    percent s min h d ms
"""  # that may be meant
# pint calculates with what it is given: no powers of powers, and few digits
_FACTOR = r"\(?\s*(?:[^\W\d]\w{0,30}|[%‰°]\w?|\d{1,6})(?:\s*(?:\*\*|\^)\s*-?\d)?\s*\)?"
_UNIT = re.compile(rf"{_FACTOR}(?:\s*[*/ ]\s*{_FACTOR}){{0,8}}")
_NOT_NUMBERS = re.compile(r"[^\W\d]|[%‰°]")
NO_UNIT = ("-", "1", "")
"""How it is written that numbers have no unit."""
_DIGIT = re.compile(r"([^\W\d_])([2-9])(?!\w)")
_PREFIXES = {"m": "0.001", "k": "1000", "M": "1e6", "G": "1e9"}
_PREFIXED = re.compile(r"([mkMG])([^\W\d_]+)")
_BITS = ("bit", "byte")


def seconds(unit: str, path: KeyPath) -> Fraction:
    """How long a unit of time is.

    Raises
    ------
    Problem
        At ``path``, when it is not a unit of time.
    """
    found = _seconds(unit)
    if found is None and without_length(unit):
        raise Problem(path, f"{unit!r} has no fixed length: dates and other times are in {', '.join(SECONDS)}")
    if found is None:
        raise Problem(
            path, f"{unit!r} is not a unit of time.{meant_unit(unit, list(SECONDS))} Known: {', '.join(SECONDS)}"
        )
    return found


def _seconds(unit: str) -> Fraction | None:
    """How long a unit of time is, also of several; None of another unit."""
    factor, plain = parted(unit)
    found = SECONDS.get(SHORT.get(plain, plain))
    return None if found is None else factor * found


def scaled(values: np.ndarray, factor: Fraction) -> np.ndarray:
    """Values times an exact factor; one that is 1 leaves them as they are."""
    if factor == 1:
        return values
    return values * float(factor.numerator) / float(factor.denominator)


def converted(values: np.ndarray, unit: str, wanted: str, path: KeyPath) -> np.ndarray:
    """Values in another unit.

    Raises
    ------
    Problem
        At ``path``, when a unit is not known or when the two are of different kinds.
    """
    (factor, plain), (of_wanted, plain_wanted) = parted(unit), parted(wanted)
    alike_written = factor == of_wanted and in_usual_notation(plain) == in_usual_notation(plain_wanted)
    if (alike_written and are_usual(unit)) or without_points(unit) == without_points(wanted):
        return values
    from pint.errors import DimensionalityError

    known = registry()
    target = _parsed(known, wanted, path)
    found = _parsed(known, unit, path, target)
    if turns_alone(found, target):
        message = f"{unit} cannot be converted to the model's {wanted}: one counts turns or angles, and the other does"
        asks = meant_by(unit) or is_counted(unit)
        hint = f". {said}" if (said := counted_by(found)) else _meant(unit, target, ".") if asks else ""
        raise Problem(path, f"{message} not say what it counts; {wanted} takes the numbers as they are{hint}")
    another = f"{unit} cannot be converted to the model's {wanted}: it is of another kind."
    if exponents(found, _BITS) != exponents(target, _BITS):  # a byte is no bel, and to pint 8
        raise Problem(path, another)
    try:
        numbers = np.asarray(known.Quantity(scaled(values, factor), found).to(target).magnitude, dtype=float)
        cycles = exponents(found, ("hertz",)) - exponents(target, ("hertz",))
        return scaled(numbers * (2 * np.pi) ** cycles if cycles else numbers, 1 / of_wanted)
    except DimensionalityError:
        raise Problem(path, another + _meant(unit, target)) from None


def are_usual(*units: str) -> bool:
    """Whether texts are units that are converted, or say that there is none; told without pint.

    To import it takes longer than many a run takes.
    """
    return all(unit in NO_UNIT or _is_read(in_usual_notation(parted(unit)[1])) for unit in units)


def _is_read(written: str) -> bool:
    """Whether all factors of a unit, in usual notation, are units of engineering, and their product is meant."""
    return unusual(written) is None and not is_misread(written)


def not_known(unit: str) -> str:
    """That a unit is not known, with what may be meant; empty where it is, or says that there is none."""
    if unit in NO_UNIT:
        return ""
    written = in_usual_notation(parted(unit)[1])
    if are_usual(unit) and _UNIT.fullmatch(written):
        return "" if _NOT_NUMBERS.search(written) else f"{unit!r} is a number, not a unit."
    try:
        _parsed(registry(), unit, ())
    except Problem:
        meant = _meant_alone(unit)
        is_one = meant != unit and is_unit(meant)
        hint = f" Did you mean `{meant}`?" if is_one else _nearest(unit, _COMMON.split())
        return f"{unit!r} is not a known unit.{hint}"
    return ""


def is_time(unit: str) -> bool:
    """Whether it is a unit of time."""
    return _seconds(unit) is not None


def is_unit(text: str) -> bool:
    """Whether a text is a unit that numbers can have."""
    if not are_usual(text):
        return is_time(text)
    try:
        _parsed(registry(), text, ())
    except Problem:
        return is_time(text)
    return True


def alike_times(unit: str, other: str) -> bool:
    """Whether two texts mean the same unit of time, as h and hours do; not where one is unknown."""
    return unit == other or (is_time(unit) and _seconds(unit) == _seconds(other))


def alike(unit: str, other: str) -> bool:
    """Whether two texts mean the same unit, as degC and °C do; not where one is unknown."""
    if unit != other and not are_usual(unit, other):
        return without_points(unit) == without_points(other)
    two = np.array([0.0, 1.0])
    try:
        return bool(np.allclose(converted(two, unit, other, ()), two, rtol=1e-12, atol=1e-12))
    except Problem:
        return False


def foreign(unit: str, wanted: str) -> bool:
    """Whether a unit is none that is converted, and yet one in which numbers of this kind would be others.

    What is not converted may be read by accident, but taken as it is it may as well be silently wrong.
    """
    of = _meant_alone(wanted)
    factor, meant = parted(_meant_alone(unit, with_temperatures(of)))
    readings = [meant]
    if len(meant) > 1:  # RPM, KPA, M/S
        readings += in_other_letters(meant) or [low for low in [meant.lower()] if _is_read(in_usual_notation(low))]
    readings = [joined(factor, other) for one in readings for other in _readings(one)]
    seen = [same for same in (_read_as(one, of) for one in readings) if same is not None]
    return (bool(seen) and not any(seen)) or any(_read_as(_meant_alone(one), of) is False for one in asked(unit))


def _meant_alone(unit: str, wanted: str = "") -> str:
    """The unit that an abbreviation stands for, without what is told of a zero of pressure or of conditions.

    What it is beside may say so of degrees.
    """
    if turned := part_of_turn(unit):
        return turned
    factor, plain = parted(unit)
    german = german_degrees(plain, wanted) if wanted else ""
    without = without_reference(plain)
    meant = german or meant_by(without or plain) or without
    return joined(factor, meant) if meant else unit


def _read_as(unit: str, wanted: str) -> bool | None:
    """Whether a library reads a text as the same unit as another; None where it is of another kind or none."""
    two, (factor, plain), (of_wanted, plain_wanted) = np.array([0.0, 1.0]), parted(unit), parted(wanted)
    if plain in ("percent", "permille", "%", "‰") and wanted in NO_UNIT:
        return False
    written = [in_usual_notation(one) for one in (plain, plain_wanted)]
    if unit.isdigit() or not all(_UNIT.fullmatch(one) and may_be_read(one) for one in written):
        return None
    with suppress(Exception), np.errstate(divide="ignore"):  # whatever its parser stumbles over
        found, target = (registry().Unit(one) for one in written)
        numbers = registry().Quantity(two * float(factor), found).to(target).magnitude
        return bool(np.allclose(numbers, two * float(of_wanted), rtol=1e-12, atol=1e-12))
    return None


def meant_for(unit: str, wanted: str) -> str:
    """What may be meant by a unit where numbers of another kind are wanted, as a question; empty where nothing is."""
    with suppress(Problem):
        return _meant(unit, _parsed(registry(), wanted, ()))
    return ""


def _parsed(known: pint.UnitRegistry[float], text: str, path: KeyPath, wanted: pint.Unit | None = None) -> pint.Unit:
    """A unit; of one that is not known it is said what may be meant, if the kind that is wanted is known."""
    if text in NO_UNIT:
        return known.Unit("dimensionless")
    written = in_usual_notation(parted(text)[1])
    if not _UNIT.fullmatch(written):
        raise Problem(path, f"{text!r} cannot be a unit{_meant(text, wanted, '.')}")
    if _is_read(written):
        with suppress(Exception):  # whatever its parser stumbles over
            return known.Unit(written)
    meant = _meant(text, wanted)
    hint = f".{meant}" if meant else "; without the key the numbers are taken as they are"
    raise Problem(path, f"{text!r} is not a known unit{hint}")


def _meant(text: str, wanted: pint.Unit | None, before: str = "") -> str:
    """What may be meant by a unit where one of a kind is wanted, as a question; empty where nothing is.

    That is what an abbreviation stands for, the same in other letters, or the most similar of common units.
    """
    if wanted is None:
        return ""
    factor, plain = parted(text)
    if is_counted(plain):
        return f"{before} {counts_of(wanted)}"
    meant = german_degrees(plain, str(wanted)) or temperature_in(plain)
    if meant:
        return f"{before} Did you mean `{joined(factor, meant)}`?"
    if _fits(text, wanted, anything=True) and (counts := counted_by(registry().Unit(in_usual_notation(plain)))):
        return f"{before} It does not say what it counts: {counts}."
    meant = _meant_alone(text)
    if without_reference(plain) and _fits(meant, wanted):
        told = "Where its zero lies, or which conditions are meant, it does not say."
        return f"{before} Did you mean `{meant}`? {told}"
    letters = [joined(factor, one) for one in in_other_letters(plain) if _may_be(plain, one)]
    for those in ([meant] if meant != text else [], letters, map(_meant_alone, asked(text))):
        if fitting := [one for one in those if _fits(one, wanted)]:
            return f"{before} Did you mean {' or '.join(f'`{one}`' for one in fitting)}?"
    if is_unit(text) and "[substance]" in _parsed(registry(), text, ()).dimensionality:
        return ""  # mmol/L may look like mg/L, and is none
    close = _nearest(text, [unit for unit in _COMMON.split() if unit != text and _fits(unit, wanted)])
    return before + close if close else ""


def _nearest(text: str, known: list[str]) -> str:
    """The most similar of units, as a question; none of those of which what is written is another size."""
    return "" if has_number(text) else nearest(text, [unit for unit in known if _may_be(text, unit)])


def _may_be(text: str, unit: str) -> bool:
    """Whether what is not known may be a unit in other letters: not where a prefix or a library says another size."""
    return not any(_read_as(one, unit) is False for one in _readings(text))


def _readings(text: str) -> Iterator[str]:
    """A text that is no unit as a library may read it, also with powers and prefixes that nobody writes."""
    yield text
    if (power := _DIGIT.sub(r"\1^\2", text)) != text:
        yield power  # Mm3/d
    if (match := _PREFIXED.match(text)) and not is_usual(match[0]) and is_usual(match[2]):
        yield f"{_PREFIXES[match[1]]} {text[1:]}"  # kt/h


def _fits(text: str, wanted: pint.Unit, *, anything: bool = False) -> bool:
    """Whether a text is a unit of the same kind as another; of turns or of anything, where that is said."""
    try:
        found = _parsed(registry(), text, ())
    except Problem:
        return False
    return found.is_compatible_with(wanted) and (anything or not turns_alone(found, wanted))
