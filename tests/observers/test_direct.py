"""Direct reconstruction, dynamic gain and both, against a loop in plain numpy and the paper's example."""

from __future__ import annotations

from functools import cache
from typing import Any

import casadi as ca
import examples
import numpy as np
import pytest

import hgorun
from hgorun.errors import ConfigError
from hgorun.simulation.simulate import prepare

H, HOLD = 5e-5, 20
START = {"eta1": 0.05, "eta2": "0.05*0.01/(3*0.05 - 0.01)"}  # xhat(0) = (0.05, 0.01)
DYNAMIC: dict[str, Any] = {"l": [2, 1], "a": 1.17, "b": 2.3, "q": 0.15, "gamma": "4*y", "initial": START}
OBSERVERS: dict[str, dict[str, Any]] = {
    "(3)": {"type": "direct", "theta": 1, "l": [1, 0.5], "initial": START},
    "(13)": {"type": "direct", "theta": 1, "l": [1, 0.5], "mu": 50, "phi": 4000, "G": 1, "initial": START,
             "internal": {"z": [0.05, 0]}},
    "(7)": {"type": "dynamic_gain", **DYNAMIC},
    "(18)": {"type": "direct_dynamic", **DYNAMIC, "mu_0": 500, "phi": 4000, "G": 1,
             "internal": {"z": [0.05, 0]}},
    "x^d": {"type": "levant", "G": 1, "initial": {"eta1": 0.05, "eta2": 0}},
}  # fmt: skip
BIOREACTOR = {"type": "bioreactor_gauthier", "inputs": {"u": 0.08}, "initial": {"eta1": 0.05, "eta2": 0.05}}
NOISE = [{"type": "gaussian", "snr_db": 30, "hold": 1e-3}]


def experiment(observers: dict[str, Any], end: float, plant: dict[str, Any] = BIOREACTOR, **more: Any) -> Any:
    more = {"end": end, "output_step": 1e-3, "solver": {"method": "euler", "step": H}, **more}
    return examples.experiment(plant, observers, **more)


def naive(noise: np.ndarray) -> dict[str, np.ndarray]:
    """(21), (22) and the observers by Euler's method; noise (Nt, runs), a row a ms; x (Nt, 2, runs)."""
    u, runs = 0.08, noise.shape[1]

    def f(x: np.ndarray) -> np.ndarray:
        x1, x2 = x
        return np.array([x2 - u * x1, (0.1 * u / (3 * x1**2) + 2 / x1) * x2**2 - (3 + u + 0.2 * u / x1) * x2 + 0.3 * u])

    def column(*values: float) -> np.ndarray:
        return np.repeat(np.array(values)[:, None], runs, axis=1)

    def differentiated(z: np.ndarray, y: np.ndarray) -> np.ndarray:
        s = z[0] - y
        v0 = -1.5 * np.sqrt(np.abs(s)) * np.sign(s) + z[1]
        return np.asarray(z + H * np.array([v0, -1.1 * np.sign(z[1] - v0)]))

    eta, z = column(0.05, 0.05), column(0.05, 0)
    alone = column(0.05, -u * 0.05)  # the differentiator itself begins where its estimate is (0.05, 0)
    xs = {name: column(0.05, 0.01) for name in ("(3)", "(13)", "(7)", "(18)")}
    theta = {"(7)": np.ones(runs), "(18)": np.ones(runs)}
    a, b, q, phi = 1.17, 2.3, 0.15, 4000.0
    rows: dict[str, list[np.ndarray]] = {name: [] for name in ["truth", "x^d", *xs]}
    for v in noise:
        xd = np.array([alone[0], alone[1] + u * alone[0]])
        for name, x in {"truth": eta, "x^d": xd, **xs}.items():
            other = x[1] if name == "truth" else x[0] * x[1] / (3 * x[0] - x[1])
            rows[name].append(np.array([x[0], other]))
        for _ in range(HOLD):
            y, xd = eta[0] + v, np.array([z[0], z[1] + u * z[0]])
            rates = {}
            for name, x in xs.items():
                e, th = y - x[0], theta.get(name, np.ones(runs))
                l1, l2 = (1.0, 0.5) if name in ("(3)", "(13)") else (2.0, 1.0)
                w = {"(13)": np.exp(-50 * e**2), "(18)": np.exp(-500 / th ** (2 * b) * e**2)}.get(name, 1.0)
                gap = xd - x
                pull = np.array([l1, l2])[:, None] * gap[0] if name == "(13)" else np.array([gap[1], 0 * gap[1]])
                pull = pull + phi / 2 * th * gap
                rates[name] = f(x) + w * np.array([l1 * th * e, l2 * th**2 * e]) + (1 - w) * pull
                if name in theta:
                    decay = w * a + (1 - w) * phi
                    theta[name] = th - H * th / b * (decay / 3 * (th - 1) - 2 / np.sqrt(q) * 4 * y)
            z, alone = differentiated(z, y), differentiated(alone, y)
            g = 3 * eta[0] * eta[1] / (eta[0] + eta[1])
            eta = eta + H * np.array([g - u * eta[0], -g + (0.1 - eta[1]) * u])
            for name in xs:
                xs[name] = xs[name] + H * rates[name]
    return {name: np.array(values) for name, values in rows.items()}


