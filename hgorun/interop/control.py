"""To and from python-control: its systems as plants, observers as its systems. Needs the extra ``control``.

>>> pendulum = control.nlsys(lambda t, x, u, p: [x[1], -np.sin(x[0]) + u[0]], None, inputs=1, outputs=2, states=2)
>>> plant(pendulum, inputs={"u0": "0"}, initial={"x0": 1, "x1": 0})["dynamics"]
{'x0': 'x1', 'x1': '(-sin(x0)) + u0'}
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np

from hgorun.config.nearest import among, listed, nearest
from hgorun.config.types import describe
from hgorun.errors import ConfigError, HgorunError
from hgorun.export.equations import compares, outputs_of, symbolic
from hgorun.interop.text import texts
from hgorun.interop.traced import NotTraced, traced
from hgorun.observers.base import DecidedObserver
from hgorun.observers.capabilities import NotExported
from hgorun.observers.recalling import RecallingObserver
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare

if TYPE_CHECKING:
    from control import NonlinearIOSystem


class ObserverSystem(NamedTuple):
    """An observer as a system of python-control, and where it starts.

    Attributes
    ----------
    system : control.NonlinearIOSystem
        Inputs: the plant's outputs, then its inputs, by their names; outputs: ``x1_hat``, ... of every state.
    start : ndarray, shape (states,)
    """

    system: NonlinearIOSystem
    start: np.ndarray


def plant(
    system: NonlinearIOSystem,
    *,
    inputs: Mapping[str, str | float] | Sequence[str | float] | None = None,
    initial: Mapping[str, float] | Sequence[float] | np.ndarray | None = None,
    states: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
) -> dict[str, Any]:
    """A continuous system as the block ``plant`` of an experiment, with its equations written out.

    A ``StateSpace`` is taken by its matrices. Of another ``NonlinearIOSystem`` the functions are called once with
    symbols: they may be of arithmetic and functions of numpy. What was found so is compared with the functions at
    random places. Numbers among its parameters stay parameters.

    Parameters
    ----------
    system : control.StateSpace or control.NonlinearIOSystem
    inputs : mapping of str to str or float, or sequence, optional
        Name: expression of t, for every input; or the expressions in the order of the inputs.
    initial : mapping of str to float, or sequence, optional
        The initial value of every state (default: 0), or all of them in the order of the states. Names may be those of
        the system, such as ``x[0]``.
    states, outputs : sequence of str, optional
        Their names; by default those of the system, with ``x0`` for ``x[0]``.

    Raises
    ------
    ConfigError
        When it is no such system, is discrete, or its functions cannot be followed by symbols; the message says why.

    Examples
    --------
    >>> block = plant(control.ss([[0, 1], [-1, -2]], [[0], [1]], [[1, 0]], 0), inputs={"u0": "sin(t)"})
    >>> experiment = hgorun.Experiment({"plant": block, "time": ..., "observers": ...})
    """
    package = _package()
    if isinstance(system, package.TransferFunction):
        raise ConfigError("a TransferFunction has no states: control.ss makes a StateSpace of it, which is a plant")
    if not isinstance(system, package.NonlinearIOSystem):
        found_type = type(system).__name__
        raise ConfigError(f"expected a StateSpace or NonlinearIOSystem of python-control, found {found_type}")
    if system.dt:
        raise ConfigError(
            f"{system.name} is discrete (dt = {system.dt}); plants are continuous here, and sampling belongs to the "
            "measurement"
        )
    if not system.nstates or not system.noutputs:
        raise ConfigError(f"{system.name} has no states or no outputs")
    names_of = {
        "states": list(states or map(_name, system.state_labels)),
        "outputs": list(outputs or map(_name, system.output_labels)),
        "inputs": list(map(_name, system.input_labels)),
    }
    for what, count in (("states", system.nstates), ("outputs", system.noutputs)):
        if len(names_of[what]) != count:
            raise ConfigError(f"{what}: {system.name} has {count} of them, found {len(names_of[what])} names")
    parameters = {key: float(value) for key, value in system.params.items() if _is_number(value)}
    try:
        found = traced(package, system, parameters)
    except NotTraced:
        if not parameters:
            raise
        parameters = {}  # one of them may decide how many terms there are
        found = traced(package, system, parameters)
    names = [["t"], names_of["states"], names_of["inputs"], list(parameters)]
    try:
        right = texts(ca.Function("f", found.arguments, [found.dynamics]), names)
        measured = texts(ca.Function("h", found.arguments, [found.output]), names)
    except ValueError as error:
        raise ConfigError(f"{system.name}: {error}") from None
    block: dict[str, Any] = {
        "states": names_of["states"],
        "dynamics": dict(zip(names_of["states"], right, strict=True)),
        "output": dict(zip(names_of["outputs"], measured, strict=True)),
        "initial": dict.fromkeys(names_of["states"], 0.0)
        | _by_name("initial", initial, system.state_labels, names_of["states"]),
    }
    if system.ninputs:
        block["inputs"] = _by_name("inputs", inputs, system.input_labels, names_of["inputs"])
    elif inputs is not None and len(inputs):
        raise ConfigError(f"{system.name} has no inputs")
    used = {name for text in (*right, *measured) for name in re.findall(r"[A-Za-z_]\w*", text)}
    if kept := {name: value for name, value in parameters.items() if name in used}:
        block["parameters"] = kept
    return block


def _name(label: str) -> str:
    """A label of python-control as a name: ``x0`` of ``x[0]``."""
    return re.sub(r"\W+", "", label.replace("[", "").replace("]", ""))


def _by_name(what: str, given: object, labels: Sequence[str], names: Sequence[str]) -> dict[str, Any]:
    """What is given by names, by those of the system, or in their order.

    Raises
    ------
    ConfigError
    """
    if given is None:
        return {}
    if isinstance(given, Mapping):
        name_of = dict(zip(labels, names, strict=True))
        named = {str(name_of.get(key, key)): value for key, value in given.items()}
        for key in named:
            if key not in names:
                raise ConfigError(f"{what}: unknown name {key!r}; known here: {among(key, names)}")
        return named
    values = given.ravel().tolist() if isinstance(given, np.ndarray) else given
    if not isinstance(values, (list, tuple)) or len(values) != len(names):
        found = f"{len(values)} of them" if isinstance(values, (list, tuple)) else describe(values)
        raise ConfigError(
            f"{what}: expected a mapping of names, or a list with a value for each of {', '.join(names)}; found {found}"
        )
    return dict(zip(names, values, strict=True))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.floating, np.integer)) and not isinstance(value, bool)


def observer(experiment: Experiment, label: str) -> ObserverSystem:
    """An observer of an experiment as a system of python-control.

    Parameters
    ----------
    experiment : Experiment
        Its outputs are continuous and not late: noise and the plant are of no account here.
    label : str
        Of the observer.

    Raises
    ------
    ConfigError
        Where there is no such observer, or it is no differential equation between outputs and estimates: when it jumps
        at samples, decides at the ends of steps, or looks back.

    Examples
    --------
    >>> system, start = observer(hgorun.load("pendulum.yaml"), "SHGO")
    >>> xhat = control.input_output_response(system, time, y, start).outputs
    """
    package = _package()
    if label not in experiment.observers:
        near = nearest(label, experiment.observers)
        raise ConfigError(f"no observer is called {label!r}.{near} Known: {listed(experiment.observers, label)}")
    run = prepare(experiment)
    design, model = experiment.designs[label], run.plant.model
    outputs = outputs_of(experiment.stretches, run.plant, [False] * len(model.outputs))
    block = design.observer
    if not compares(block) or isinstance(block, (DecidedObserver, RecallingObserver, NotExported)):
        raise ConfigError(
            f"{block.type} is not a differential equation alone: it jumps at samples, decides at the ends of steps or "
            "looks back, which a continuous system of python-control does not",
            key=f"observers.{label}",
        )
    if any(output.sampled or output.delay is not None for output in outputs):
        raise ConfigError(
            "the observer's outputs are sampled or late; a system of python-control has continuous ones: leave "
            "sampling and delay out",
            key="measurement",
        )
    m, q = len(model.inputs), len(model.outputs)
    found = symbolic(design, run.plant, outputs, run.origin, told=tuple(range(m)))
    t, p, z, w = found.arguments
    y, u = ca.SX.sym("y", q), ca.SX.sym("u", m)
    innovation = found.outputs["guess"] - y  # as observers are written: estimated minus measured
    if model.periods:
        innovation = ca.vertcat(*[model.wrapped(i, innovation[i]) for i in range(q)])
    told = ca.vertcat(u, ca.SX.zeros(m), innovation, ca.SX.zeros(z.numel()))
    results = [found.outputs["rate"], found.outputs["estimate"]]
    # the guess holds inputs itself: they are replaced after it
    results = [ca.substitute(one, w, told) for one in results]
    results = [ca.substitute(one, w[:m], u) for one in results] if m else results
    function = ca.Function("observer", [t, z, y, u, p], results)
    values, origin = found.values, run.origin

    def rate(time: float, state: np.ndarray, given: np.ndarray, _: object) -> np.ndarray:
        return np.asarray(function(time - origin, state, given[:q], given[q:], values)[0]).ravel()

    def estimate(time: float, state: np.ndarray, given: np.ndarray, _: object) -> np.ndarray:
        return np.asarray(function(time - origin, state, given[:q], given[q:], values)[1]).ravel()

    names = [f"z[{k}]" for k in range(z.numel())]
    system = package.NonlinearIOSystem(
        rate,
        estimate,
        inputs=[*model.outputs, *model.inputs],
        outputs=[f"{state}_hat" for state in model.states],
        states=names,
        name=label,
    )
    start = design.initial(run.plant, has_alpha="alpha" in found.block.states, recorded=run.recorded)
    return ObserverSystem(system, start)


def _package() -> ModuleType:
    try:
        import control
    except ImportError as error:
        raise HgorunError("this needs the package python-control: pip install 'hgorun[control]'") from error
    found: ModuleType = control
    return found
