"""Trajectories against two references: the plain simulator in naive.py step by step, and DOP853.

The plain simulator makes the same steps, so the differences are rounding (1e-12); DOP853 makes its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from examples import prepared, run
from naive import Field, Vector, binomial_gains, saturated
from naive import simulate as plainly
from scipy.integrate import solve_ivp

from hgorun import Result
from hgorun.measurement.chance import generator

THETA, STEP = 1.5, 0.04
CLOSE = 1e-9  # to the plain simulator: the same steps, other roundings


# ---- plants: a block of the configuration, and the same by hand ----


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


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENARIOS)
def test_every_measurement(name: str, tmp_path: Path) -> None:
    check(tmp_path, VAN_DER_POL, SCENARIOS[name])


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["varying delay", "sampled, out of order"])
@pytest.mark.parametrize("name", [name for name in MODELS if name != "van der pol"])
def test_every_plant(name: str, scenario: str, tmp_path: Path) -> None:
    check(tmp_path, MODELS[name], SCENARIOS[scenario])


# ---- what needs more than a table ----


@pytest.mark.slow
def test_start_away_from_zero(tmp_path: Path) -> None:
    """Samples, holds and delays count from the start; functions of time do not."""

    def late_held(t: float, mid: float) -> float:
        return held(t, mid - 5)

    def lag(t: float) -> float:
        return 0.25 + 0.1 * np.sin(2 * t)

    scenarios: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"sampling": {"period": 0.25}, "noise": COUNTED, "delay": MIXED}, sampled(5 + EVERY, delay=mixed)),
        ({"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}, {"delay": lag, "noise": sine}),
        ({"noise": HELD}, {"noise": late_held, "events": 5 + np.array(HOLD_CHANGES)}),
    ]
    time = {"start": 5, "end": 8, "output_step": 0.037}
    for block, options in scenarios:
        result = run(tmp_path, configuration(VAN_DER_POL, block, time=time))
        options = options | {"t0": 5.0, "t_end": 8.0}
        assert difference_to_plain(result, VAN_DER_POL, options) < CLOSE


@pytest.mark.costly
def test_jitter_and_dropout(tmp_path: Path) -> None:
    """Which samples come, and when, is read from the result; the rest follows."""
    sampling = {"period": 0.1, "offset": 0.05, "jitter": 0.04, "dropout": 0.3}
    block = {"sampling": sampling, "noise": DRAWN, "delay": "0.15 + 0.1*sin(9*t)"}
    result = run(tmp_path, configuration(VAN_DER_POL, block), "seed=3")
    times = result.measurements.time
    number = np.rint((times - 0.05) / 0.1).astype(int)
    moved = np.abs(times - 0.05 - 0.1 * number)
    assert 0.03 < moved.max() <= 0.04
    assert np.all(np.diff(number) > 0)
    assert 15 <= len(number) <= 26  # of 30
    gauss, flat = (generator(3, "noise", "x1/0", i) for i in range(2))
    count = number[-1] + 1  # a lost sample has its draw too
    noise = gauss.normal(0, 1, count) * 0.1 + flat.uniform(-0.1, 0.2, count)
    options: dict[str, Any] = {"sampling": times, "noise": noise[number], "delay": lambda t: 0.15 + 0.1 * np.sin(9 * t)}
    assert difference_to_plain(result, VAN_DER_POL, options) < CLOSE


@pytest.mark.parametrize("name", ["sampled", "varying delay", "continuous, held"])
def test_initial_filter_state_gains_and_theta(name: str, tmp_path: Path) -> None:
    eta0, gains = [0.3, -0.2], [3.0, 4.0, 2.5, 1.0]
    scenario = SCENARIOS[name]
    config = configuration(VAN_DER_POL, scenario.block)
    config["observers"] = {"F": {"type": "fhgo2", "r": 2, "theta": 2.2, "gains": gains, "internal": {"eta": eta0}}}
    result = run(tmp_path, config)
    common: dict[str, Any] = {"theta": 2.2, "gains": gains, "r": 2, "eta0": eta0, "t_end": END, "step": STEP}
    model = replace(VAN_DER_POL, xhat0=[0.0, 0.0])
    options = common | scenario.options | {"output_times": result.time}
    plain = plainly(model.f, model.h, model.copy, model.x0, model.xhat0, **options)
    np.testing.assert_allclose(result.observers["F"].xhat, plain["xhat"], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(result.observers["F"].internal["eta"], plain["eta"], rtol=0, atol=CLOSE)
    assert np.array_equal(result.observers["F"].internal["eta"][0], eta0)


@pytest.mark.costly
@pytest.mark.parametrize("is_sampled", [False, True])
def test_jumping_input(is_sampled: bool, tmp_path: Path) -> None:
    """From jump to jump by the plain simulator, started again each time; a sample arrives at every jump."""

    def field(u: float) -> Field:
        return lambda t, x: van_der_pol_copy(t, x) + np.array([0.0, u])

    block = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "0.5*(1 - x1**2)*x2 - x1 + u"},
        "output": "x1",
        "inputs": {"u": "sign(sin(pi*t/0.6))"},
        "initial": {"x1": 1, "x2": 0.5},
    }
    model = replace(VAN_DER_POL, block=block)
    period = 0.15
    measurement = {"sampling": {"period": period}, "noise": SINE} if is_sampled else {"noise": SINE}
    time = {"end": END, "output_step": 0.05}
    result = run(tmp_path, configuration(model, measurement, time=time))
    for label, r in [("S", 0), ("F0", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
        x, xhat, eta = np.array(model.x0), np.array(model.xhat0), np.zeros(r)
        for piece in range(5):
            t0, t1, u = 0.6 * piece, 0.6 * (piece + 1), (-1.0) ** piece
            rows = slice(12 * piece, 12 * piece + 13)
            options: dict[str, Any] = {"theta": THETA, "gains": 1.0, "step": STEP, "t0": t0, "t_end": t1, "eta0": eta}
            arrivals = t0 + period * np.arange(4)
            seen = {"sampling": arrivals, "noise": [sine(t) for t in arrivals]} if is_sampled else {"noise": sine}
            options |= seen | {"output_times": np.clip(result.time[rows], t0, t1)}
            plain = plainly(field(u), model.h, field(u), x, xhat, r=r, **options)
            np.testing.assert_allclose(result.x[rows], plain["x"], rtol=0, atol=CLOSE)
            np.testing.assert_allclose(result.observers[label].xhat[rows], plain["xhat"], rtol=0, atol=CLOSE)
            x, xhat, eta = plain["x"][-1], plain["xhat"][-1], plain["eta"][-1]


@pytest.mark.costly
def test_two_outputs_of_two_separate_plants(tmp_path: Path) -> None:
    """Each output has its own measurement; an observer of both is two observers of one."""
    block = {
        "states": ["a1", "a2", "b1", "b2", "b3"],
        "dynamics": {
            "a1": "a2",
            "a2": "0.5*(1 - a1**2)*a2 - a1",
            "b1": "b2",
            "b2": "b3",
            "b3": "-b1 - 2*b2 - tanh(b3) + u*b1",
        },
        "output": ["a1", "b1"],
        "inputs": {"u": "cos(2*t)"},
        "initial": {"a1": 1, "a2": 0.5, "b1": 1, "b2": -0.5, "b3": 0.3},
    }
    first, second = replace(VAN_DER_POL, f=van_der_pol_copy), INTEGRATORS
    model = Model(block, first.f, first.f, [], first.xhat0 + second.xhat0)
    a = {"sampling": {"times": IRREGULAR.tolist()}, "noise": COUNTED, "delay": MIXED}
    b = {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}
    config = configuration(model, {"outputs": {"a1": a, "b1": b}})
    result = run(tmp_path, config)
    # All steps land on the events of both; those that the delay repeats, the plain simulator finds by itself.
    all_events = prepared(tmp_path, config).schedule.events
    samples = [*IRREGULAR, *(t - mixed(t) for t in IRREGULAR)]
    late: dict[str, Any] = {"delay": lambda t: 0.25 + 0.1 * np.sin(2 * t), "noise": sine, "events": samples}
    parts = [
        (first, slice(0, 2), 0, sampled(IRREGULAR, delay=mixed, events=all_events)),
        (second, slice(2, 5), 1, late),
    ]
    for part, states, column, options in parts:
        for label, r in [("S", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
            common: dict[str, Any] = {"theta": THETA, "gains": 1.0, "t_end": END, "step": STEP, "r": r}
            common |= options | {"output_times": result.time}
            plain = plainly(part.f, part.h, part.copy, part.x0, part.xhat0, **common)
            found = result.observers[label]
            np.testing.assert_allclose(found.xhat[:, states], plain["xhat"], rtol=0, atol=CLOSE)
            if r:
                eta = found.internal["eta"].reshape(-1, r, 2)[:, :, column]
                np.testing.assert_allclose(eta, plain["eta"], rtol=0, atol=CLOSE)
    np.testing.assert_allclose(result.x[:, 2:], plain["x"], rtol=0, atol=CLOSE)
    seen = result.measurements
    is_sample = ~np.isnan(seen.y[:, 0])
    np.testing.assert_array_equal(seen.time[is_sample], IRREGULAR)
    np.testing.assert_array_equal(seen.time[~np.isnan(seen.y[:, 1])], result.time)


@pytest.mark.parametrize(
    "measurement",
    [{"noise": SINE}, PERIODIC | {"delay": MIXED}, {"delay": "0.25 + 0.1*sin(2*t)", "noise": SINE}],
    ids=["continuous", "sampled", "delayed"],
)
def test_canonical_coordinates_are_the_original_ones_seen_through_the_map(
    measurement: dict[str, Any], tmp_path: Path
) -> None:
    config = configuration(CONTOIS, measurement, solver={"step": 0.002})
    original = run(tmp_path, config)
    for block in config["observers"].values():
        block["coordinates"] = "canonical"
    canonical = run(tmp_path, config)
    for label, found in canonical.observers.items():
        np.testing.assert_allclose(found.xhat, original.observers[label].xhat, rtol=0, atol=1e-9)


@pytest.mark.costly
def test_recorded_continuous_measurements(tmp_path: Path) -> None:
    """Of what time they speak, and the noisy value, on the output grid."""
    for name, scenario in SCENARIOS.items():
        if "sampling" in scenario.options:
            continue
        result = run(tmp_path, configuration(VAN_DER_POL, scenario.block))
        seen, options = result.measurements, scenario.options
        lag = options.get("delay", 0.0)
        lags = np.array([lag(t) for t in result.time]) if callable(lag) else lag
        taken = np.maximum(result.time - lags, 0)
        np.testing.assert_array_equal(seen.time, result.time)
        np.testing.assert_allclose(seen.taken[:, 0], taken, rtol=0, atol=1e-15)
        past = solve_ivp(VAN_DER_POL.f, (0, END), VAN_DER_POL.x0, dense_output=True, rtol=1e-11, atol=1e-12).sol(taken)[
            0
        ]
        v = np.array([options["noise"](t, t) for t in result.time])
        noisy = past * (1 + v) if options.get("multiplicative") else past + v
        np.testing.assert_allclose(seen.y[:, 0], noisy, rtol=0, atol=1e-6, err_msg=name)


@pytest.mark.costly
def test_signal_to_noise_ratio(tmp_path: Path) -> None:
    """20 dB: the variance of the noise is a hundredth of the mean square of the output over the run."""
    noise = [{"type": "gaussian", "snr_db": 20}]
    config = configuration(VAN_DER_POL, {"sampling": {"period": 0.2}, "noise": noise})
    config["time"] = {"end": END, "output_step": 0.01}
    for solver in ({"step": 0.01}, {}):
        result = run(tmp_path, config | {"solver": solver})
        y = result.y[:, 0]
        mean_square = np.trapezoid(y**2, result.time) / END
        draws = generator(0, "noise", "x1/0", 0).normal(0, 1, 16)
        np.testing.assert_allclose(result.measurements.y[:, 0] - y[::20], draws * np.sqrt(mean_square / 100), rtol=1e-4)


# ---- against DOP853 ----


class Exact:
    """The observer's equations by DOP853, with all of the past kept: also for phases of measurement."""

    def __init__(self, model: Model, r: int) -> None:
        self.model, self.r, self.n = model, r, len(model.x0)
        self.gain = np.array(binomial_gains(r + self.n))
        self.t, self.z = 0.0, np.concatenate([model.x0, model.xhat0, np.zeros(r + 1)])
        self.pieces: list[Any] = []
        self.start = self.z

    def split(self, z: Vector) -> tuple[Vector, Vector, Vector, Any]:
        return z[: self.n], z[self.n : 2 * self.n], z[2 * self.n : -1], z[-1]

    def rates(self, t: float, z: Vector, e: float) -> Vector:
        model, r = self.model, self.r
        x, xhat, eta, _ = self.split(z)
        kappa = THETA ** np.arange(1, self.n + 1) * self.gain[r:] * (eta[0] if r else e)
        correction = kappa if model.jinv is None else model.jinv(xhat) @ kappa
        eta_rate = THETA * (np.append(eta[1:], e) - self.gain[:r] * eta[0]) if r else []
        return np.concatenate([model.f(t, x), model.copy(t, xhat) - correction, eta_rate, [-kappa[0]]])

    def past(self, t: float) -> Vector:
        """z(t), constant before the start."""
        if t <= 0 or not self.pieces:
            return self.start
        return next(p for p in reversed(self.pieces) if p.t_min <= t or p is self.pieces[0])(t)

    def s_minus_y(self, t: float) -> float:
        x, xhat, _, alpha = self.split(self.past(t))
        return self.model.h(xhat) - alpha - self.model.h(x)

    def go(self, end: float, innovation: Callable[[float, Vector], float]) -> None:
        """On to ``end`` with e = innovation(t, z)."""
        piece = solve_ivp(
            lambda t, z: self.rates(t, z, innovation(t, z)),
            (self.t, end),
            self.z,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            dense_output=True,
        )
        self.pieces.append(piece.sol)
        self.t, self.z = end, piece.y[:, -1]

    def hold(self, end: float, held: float) -> None:
        self.go(end, lambda t, z: held + z[-1])

    def continuous(self, end: float, v: Callable[[float], float]) -> None:
        def innovation(t: float, z: Vector) -> float:
            x, xhat, _, _ = self.split(z)
            return self.model.h(xhat) - self.model.h(x) - v(t)

        self.go(end, innovation)

    def sampled(self, end: float, period: float, delay: float, v: Callable[[float], float]) -> None:
        """Samples from now on."""
        count = round((end - self.t) / period)
        for arrival in self.t + period * np.arange(count):
            held = self.s_minus_y(arrival - delay) - v(arrival)
            self.hold(min(arrival + period, end), held)

    def delayed(self, end: float, delay: float, v: Callable[[float], float], stops: Sequence[float]) -> None:
        """Constant delay; ``stops`` are no further apart than it."""
        for stop in [*stops, end]:
            self.go(stop, lambda t, z: self.s_minus_y(t - delay) + z[-1] - v(t))

    def at(self, times: Vector) -> tuple[Vector, Vector, Vector]:
        x, xhat, eta, _ = self.split(np.array([self.past(t) for t in times]).T)
        return x.T, xhat.T, eta.T


