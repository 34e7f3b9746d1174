"""What tests run: plants, measurements and observers as blocks of a configuration, and experiments made of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

import hgorun
from hgorun import Experiment, Result
from hgorun.analysis.finding import Finding, all_findings
from hgorun.analysis.report import Findings
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare

Block = dict[str, Any]  # what stands below a key of the YAML file
Outputs = str | Sequence[str] | Mapping[str, str]

VAN_DER_POL: Block = {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}}
ACADEMIC: Block = {"type": "academic", "initial": {"x1": 1, "x2": 1, "x3": 1}}
CONTOIS: Block = {
    "type": "contois",
    "parameters": {"mu": 1.064, "k_c": 4.39, "s_in": 20},
    "inputs": {"D": "mu*(1 - abs(sin(t))/2)"},
    "initial": {"x1": 1.5, "x2": 15},
}


def states(n: int) -> list[str]:
    """The names x1 .. xn."""
    return [f"x{i + 1}" for i in range(n)]


def chain(n: int, phi: str = "0", start: float | Sequence[float] = 0.5) -> Block:
    """n integrators, the last one of phi, from one start for all states or one for each."""
    values = [start] * n if isinstance(start, int | float) else start
    return {"type": "integrator_chain", "n": n, "phi": phi, "initial": dict(zip(states(n), values, strict=True))}


def inline(dynamics: Mapping[str, str], output: Outputs, start: float = 0.5, **more: Any) -> Block:
    """A plant written out; its states are those of the dynamics, all of one start unless ``initial`` is given."""
    initial = dict.fromkeys(dynamics, start)
    return {"states": list(dynamics), "dynamics": dict(dynamics), "output": output, "initial": initial, **more}


def sinusoid(amplitude: float, omega: float, phase: float = 0.0) -> list[Block]:
    """Noise that is one sinusoid."""
    return [{"type": "sinusoids", "terms": [{"amplitude": amplitude, "omega": omega, "phase": phase}]}]


def experiment(
    plant: Block,
    observers: Mapping[str, Block],
    *,
    end: float = 1.0,
    output_step: float = 0.1,
    step: float | None = None,
    **more: Any,
) -> Experiment:
    """The experiment of a plant and observers by label.

    Parameters
    ----------
    end, output_step : float
        Of ``time``.
    step : float, optional
        Of ``solver``, whose other keys keep their defaults; None: the automatic step.
    more : blocks
        ``measurement``, ``metrics``, ``seed`` and so on; ``time`` and ``solver`` replace what is said above.
    """
    config: Block = {"time": {"end": end, "output_step": output_step}, "plant": plant, "observers": dict(observers)}
    if step is not None:
        config["solver"] = {"step": step}
    return Experiment(config | more, name="test")


def simulated(plant: Block, observers: Mapping[str, Block], **more: Any) -> Result:
    """The result of :func:`experiment`."""
    return hgorun.simulate(experiment(plant, observers, **more))


def load(folder: Path, config: str | Mapping[str, Any], *overrides: str) -> Experiment:
    """The experiment of YAML text, or of the same as a mapping, with ``path=value`` assignments on top."""
    path = folder / "experiment.yaml"
    path.write_text(config if isinstance(config, str) else yaml.safe_dump(config, sort_keys=False))
    return hgorun.load(path, overrides)


def run(folder: Path, config: str | Mapping[str, Any], *overrides: str, **options: Any) -> Result:
    """Simulate it."""
    return hgorun.simulate(load(folder, config, *overrides), **options)


def prepared(folder: Path, config: str | Mapping[str, Any], *overrides: str) -> PreparedRun:
    """All that is decided before the first step: the engine's tables and numbers."""
    return prepare(load(folder, config, *overrides))


def findings(*files: str) -> list[Finding]:
    """The findings declared in some files of hgorun/analysis/findings."""
    return [one for one in all_findings() if one.of.__module__.rpartition(".")[2] in files]


def said(found: Findings) -> Block:
    """What an analysis says of an observer, by finding; a test knows of which kind each value is."""
    return dict(found.values)
