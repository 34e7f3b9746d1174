"""Units of the plant's signals that nobody knows, or that do not fit the plant's equations."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from hgorun.config.time_units import SHORT
from hgorun.config.yaml_source import Source
from hgorun.data.units.unit_per_time import factors_of, per_time, unlike_rate, written
from hgorun.data.units.units import is_time, not_known
from hgorun.errors import printable
from hgorun.simulation.remarks.units_of_terms import mistaken_terms
from hgorun.symbolic.plant import PlantModel


def unit_remarks(source: Source, model: PlantModel) -> Iterator[str]:
    """Remarks on ``plant.units``: labels, which are never converted, and units of derivatives that are others."""
    plant = source.data.get("plant")
    given = plant.get("units") if isinstance(plant, dict) else None
    units = {name: unit for name, unit in given.items() if isinstance(unit, str)} if isinstance(given, dict) else {}
    for name, unit in units.items():
        if told := not_known(unit):
            yield f"{source.told(('plant', 'units', name))}: {told} It is taken as a label, and converted to no other"
    time = source.data.get("time")
    clock = time.get("unit") if isinstance(time, dict) else None
    if len(units) < 2 or not isinstance(clock, str):
        return
    for name, rate in _derivatives(model):
        if name in units and rate in units and (wrong := unlike_rate(units[name], clock, units[rate])):
            of_state, of_rate, per = printable(units[name]), printable(units[rate]), printable(clock)
            yield (
                f"{source.told(('plant', 'units', rate))}: {of_rate}, but {name}' = {rate} makes it "
                f"{per_time(of_state, per)}, since {name} is in {of_state} and time in {per}: {printable(wrong)}. "
                "Write the unit that the numbers have, or the factor into the equation"
            )
    known = {name: found for name, unit in units.items() if (found := factors_of(unit)) is not None}
    for name, one in mistaken_terms(model, known, SHORT.get(clock, clock)) if is_time(clock) else ():
        term, other = one.term, one.other
        own, beside = written(term.unit), written(other.unit)
        place = source.told(("plant", "dynamics", name))
        what = f"its term of {' and '.join(term.signals)}" if len(term.signals) > 1 else term.signals[0]
        if one.factor == 1:
            yield (
                f"{place}: {term.signals[0]} is in {_of_scale(own)}, and {other.signals[0]}, which is compared with "
                f"it, in {_of_scale(beside)}, from another zero. Write the units that the numbers have"
            )
            continue
        if one.rate:
            says = f"its derivative in {beside}, with time in {printable(clock)}"
        else:
            says = f"{' and '.join(other.signals)}, to which it is added, in {beside}"
        yield (
            f"{place}: {what} is in {own}, and {says}: 1 {beside} is {one.factor:.6g} {own}. "
            "Write the units that the numbers have, or the factor into the equation"
        )


def _of_scale(difference: str) -> str:
    """The unit of a temperature, from that of differences."""
    return difference.removeprefix("delta_")


def _derivatives(model: PlantModel) -> Iterator[tuple[str, str]]:
    """The states whose derivative is another state, neither more nor less; and that one."""
    for i, name in enumerate(model.states):
        for j, other in enumerate(model.states):
            if i != j and ca.is_equal(model.dynamics[i], model.x[j]):
                yield name, other