@cache
def noisy_runs(end: float) -> list[hgorun.Result]:
    noise = {"noise": NOISE}
    return [hgorun.simulate(experiment(OBSERVERS, end, measurement=noise, seed=seed)) for seed in range(20)]


@pytest.mark.slow
def test_without_noise_the_paths_are_those_of_the_loop() -> None:
    result = hgorun.simulate(experiment(OBSERVERS, 0.5))
    expected = naive(np.zeros((501, 1)))
    np.testing.assert_allclose(result.x, expected["truth"][..., 0], rtol=1e-12)
    for name, observer in result.observers.items():
        np.testing.assert_allclose(observer.xhat, expected[name][..., 0], rtol=1e-9, err_msg=name)


@pytest.mark.slow
def test_with_the_same_draws_the_paths_are_those_of_the_loop() -> None:
    """20 seeds. Rounding could be amplified where a sign is near a change, but hardly is."""
    runs = noisy_runs(10.0)
    noise = np.stack([r.measurements.y[:501, 0] - r.y[:501, 0] for r in runs], axis=1)
    expected = naive(noise)
    for name in OBSERVERS:
        mine = np.stack([r.observers[name].xhat[:501] for r in runs], axis=-1)
        np.testing.assert_allclose(mine, expected[name], rtol=1e-7, atol=1e-9, err_msg=name)


@pytest.mark.costly
def test_integrated_error_of_the_papers_example() -> None:
    """J, the integral of |eta_2 - etahat_2| over 10 s, 20 seeds: reconstruction halves it."""
    runs = noisy_runs(10.0)
    J = {
        name: 10 * float(np.mean([np.abs(r.observers[name].xhat[:, 1] - r.x[:, 1]).mean() for r in runs]))
        for name in OBSERVERS
    }
    assert J["(3)"] == pytest.approx(0.0208, rel=0.03)
    assert J["(13)"] == pytest.approx(0.0117, rel=0.03)
    assert J["(18)"] < J["(13)"] < J["(7)"] < J["(3)"]


def test_the_blend_without_sharpness_is_the_observer_without_reconstruction() -> None:
    faint = {**OBSERVERS["(13)"], "mu": 1e-300}
    result = hgorun.simulate(experiment({"none": OBSERVERS["(3)"], "faint": faint}, 0.2))
    np.testing.assert_allclose(result.observers["none"].xhat, result.observers["faint"].xhat, rtol=1e-12)


def inline(states: str, dynamics: dict[str, str], output: str | list[str], **more: Any) -> dict[str, Any]:
    names = states.split()
    initial = {name: 0.5 + 0.1 * i for i, name in enumerate(names)}
    return {"states": names, "dynamics": dynamics, "output": output, "initial": initial, **more}


