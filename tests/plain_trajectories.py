"""Plants and measurements twice: as blocks of a configuration, and by hand for the plain simulator in naive.py."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from examples import run
from naive import Field, Vector, saturated
from naive import simulate as plainly

from hgorun import Result
from hgorun.measurement.chance import generator

THETA, STEP = 1.5, 0.04
CLOSE = 1e-9  # to the plain simulator: the same steps, other roundings


@dataclass(frozen=True)
class Model:
    """A plant as YAML and as Python; ``jinv`` is J^-1 of its observability map, None for a chain."""

    block: dict[str, Any]
    f: Field
    copy: Field  # f without the disturbance
    x0: list[float]
    xhat0: list[float]
    h: Callable[[np.ndarray], float] = lambda x: x[0]
    jinv: Callable[[np.ndarray], np.ndarray] | None = None
    dh: Callable[[np.ndarray], np.ndarray] | None = None
    kinks: tuple[float, ...] = ()  # of f, in time
    observer: dict[str, Any] = field(default_factory=dict)  # more keys of every observer

    @property
    def states(self) -> list[str]:
        return list(self.block["initial"])


def van_der_pol_copy(t: float, x: Vector) -> Vector:
    return np.array([x[1], 0.5 * (1 - x[0] ** 2) * x[1] - x[0]])


VAN_DER_POL = Model(
    {"type": "van_der_pol", "initial": {"x1": 1, "x2": 0.5}, "disturbance": {"x2": "0.2*sin(0.7*t)"}},
    lambda t, x: van_der_pol_copy(t, x) + np.array([0.0, 0.2 * np.sin(0.7 * t)]),
    van_der_pol_copy,
    [1.0, 0.5],
    [0.2, -0.3],
)


def contois(rate: Callable[[float], float]) -> Field:
    def f(t: float, x: Vector) -> Vector:
        g = 1.064 * x[0] * x[1] / (4.39 * x[0] + x[1])
        return np.array([g - rate(t) * x[0], -g + rate(t) * (20 - x[1])])

    return f


def contois_jinv(x: Vector) -> Vector:
    q = (4.39 * x[0] + x[1]) ** 2
    return np.linalg.inv([[1, 0], [1.064 * x[1] ** 2 / q, 1.064 * 4.39 * x[0] ** 2 / q]])


def contois_model(rate: Callable[[float], float], D: str, kinks: tuple[float, ...] = ()) -> Model:
    block = {"type": "contois", "inputs": {"D": D}, "initial": {"x1": 1.5, "x2": 15}}
    f = contois(rate)
    return Model(block, f, f, [1.5, 15.0], [1.0, 14.0], jinv=contois_jinv, kinks=kinks)


CONTOIS = contois_model(lambda t: 1.064 * (1 - np.sin(t) / 2), "mu*(1 - sin(t)/2)")
KINKED_CONTOIS = contois_model(
    lambda t: 1.064 * (1 - abs(np.sin(2 * t)) / 2),
    "mu*(1 - abs(sin(2*t))/2)",
    tuple(np.pi / 2 * np.arange(1, 5)),
)
INLINE_CONTOIS = replace(
    CONTOIS,
    block={
        "states": ["b", "s"],
        "dynamics": {"b": "mu*b*s/(k_c*b + s) - D*b", "s": "-mu*b*s/(k_c*b + s) + D*(s_in - s)"},
        "output": "b",
        "parameters": {"mu": 1.064, "k_c": 4.39, "s_in": 20},
        "inputs": {"D": "mu*(1 - sin(t)/2)"},
        "initial": {"b": 1.5, "s": 15},
    },
)


def integrators(t: float, x: Vector) -> Vector:
    return np.array([x[1], x[2], -x[0] - 2 * x[1] - np.tanh(x[2]) + np.cos(2 * t) * x[0]])


INTEGRATORS = Model(
    {
        "type": "integrator_chain",
        "n": 3,
        "phi": "-x1 - c*x2 - tanh(x3) + u*x1",
        "parameters": {"c": 2},
        "inputs": {"u": "cos(2*t)"},
        "initial": {"x1": 1, "x2": -0.5, "x3": 0.3},
    },
    integrators,
    integrators,
    [1.0, -0.5, 0.3],
    [0.2, 0.0, -0.4],
)


def chain_copy(t: float, x: Vector) -> Vector:
    return np.array([x[1] - 0.3 * x[0] ** 3, x[2] + x[0] * np.sin(t), -x[2] - np.sin(x[1])])


CHAIN = Model(
    {
        "states": ["p", "v", "a"],
        "dynamics": {"p": "v - 0.3*p**3", "v": "a + p*u", "a": "-a - sin(v)"},
        "output": "p",
        "inputs": {"u": "sin(t)"},
        "initial": {"p": 0.5, "v": 0.4, "a": -0.2},
        "disturbance": {"a": "0.3*cos(t)"},
    },
    lambda t, x: chain_copy(t, x) + np.array([0, 0, 0.3 * np.cos(t)]),
    chain_copy,
    [0.5, 0.4, -0.2],
    [0.0, 0.1, 0.1],
)


def triangular(t: float, x: Vector) -> Vector:
    u = 0.4 * np.sin(3 * t)
    return np.array([2 * x[1] + u * x[0], (2 + np.sin(x[0])) * x[2] - x[1], -x[0] - x[2] + u * x[1]])


def triangular_jinv(x: Vector) -> Vector:
    """z = (x_1, 2 x_2, 2 ((2 + sin x_1) x_3 - x_2)), the map of the drift."""
    return np.linalg.inv([[1, 0, 0], [0, 2, 0], [2 * np.cos(x[0]) * x[2], -2, 2 * (2 + np.sin(x[0]))]])


TRIANGULAR = Model(
    {
        "states": ["x1", "x2", "x3"],
        "dynamics": {"x1": "2*x2 + u*x1", "x2": "(2 + sin(x1))*x3 - x2", "x3": "-x1 - x3 + u*x2"},
        "output": "x1",
        "inputs": {"u": "0.4*sin(3*t)"},
        "initial": {"x1": 0.5, "x2": 0.2, "x3": -0.3},
    },
    triangular,
    triangular,
    [0.5, 0.2, -0.3],
    [0.3, 0.0, 0.1],
    jinv=triangular_jinv,
)


def gauge(w: Vector) -> tuple[float, float]:
    """The curved output h(w) = w_1 + w_1^3/10 and its slope."""
    return w[0] + w[0] ** 3 / 10, 1 + 0.3 * w[0] ** 2


def curved_jinv(w: Vector) -> Vector:
    """z = (h, h' w_2)."""
    slope = gauge(w)[1]
    return np.linalg.inv([[slope, 0], [0.6 * w[0] * w[1], slope]])


CURVED_OUTPUT = Model(
    {
        "states": ["a", "b"],
        "dynamics": {"a": "b", "b": "0.5*(1 - a**2)*b - a"},
        "output": "a + a**3/10",
        "initial": {"a": 0.8, "b": 0.5},
    },
    van_der_pol_copy,
    van_der_pol_copy,
    [0.8, 0.5],
    [0.1, 0.0],
    h=lambda w: gauge(w)[0],
    jinv=curved_jinv,
    dh=lambda w: np.array([gauge(w)[1], 0.0]),
)

BOX = {"x1": [-0.5, 0.6], "x2": [-0.4, 0.8]}
SATURATED = replace(
    VAN_DER_POL,
    copy=saturated(van_der_pol_copy, [(-0.5, 0.6), (-0.4, 0.8)]),
    observer={"saturation": BOX},
)


def saturated_contois(t: float, x: Vector) -> Vector:
    """f(w) + F(w) (x - w) at w = sat x: the x_2 that multiplies F = df_1/dx_2 is not saturated."""
    w = np.clip(x, [0.5, 5], [1.4, 12])
    slope = 1.064 * 4.39 * w[0] ** 2 / (4.39 * w[0] + w[1]) ** 2
    return CONTOIS.f(t, w) + np.array([slope * (x[1] - w[1]), 0])


SATURATED_CONTOIS = replace(CONTOIS, copy=saturated_contois, observer={"saturation": {"x1": [0.5, 1.4], "x2": [5, 12]}})

MODELS = {
    "contois": CONTOIS,
    "contois, kinked input": KINKED_CONTOIS,
    "contois, inline": INLINE_CONTOIS,
    "van der pol": VAN_DER_POL,
    "integrators": INTEGRATORS,
    "chain of three, inline": CHAIN,
    "triangular, inline": TRIANGULAR,
    "curved output": CURVED_OUTPUT,
    "saturated": SATURATED,
    "saturated contois": SATURATED_CONTOIS,
}


# ---- measurements: a block of the configuration, and the plain simulator's options for it ----

SINE = [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3}]}]
TWO_SINES = [
    {"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3, "phase": 0.4}]},
    {"type": "sinusoids", "terms": [{"amplitude": 0.05, "omega": 11}]},
]
COUNTED = [{"type": "expression", "value": "0.1*sin(3*t) + 0.02*(-1)**k"}]
DRAWN = [{"type": "gaussian", "std": 0.1}, {"type": "uniform", "low": -0.1, "high": 0.2}]
HELD = [
    {"type": "gaussian", "std": 0.1, "hold": 0.15},
    {"type": "uniform", "low": -0.1, "high": 0.2, "hold": 0.4},
]
END = 3.0


def sine(t: float, mid: float | None = None) -> float:
    return 0.1 * np.sin(3 * t)


def two_sines(t: float, mid: float | None = None) -> float:
    return 0.1 * np.sin(3 * t + 0.4) + 0.05 * np.sin(11 * t)


def counted(times: Vector) -> Vector:
    return 0.1 * np.sin(3 * times) + 0.02 * (-1.0) ** np.arange(len(times))


def drawn(times: Vector) -> Vector:
    """The draws of DRAWN in their order, one a sample."""
    gauss, flat = (generator(0, "noise", "x1/0", i) for i in range(2))
    return gauss.normal(0, 1, len(times)) * 0.1 + flat.uniform(-0.1, 0.2, len(times))


def held(t: float, mid: float) -> float:
    """The draws of HELD at ``mid``, inside the step's segment: its end does not see the next one."""
    gauss, flat = (generator(0, "noise", "x1/0", i) for i in range(2))
    first, second = gauss.normal(0, 1, 21) * 0.1, flat.uniform(-0.1, 0.2, 8)
    return first[int(mid / 0.15 + 1e-9)] + second[int(mid / 0.4 + 1e-9)]


HOLD_CHANGES = [*(0.15 * np.arange(1, 21)), *(0.4 * np.arange(1, 8))]
EVERY: npt.NDArray[Any] = 0.25 * np.arange(13)
LATER: npt.NDArray[Any] = 0.35 + 0.25 * np.arange(11)
IRREGULAR: Vector = np.array([0.0, 0.17, 0.2, 0.61, 1.05, 1.9, 2.2, 2.55])
MIXED = "where(sin(4*t) > 0, 0.55, 0.05)"  # makes later samples overtake earlier ones


def mixed(t: float) -> float:
    return 0.55 if np.sin(4 * t) > 0 else 0.05


@dataclass(frozen=True)
class Scenario:
    block: dict[str, Any]
    options: dict[str, Any]


def sampled(
    times: npt.NDArray[Any], noise: Callable[[Vector], Sequence[float] | Vector] = counted, **more: Any
) -> dict[str, Any]:
    return {"sampling": times, "noise": noise(times), **more}


PERIODIC = {"sampling": {"period": 0.25}, "noise": COUNTED}
SCENARIOS = {
    "continuous, sinusoids": Scenario({"noise": TWO_SINES}, {"noise": two_sines}),
    "continuous, expression": Scenario({"noise": [{"type": "expression", "value": "0.1*sin(3*t)"}]}, {"noise": sine}),
    "continuous, held": Scenario({"noise": HELD}, {"noise": held, "events": HOLD_CHANGES}),
    "continuous, multiplicative": Scenario(
        {"noise": SINE, "mode": "multiplicative"}, {"noise": sine, "multiplicative": True}
    ),
    "constant delay": Scenario({"delay": 0.3, "noise": SINE}, {"delay": 0.3, "noise": sine}),
    "constant delay, held": Scenario(
        {"delay": 0.2, "noise": HELD}, {"delay": 0.2, "noise": held, "events": HOLD_CHANGES}
    ),
    "varying delay": Scenario(
        {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE},
        {"delay": lambda t: 0.25 + 0.1 * np.sin(2 * t), "noise": sine},
    ),
    "varying delay, multiplicative": Scenario(
        {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE, "mode": "multiplicative"},
        {"delay": lambda t: 0.25 + 0.1 * np.sin(2 * t), "noise": sine, "multiplicative": True},
    ),
    "delay that runs backwards": Scenario(
        {"delay": "0.5 + 0.4*sin(5*t)", "noise": SINE},
        {"delay": lambda t: 0.5 + 0.4 * np.sin(5 * t), "noise": sine},
    ),
    "sampled": Scenario(PERIODIC, sampled(EVERY)),
    "sampled, drawn": Scenario(PERIODIC | {"noise": DRAWN}, sampled(EVERY, drawn)),
    "sampled, held": Scenario(PERIODIC | {"noise": HELD}, sampled(EVERY, lambda times: [held(t, t) for t in times])),
    "sampled, multiplicative": Scenario(PERIODIC | {"mode": "multiplicative"}, sampled(EVERY, multiplicative=True)),
    "sampled, offset": Scenario({"sampling": {"period": 0.25, "offset": 0.35}, "noise": COUNTED}, sampled(LATER)),
    "sampled, listed": Scenario({"sampling": {"times": IRREGULAR.tolist()}, "noise": COUNTED}, sampled(IRREGULAR)),
    "sampled, stepped": Scenario(
        {"sampling": {"steps": "0.1 + 0.05*k"}, "noise": COUNTED},
        sampled(np.concatenate([[0], np.cumsum(0.1 + 0.05 * np.arange(9))])),
    ),
    "sampled, constant delay": Scenario(PERIODIC | {"delay": 0.2}, sampled(EVERY, delay=0.2)),
    "sampled, long delay": Scenario(PERIODIC | {"delay": 0.9}, sampled(EVERY, delay=0.9)),
    "sampled, varying delay": Scenario(
        PERIODIC | {"delay": "0.4*abs(cos(7*t))"},
        sampled(EVERY, delay=lambda t: 0.4 * abs(np.cos(7 * t))),
    ),
    "sampled, out of order": Scenario(PERIODIC | {"delay": MIXED}, sampled(EVERY, delay=mixed)),
    "listed, out of order": Scenario(
        {"sampling": {"times": IRREGULAR.tolist()}, "noise": COUNTED, "delay": MIXED},
        sampled(IRREGULAR, delay=mixed),
    ),
}


def observers(model: Model, **more: Any) -> dict[str, Any]:
    """The standard observer as S, the filtered ones as F0 .. F3."""
    common: dict[str, Any] = {"theta": THETA, "initial": dict(zip(model.states, model.xhat0, strict=True))}
    common |= model.observer | more
    return {"S": {"type": "shgo", **common}} | {f"F{r}": {"type": "fhgo2", "r": r, **common} for r in range(4)}


def configuration(model: Model, measurement: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {
        "time": {"end": END, "output_step": 0.037},
        "plant": model.block,
        "measurement": measurement,
        "observers": observers(model),
        "solver": {"step": STEP},
    } | more


def difference_to_plain(result: Result, model: Model, options: dict[str, Any]) -> float:
    """Largest difference in x, xhat, eta and the samples, over all five observers."""
    common: dict[str, Any] = {"theta": THETA, "gains": 1.0, "t_end": END, "step": STEP, "output_times": result.time}
    common |= {"jinv": model.jinv, "dh": model.dh} | options
    common["events"] = [*common.get("events", ()), *model.kinks]
    worst = 0.0
    for label, r in [("S", 0), ("F0", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
        if label != "F0":  # the plain simulator has one and the same r = 0
            plain = plainly(model.f, model.h, model.copy, model.x0, model.xhat0, r=r, **common)
        gaps = [result.x - plain["x"], result.observers[label].xhat - plain["xhat"]]
        if r:
            gaps.append(result.observers[label].internal["eta"].reshape(plain["eta"].shape) - plain["eta"])
        if "taken" in plain:
            known = result.measurements
            np.testing.assert_allclose(known.time, options["sampling"], rtol=0, atol=1e-15)
            gaps += [known.taken[:, 0] - plain["taken"], known.y[:, 0] - plain["y"]]
        worst = max(worst, *(np.abs(gap).max() for gap in gaps))
    return worst


def check(folder: Path, model: Model, scenario: Scenario) -> None:
    result = run(folder, configuration(model, scenario.block))
    assert difference_to_plain(result, model, scenario.options) < CLOSE