def assert_near(result: Result, exact: Exact, label: str, tolerance: float) -> None:
    x, xhat, eta = exact.at(result.time)
    found = result.observers[label]
    np.testing.assert_allclose(result.x, x, rtol=0, atol=tolerance)
    np.testing.assert_allclose(found.xhat, xhat, rtol=0, atol=tolerance)
    if exact.r:
        np.testing.assert_allclose(found.internal["eta"], eta, rtol=0, atol=tolerance)


PRECISE = {"method": "dopri5", "rtol": 1e-10, "atol": 1e-12}


@pytest.mark.slow
@pytest.mark.parametrize("model", [VAN_DER_POL, CONTOIS, CURVED_OUTPUT], ids=["vdp", "contois", "curved"])
@pytest.mark.parametrize("is_sampled", [False, True])
def test_adaptive_steps_against_dop853(model: Model, is_sampled: bool, tmp_path: Path) -> None:
    measurement = {"sampling": {"period": 0.5}, "noise": SINE} if is_sampled else {"noise": SINE}
    result = run(tmp_path, configuration(model, measurement, solver=PRECISE))
    for label, r in [("S", 0), ("F1", 1), ("F2", 2), ("F3", 3)]:
        exact = Exact(model, r)
        if is_sampled:
            exact.sampled(END, 0.5, 0.0, sine)
        else:
            exact.continuous(END, sine)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [PRECISE, {"step": 0.002}], ids=["dopri5", "rk4"])