THIRD_ORDER = [
    inline("a b c", {"a": "b - a**2", "b": "c + sin(a*b)", "c": "-a*b*c + cos(t)"}, "a"),
    inline("a b c", {"a": "(2 + u)*b", "b": "exp(a)*c - u*b", "c": "-c + a*b"}, "a + u",
           inputs={"u": "sin(2*t)"}),
    inline("c a b", {"a": "(2 + cos(t))*b", "b": "c*(1 + a**2) + u", "c": "-c"}, "2*a", inputs={"u": "t**2"}),
    inline("a b c", {"a": "b + 0.2*b**3 + u", "b": "sinh(c)*(1 + u**2)", "c": "-c + b"}, "a + 0.1*a**3",
           inputs={"u": "0.3*sin(3*t)"}),
]  # fmt: skip


@pytest.mark.parametrize("mu", [0, 5])
def test_what_plays_a_part_is_a_state(mu: float) -> None:
    """Without the blend there is no reconstructed signal: no state z, no part for it, no numbers."""
    reconstruction = {"phi": 10, "G": 1} if mu else {}
    base = experiment({"o": {"type": "direct", "theta": 1, "mu": mu, "initial": START, **reconstruction}}, 0.1)
    observer, form = base.observers["o"], base.forms["o"]
    own = {"z"} if mu else set()
    assert observer.states(form).keys() == observer.roles(form).keys() == own
    assert (observer.design(form).keys() >= {"mu", "phi", "gains"}) == bool(mu)


@pytest.mark.parametrize("plant", THIRD_ORDER, ids=["chain", "input in the slopes", "other order", "not affine"])
def test_the_state_from_exact_derivatives(plant: dict[str, Any]) -> None:
    """y, y', y'' by the chain rule along the flow, with u(t) put in, give the state back."""
    e = experiment({"o": {"type": "direct", "theta": 1, "mu": 1, "phi": 10, "G": 1}}, 1.0, plant)
    model, form = e.plant.model, e.forms["o"]
    drift, y = (ca.substitute(v, model.u, e.plant.inputs) for v in (model.dynamics, model.output))
    rows = [y]
    for _ in range(2):
        rows.append(ca.jtimes(rows[-1], model.x, drift) + ca.jacobian(rows[-1], model.t))
    copy = form.copy(model.t, e.plant.inputs, model.p, False, {})
    back = ca.Function("back", [model.t, model.x], [copy.reconstruct(ca.vertcat(*rows), guess=model.x + 0.3)])
    for x in np.random.default_rng(3).uniform(-1, 1, (10, 3)):
        np.testing.assert_allclose(np.asarray(back(0.7, x)).ravel(), x, atol=1e-9)


def test_a_sharp_blend_follows_the_reconstruction_of_a_third_order_plant() -> None:
    """Without noise the differentiator is exact after a while, so the estimate is drawn to the truth."""
    plant = THIRD_ORDER[0]
    block = {
        "type": "direct",
        "theta": 1,
        "mu": 1e4,
        "phi": 400,
        "G": 10,
        "initial": {"a": 2, "b": -2, "c": 2},
    }
    result = hgorun.simulate(experiment({"with": block, "without": {**block, "mu": 0}}, 4.0, plant))
    error = {k: np.abs(o.xhat - result.x)[3000:].max() for k, o in result.observers.items()}
    assert error["with"] < 0.1 * error["without"]


def test_plants_of_first_order() -> None:
    """No derivative is needed, and theta' has no growth term: all of them converge, sampled too."""
    plant = inline("a", {"a": "-a + u"}, "a", inputs={"u": "sin(t)"})
    dynamic = {**DYNAMIC, "l": [2], "initial": {"a": 2}}
    observers = {
        "direct": {"type": "direct", "theta": 2, "mu": 5, "phi": 40, "G": 2, "initial": {"a": 2}},
        "dynamic": {"type": "dynamic_gain", **dynamic},
        "both": {"type": "direct_dynamic", **dynamic, "mu_0": 5, "phi": 40, "G": 2},
    }
    result = hgorun.simulate(experiment(observers, 5.0, plant, measurement={"sampling": {"period": 0.01}}))
    for name, observer in result.observers.items():
        assert np.abs(observer.xhat - result.x)[-1].max() < 1e-5, name


