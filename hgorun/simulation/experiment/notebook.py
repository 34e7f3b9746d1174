"""How a notebook shows an experiment: its plant, and the observers with their keys."""

from __future__ import annotations

from hgorun import markup
from hgorun.simulation.experiment.configured import Configured


def as_html(experiment: Configured) -> str:
    """A table with a row for each observer; nothing is built for it."""
    plant, time = experiment.plant_block, experiment.blocks.time
    rows = []
    for label, block in experiment.observers.items():
        given = block.model_dump(exclude_unset=True, exclude={"type"})
        rows.append([label, block.type, ", ".join(f"{key}: {value}" for key, value in given.items())])
    measured = ", ".join(plant.output_names)
    driven = f", inputs {', '.join(plant.input_names)}" if plant.input_names else ""
    notes = [
        f"plant {plant.type}: states {', '.join(plant.state_names)}, outputs {measured}{driven}",
        f"time {time.start:g} to {time.end:g} {time.unit}, seed {experiment.blocks.seed}",
    ]
    title = experiment.blocks.title
    caption = f"{experiment.name}: {title}" if title else experiment.name
    return markup.table(caption, ["observer", "type", "keys"], rows, notes)
