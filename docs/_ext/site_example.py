"""What the pages of observers and plants show of an example: its configuration, a run, and equations as formulas."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import yaml
from site_curves import drawing

import hgorun
from hgorun.errors import HgorunError, Problem
from hgorun.export.accents import dotted
from hgorun.export.latex import latex
from hgorun.export.prepared import Wanted, exported
from hgorun.export.typeset import written
from hgorun.observers.base import AnyObserver, CorrectedObserver, SampledObserver
from hgorun.plants.base import Plant
from hgorun.plants.build import build_plant
from hgorun.simulation.simulate import prepare
from hgorun.tables.typeset import symbol

END = 10.0
_LONGEST = 3_000  # characters of formulas that a reader looks at
# An observer is shown on the first one that it takes.
PLANTS: tuple[Mapping[str, Any], ...] = (
    {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0}},
    {"type": "integrator_chain", "n": 2, "phi": "-x1 - x2 + sin(t)", "initial": {"x1": 1, "x2": 0}},
    {"type": "contois", "inputs": {"D": 0.3}, "initial": {"x1": 1.5, "x2": 15}},
    {"type": "academic", "initial": {"x1": 1, "x2": 0.5, "x3": -0.5}},
)


@dataclass(frozen=True)
class Example:
    """An observer or a plant that has been run.

    Attributes
    ----------
    config : mapping
        The configuration, as in YAML.
    drawing : str
        SVG.
    equations : str
        Markdown; empty where there are none to show.
    """

    config: Mapping[str, Any]
    drawing: str
    equations: str

    @property
    def text(self) -> str:
        return yaml.safe_dump(
            dict(self.config), sort_keys=False, default_flow_style=None, width=100, allow_unicode=True
        )


def of_observer(name: str, cls: type[AnyObserver]) -> Example | None:
    """The observer with the keys of its example on the first plant that it takes; None where it takes none."""
    for plant in PLANTS:
        states = tuple(plant["initial"])
        config = _configuration(name, cls, plant, states)
        try:
            experiment = hgorun.Experiment(config)
            result = hgorun.simulate(experiment)
        except (HgorunError, Problem):
            continue
        found = result.observers[name]
        if found.status in ("diverged", "undefined"):
            continue
        state = len(states) - 1
        shown = {"truth": result.x[:, state], "estimate": found.xhat[:, state]}
        told = f"The state {states[state]} of the plant {plant['type']}, and its estimate by {name}"
        return Example(config, drawing(result.time, shown, x="t", y=states[state], told=told), _equations(experiment))
    return None


def _configuration(
    name: str, cls: type[AnyObserver], plant: Mapping[str, Any], states: tuple[str, ...]
) -> dict[str, Any]:
    sampled = issubclass(cls, (CorrectedObserver, SampledObserver)) or name in ("savgol", "spline")
    noise = {"type": "gaussian", "std": 0.01} | ({} if sampled else {"hold": 0.05})
    measurement: dict[str, Any] = {"sampling": {"period": 0.1}} if sampled else {}
    return {
        "time": {"end": END, "output_step": 0.05},
        "plant": dict(plant),
        "measurement": {**measurement, "noise": [noise]},
        "observers": {name: {"type": name, **_plain(cls.example(states))}},
        "solver": {"method": "rk4", "step": 0.0025},
    }


def _plain(keys: Mapping[str, object]) -> dict[str, object]:
    return {key: dict(value) if isinstance(value, Mapping) else value for key, value in keys.items()}


def _equations(experiment: hgorun.Experiment) -> str:
    """The equations that the export writes for a paper, as Markdown."""
    try:
        (observer,) = exported(prepare(experiment), Wanted(steps=False))
        text = latex(observer)
    except (HgorunError, Problem):
        return ""
    if len(text) > _LONGEST:
        return ""
    text = re.sub(r"^%.*\n", "", text, flags=re.MULTILINE).strip()
    return re.sub(r"\\begin\{align\*\}\n(.*?)\\end\{align\*\}", _aligned, text, flags=re.DOTALL)


def _aligned(found: re.Match[str]) -> str:
    return "\n" + displayed(found[1]) + "\n"


def displayed(lines: str) -> str:
    """Lines of an alignment as a formula of its own."""
    lines = re.sub(r"\\dot\{((?:[^{}]|\{[^{}]*\})*)\}", r"{\\dot{\1}}", lines)  # else its index would stand below it
    lines = re.sub(r"\\(wide)?hat\{((?:[^{}]|\{[^{}]*\})*)\}", r"{\\hat{\2}}", lines)
    return "$$\n\\begin{aligned}\n" + lines.rstrip() + "\n\\end{aligned}\n$$"


def of_plant(name: str, cls: type[Plant]) -> Example:
    """The plant, followed by itself."""
    inputs = {"inputs": dict.fromkeys(cls.known_inputs, 0.1)} if cls.known_inputs else {}
    keys: dict[str, Any] = {"type": name, **inputs, **cls.example()}
    states = cls.model_validate(keys).state_names
    between = np.linspace(0.5, 1.0, len(states)).round(2).tolist()
    keys["initial"] = {**dict(zip(states, between, strict=True)), **keys.get("initial", {})}
    block = cls.model_validate(keys)
    watched = {"type": "kalman_bucy", "Q": dict.fromkeys(states, 1.0), "R": 0.1, "initial": keys["initial"]}
    config = {
        "time": {"end": END, "output_step": 0.02},
        "plant": keys,
        "observers": {"beside": watched},
        "solver": {"method": "rk4", "step": 0.005},
    }
    result = hgorun.simulate(hgorun.Experiment(config))
    curves = {state: result.x[:, i] for i, state in enumerate(states[:4])}
    told = f"The states of the plant {name} over time"
    shown = {key: value for key, value in config.items() if key != "observers"}
    return Example(shown, drawing(result.time, curves, x="t", y="", told=told), _of_model(block))


def _of_model(block: Plant) -> str:
    """x' = f and y = h with the symbols of states, inputs and parameters."""
    model = build_plant(block).model
    function = ca.Function("f", [model.t, model.x, model.u, model.p], [model.dynamics, model.output])
    groups = ((1, model.states), (2, model.inputs), (3, model.parameters))
    names = {(0, 0): "t"} | {(i, k): _letter(name) for i, of in groups for k, name in enumerate(of)}
    found = written(function, names, "a")
    lines = [
        f"{_derivative(state)} &= {formula.text} \\\\"
        for state, formula in zip(model.states, found.formulas["o0"], strict=True)
    ]
    lines += [
        f"{name} &= {formula.text} \\\\"
        for name, formula in zip(_outputs(model.outputs, model.states), found.formulas["o1"], strict=True)
    ]
    lines += [f"{name} &= {formula.text} \\\\" for name, formula in found.abbreviations]
    return displayed("\n".join(lines).removesuffix(r" \\"))


def _letter(name: str) -> str:
    """theta_dot is the derivative of theta."""
    base = name.removesuffix("_dot")
    return symbol(name) if base == name else rf"\dot{{{symbol(base)}}}"


def _derivative(state: str) -> str:
    base = state.removesuffix("_dot")
    return dotted(symbol(state)) if base == state else rf"\ddot{{{symbol(base)}}}"


def _outputs(names: Sequence[str], states: Sequence[str]) -> list[str]:
    """Symbols of outputs: those that are called like states are y, with a number where there are several."""
    own = [f"y_{{{i + 1}}}" if len(names) > 1 else "y" for i in range(len(names))]
    return [letter if name in states else symbol(name) for name, letter in zip(names, own, strict=True)]