PLAIN = {"type": "direct", "theta": 1}


@pytest.mark.costly
@pytest.mark.parametrize(
    ("plant", "block", "words"),
    [
        (inline("a b", {"a": "b", "b": "-a"}, ["a", "b"]), PLAIN, "takes one"),
        (inline("a b c", {"a": "b + c", "b": "-a", "c": "b"}, "a"), PLAIN, "depends on b and c"),
        (inline("a b", {"a": "-a", "b": "a"}, "a"), PLAIN, "state b does not appear in"),
        (inline("a b", {"a": "2*b", "b": "-a"}, "a"), {"type": "dynamic_gain", **DYNAMIC, "initial": {}},
         "slope of the derivative of a in b is 2"),
    ],
)  # fmt: skip
def test_a_plant_outside_the_class_is_refused_with_the_reason(
    plant: dict[str, Any], block: dict[str, Any], words: str
) -> None:
    with pytest.raises(ConfigError, match=words) as error:
        hgorun.simulate(experiment({"o": block}, 0.1, plant))
    assert error.value.key == "plant"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mu": 50}, "needs phi and G"),
        ({"l": [1, 2, 3]}, "expected 2 numbers, one per state; found 3"),
        ({"poles": -1}, "either poles or l"),
    ],
)
def test_keys_that_do_not_fit(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        hgorun.simulate(experiment({"o": {**OBSERVERS["(3)"], **change}}, 0.1))


@pytest.mark.costly
@pytest.mark.parametrize("name", ["(3)", "(13)", "(7)", "(18)"])
def test_sampled_output_costs_little(name: str) -> None:
    """With dense samples every observer does what it does with a continuous output."""
    sampled = hgorun.simulate(experiment({"o": OBSERVERS[name]}, 1.0, measurement={"sampling": {"period": 1e-3}}))
    continuous = hgorun.simulate(experiment({"o": OBSERVERS[name]}, 1.0))
    gap = np.abs(sampled.observers["o"].xhat - continuous.observers["o"].xhat)[50:]
    assert gap.max() < 2e-3


@pytest.mark.parametrize("theta", [1, 3, 20])
def test_fastest_rate(theta: float) -> None:
    """theta times the largest root of s^2 + l_1 s + l_2 in size; half of phi where the reconstruction pulls faster."""
    plain = {"type": "direct", "theta": theta, "l": [1, 0.5], "initial": START}
    pulled = plain | {"mu": 50, "phi": 4000, "G": 1, "internal": {"z": [0.05, 0]}}
    made = experiment({"plain": plain, "pulled": pulled}, 0.1)
    rates = {label: made.observers[label].fastest_rate(prepare(made).forms[label]) for label in ("plain", "pulled")}
    assert rates["plain"] == pytest.approx(theta * np.sqrt(0.5), rel=1e-9)
    assert rates["pulled"] == pytest.approx(2000)


@pytest.mark.parametrize("unit", [1.0, 1e9, 1e-9])
def test_the_fastest_rate_knows_no_units(unit: float) -> None:
    """x_2 in another unit, and l_2 with it: the eigenvalues stay at -3."""
    plant = {
        "states": ["x1", "x2"],
        "dynamics": {"x1": f"x2/{unit!r}", "x2": f"-{unit!r}*x1 - x2"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0},
    }
    made = examples.experiment(plant, {"D": {"type": "direct", "theta": 3, "l": [2, unit]}})
    assert made.observers["D"].fastest_rate(prepare(made).forms["D"]) == pytest.approx(3, rel=1e-6)