@pytest.mark.parametrize("model", [VAN_DER_POL, CONTOIS], ids=["vdp", "contois"])
def test_phases(model: Model, solver: dict[str, Any], tmp_path: Path) -> None:
    """Continuous, then sampled and late, then continuous and late, then sampled again: the past is one."""
    phases = [
        {"until": 0.8, "sampling": "continuous", "delay": 0},
        {"until": 1.6, "sampling": {"period": 0.2}, "delay": 0.3},
        {"until": 2.4, "sampling": "continuous", "delay": 0.3},
        {"until": END, "sampling": {"period": 0.2}, "delay": 0.5},
    ]
    result = run(tmp_path, configuration(model, {"noise": SINE, "phases": phases}, solver=solver))
    for label, r in [("S", 0), ("F1", 1), ("F3", 3)]:
        exact = Exact(model, r)
        exact.continuous(0.8, sine)
        exact.sampled(1.6, 0.2, 0.3, sine)
        exact.delayed(2.4, 0.3, sine, [1.7, 1.9, 2.0, 2.1, 2.2, 2.3])
        exact.sampled(END, 0.2, 0.5, sine)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.costly
def test_phases_begin_in_silence(tmp_path: Path) -> None:
    """A sampled phase after a continuous one has no innovation until its first sample."""
    phases = [{"until": 1, "noise": SINE}, {"until": END, "sampling": {"times": [1.5, 2.0]}, "noise": SINE}]
    result = run(tmp_path, configuration(VAN_DER_POL, {"phases": phases}, solver={"step": 0.002}))
    for label, r in [("S", 0), ("F2", 2)]:
        exact = Exact(VAN_DER_POL, r)
        exact.continuous(1.0, sine)
        exact.go(1.5, lambda t, z: 0.0)
        exact.sampled(2.5, 0.5, 0.0, sine)
        held = exact.s_minus_y(2.0) - sine(2.0)
        exact.hold(END, held)
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("solver", [PRECISE, {"step": 0.005}], ids=["dopri5", "rk4"])
def test_delay_that_grows_from_zero(solver: dict[str, Any], tmp_path: Path) -> None:
    """d = 0.2 t looks into the step being made. The reference: passes, each told the past by the last."""
    config = configuration(VAN_DER_POL, {"delay": "0.2*t", "noise": SINE}, solver=solver)
    config["time"] = {"end": 1.5, "output_step": 0.037}
    result = run(tmp_path, config)

    def told_by(earlier: Exact) -> Callable[[float, Vector], float]:
        return lambda t, z: earlier.s_minus_y(0.8 * t) + z[-1] - sine(t)

    for label, r in [("S", 0), ("F2", 2)]:
        earlier = Exact(VAN_DER_POL, r)
        earlier.continuous(1.5, sine)
        for _ in range(14):
            exact = Exact(VAN_DER_POL, r)
            exact.go(1.5, told_by(earlier))
            earlier = exact
        assert_near(result, exact, label, 1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    "delay",
    ["0.1*(1 - cos(2*t))", "0.15 + 0.15*sin(2*t)", "0.3*abs(sin(2*t))", "max(0, 0.3*sin(2*t))", "0.0004"],
)
def test_vanishing_delay_against_a_finer_step(delay: Any, tmp_path: Path) -> None:
    config = configuration(VAN_DER_POL, {"delay": delay, "noise": SINE})
    coarse = run(tmp_path, config, "solver.step=0.01")
    fine = run(tmp_path, config, "solver.step=0.001")
    precise = run(tmp_path, config | {"solver": PRECISE})
    for label, found in fine.observers.items():
        assert found.diverged_at is None
        np.testing.assert_allclose(coarse.observers[label].xhat, found.xhat, rtol=0, atol=1e-6)
        np.testing.assert_allclose(precise.observers[label].xhat, found.xhat, rtol=0, atol=1e-8)


