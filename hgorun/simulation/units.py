"""Units of the plant's signals that nobody knows: labels, which are never converted."""

from __future__ import annotations

from collections.abc import Iterator

from hgorun.config.yaml_source import Source
from hgorun.data.units import not_known


def unknown_units(source: Source) -> Iterator[str]:
    """A remark for every unit of ``plant.units`` that is not known."""
    plant = source.data.get("plant")
    units = plant.get("units") if isinstance(plant, dict) else None
    for name, unit in units.items() if isinstance(units, dict) else ():
        if isinstance(unit, str) and (told := not_known(unit)):
            yield f"{source.told(('plant', 'units', name))}: {told} It is taken as a label, and converted to no other"
