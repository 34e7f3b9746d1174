"""What a name is that does not stand in its place on the command line."""

from __future__ import annotations

from pathlib import Path

from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.reproduce.shipped import claims_called, drawing_figure, examples, experiments


def in_its_place(name: str) -> str:
    """For a name that ``init`` does not know where it stands: what it is, and the command with it, or ""."""
    if name in PLANTS.names():
        return f" To start with the plant: hgorun init --plant {name}"
    if name in OBSERVERS.names():
        return f" It is an observer: hgorun init --plant NAME --observer {name}"
    shipped = experiments()
    if name in examples() or any(name in (path, Path(path).name) for path in shipped):
        return f" It is an experiment: hgorun init {name}"
    if drawing := drawing_figure(name):
        copied = "; ".join(f"hgorun init {Path(path).name} copies the experiment {path}" for path in drawing)
        return f" It is a figure, which hgorun figures {name} draws: {copied}; hgorun show {name} describes it"
    if claims := claims_called(name):
        measured = ", ".join(f"hgorun claims {path}" for path, *_ in claims)
        return f" It is a claim, which hgorun show {name} describes; {measured} measures it"
    folder = name.rstrip("/")
    below = [path for path in shipped if path.startswith(f"{folder}/") or f"/{folder}/" in path]
    return f" It is a folder of experiments, of which init copies one: {', '.join(below)}" if below else ""