# ---- events that differ by a rounding error ----


def gap(a: Result, b: Result) -> float:
    return max(float(np.abs(a.observers[k].xhat - b.observers[k].xhat).max()) for k in a.observers)


def test_a_phase_begins_at_an_event_that_is_a_rounding_error_earlier(tmp_path: Path) -> None:
    """1.4 - 0.8 < 0.6: the sample that arrives at 1.4 was taken just before the phase change at 0.6."""

    def config(delay: float) -> dict[str, Any]:
        second = {"until": END, "sampling": {"period": 0.2}, "delay": delay, "noise": SINE}
        return configuration(VAN_DER_POL, {"phases": [{"until": 0.6, "noise": SINE}, second]})

    assert 0.6 + 4 * 0.2 - 0.8 < 0.6
    assert gap(run(tmp_path, config(0.8)), run(tmp_path, config(0.8 - 1e-8))) < 1e-6


def test_the_first_sample_arrives_a_rounding_error_after_an_event(tmp_path: Path) -> None:
    """0.1 + 0.2 > 0.3, where the disturbance has a kink."""
    disturbance = {"x2": "0.2*abs(0.3 - t)"}
    model = replace(VAN_DER_POL, block=VAN_DER_POL.block | {"disturbance": disturbance})

    def config(offset: float | str) -> dict[str, Any]:
        return configuration(model, {"sampling": {"period": 1, "offset": offset}})

    assert gap(run(tmp_path, config("0.1+0.2")), run(tmp_path, config(0.3 + 1e-8))) < 1e-6


def test_a_listed_sample_at_the_beginning_of_a_phase_belongs_to_it(tmp_path: Path) -> None:
    def times(until: str) -> Vector:
        phases = [{"until": until}, {"until": END, "sampling": {"times": [0.6, 1.6]}}]
        return run(tmp_path, configuration(VAN_DER_POL, {"phases": phases})).measurements.time

    assert 0.1 * 6 > 0.6
    np.testing.assert_allclose(times("0.1*6")[-2:], [0.6, 1.6], rtol=0, atol=1e-15)


def test_a_jump_that_rounding_moves_off_its_event(tmp_path: Path) -> None:
    """sin(pi (t + 1000)) changes sign some hundred ulp beside the integers, where samples arrive."""
    block = {"type": "integrator_chain", "n": 2, "phi": "u", "initial": {"x1": 0, "x2": 0}}
    block["inputs"] = {"u": "sign(sin(pi*(t + 1000)))"}
    model = Model(block, van_der_pol_copy, van_der_pol_copy, [], [0.1, 0.1])
    result = run(tmp_path, configuration(model, {"sampling": {"period": 0.5}}, solver={"step": 0.1}))
    t = result.time
    speed = np.where(t < 1, t, np.where(t < 2, 2 - t, t - 2))
    np.testing.assert_allclose(result.x[:, 1], speed, rtol=0, atol=1e-11)
