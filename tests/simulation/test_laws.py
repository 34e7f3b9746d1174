"""Laws, exact or in distribution: equal bits, linear theory, white noise, stability limits, divergence."""

import platform
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from examples import prepared, run
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag, expm, solve_discrete_lyapunov

from hgorun import Result, SimulationError
from hgorun.engine.memory import Raw, Start
from hgorun.engine.plan import Plan
from hgorun.engine.program import Program
from hgorun.simulation.passes.passes import as_given, integrate

HELD = [{"type": "gaussian", "std": 0.1, "hold": 0.15}]
DRAWN = [{"type": "uniform", "low": -0.1, "high": 0.2}]
SINE = [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 3}]}]
MEASUREMENTS: dict[str, dict[str, Any]] = {
    "continuous": {"noise": HELD},
    "sampled": {
        "sampling": {"period": 0.25, "jitter": 0.05, "dropout": 0.1},
        "delay": "0.3*abs(cos(7*t))",
        "noise": DRAWN,
    },
    "delayed": {"delay": "0.25 + 0.1*sin(2*t)", "noise": HELD},
    "vanishing delay": {"delay": "0.1*(1 - cos(t))", "noise": SINE},
    "phases": {
        "noise": HELD,
        "phases": [
            {"until": 1, "sampling": "continuous"},
            {"until": 2.5, "sampling": {"period": 0.2}, "delay": 0.3},
            {"until": 4, "sampling": "continuous", "delay": 0.4},
        ],
    },
}
SHGO = {"type": "shgo", "theta": 1.5, "initial": {"x1": 0.2, "x2": 0.3}}
FHGO = {"type": "fhgo2", "r": 2, "theta": 2, "initial": {"x1": 0.2, "x2": 0.3}}
LOST = {"type": "shgo", "theta": 1e5, "initial": {"x1": 0.2, "x2": 0.3}}

# Not a chain, with elementary functions of the state and of time.
PLANT = {
    "states": ["x1", "x2"],
    "dynamics": {
        "x1": "(1 + 0.1*tanh(x1))*x2 - 0.1*x1**3",
        "x2": "-sin(x1) - 0.3*(1 + x2**2)**0.7 + 0.2*exp(-x1**2)*u + 0.1*log(2 + x1**2)*atan(x2)",
    },
    "output": "x1",
    "inputs": {"u": "cos(3*t) + abs(sin(t))"},
    "initial": {"x1": 0.5, "x2": 0.4},
    "disturbance": {"x2": "0.1*sin(5*t)"},
}


def configuration(measurement: dict[str, Any], observers: dict[str, Any]) -> dict[str, Any]:
    return {
        "time": {"end": 4, "output_step": 0.03},
        "plant": PLANT,
        "measurement": measurement,
        "observers": observers,
        "solver": {"step": 0.02},
        "seed": 5,
    }


def same(a: Result, b: Result, *labels: str) -> bool:
    """Whether plant, samples and the observers of these labels have the same bits."""
    pairs = [(a.x, b.x), (a.measurements.y, b.measurements.y), (a.measurements.taken, b.measurements.taken)]
    for label in labels:
        one, two = a.observers[label], b.observers[label]
        pairs += [(one.xhat, two.xhat)]
        pairs += [(one.internal[k], two.internal[k]) for k in set(one.internal) & set(two.internal) - {"alpha"}]
    return all(np.array_equal(one, two, equal_nan=True) for one, two in pairs)


# ---- equal bits ----


@pytest.mark.slow
@pytest.mark.parametrize("name", MEASUREMENTS)
def test_filter_of_order_zero_is_the_standard_observer(name: str, tmp_path: Path) -> None:
    config = configuration(MEASUREMENTS[name], {"S": SHGO, "F": SHGO | {"type": "fhgo2", "r": 0}})
    result = run(tmp_path, config)
    one, two = result.observers.values()
    assert np.array_equal(one.xhat, two.xhat)
    assert np.all(np.isfinite(one.xhat))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sampled", "delayed", "phases"])
def test_an_observer_does_not_feel_the_others(name: str, tmp_path: Path) -> None:
    """Alone, before and behind others, and beside one that diverges."""
    measurement = MEASUREMENTS[name]
    alone = {
        "S": run(tmp_path, configuration(measurement, {"S": SHGO})),
        "F": run(tmp_path, configuration(measurement, {"F": FHGO})),
    }
    for observers in (
        {"S": SHGO, "F": FHGO},
        {"F": FHGO, "S": SHGO},
        {"F": FHGO, "lost": LOST, "S": SHGO, "again": FHGO | {"r": 3}},
    ):
        together = run(tmp_path, configuration(measurement, observers))
        assert same(together, alone["S"], "S")
        assert same(together, alone["F"], "F")
        assert together.observers["S"].diverged_at is None
        assert ("lost" in observers) == (together.status != "ok")
    assert together.observers["lost"].lost


@pytest.mark.slow
@pytest.mark.parametrize("solver", [{"step": 0.02}, {"method": "dopri5", "rtol": 1e-8}])
def test_runs_repeat_bit_for_bit(solver: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With code compiled anew, with code from the cache, and told of progress in slices of a segment."""
    monkeypatch.setenv("HGORUN_CACHE_DIR", str(tmp_path / "cache"))
    noise = [{"type": "gaussian", "std": 0.1, "hold": 0.01}]  # many segments
    config = configuration(MEASUREMENTS["phases"] | {"noise": noise}, {"S": SHGO, "F": FHGO})
    config["solver"] = solver
    results = [run(tmp_path, config), run(tmp_path, config)]
    monkeypatch.setattr("hgorun.engine.program._SLICE", 1e-9)
    told: list[float] = []
    results.append(run(tmp_path, config, progress=told.append))
    assert len(told) > 10
    assert all(a < b for a, b in pairwise(told))
    assert told[-1] == 1.0
    for again in results[1:]:
        assert same(results[0], again, "S", "F")
        assert results[0].metrics() == again.metrics()


@pytest.mark.costly
@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names processors of this family")
@pytest.mark.parametrize("solver", [{"step": 0.02}, {"method": "dopri5", "rtol": 1e-8}])
@pytest.mark.parametrize("processor", ["x86-64", "x86-64-v2", "x86-64-v3"])
def test_no_bit_depends_on_the_processor(
    processor: str, solver: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """SSE2 alone, SSE4 and AVX2 with fma make the numbers of this processor."""
    config = configuration(MEASUREMENTS["delayed"], {"S": SHGO, "F": FHGO}) | {"solver": solver}
    here = run(tmp_path, config)
    monkeypatch.setenv("HGORUN_CPU", processor)
    there = run(tmp_path, config)
    assert same(here, there, "S", "F")
    assert here.metrics() == there.metrics()


@pytest.mark.costly
@pytest.mark.parametrize("name", ["continuous", "delayed"])
def test_pieces_of_a_long_segment_do_not_change_bits(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = configuration(MEASUREMENTS[name] | {"noise": SINE}, {"S": SHGO, "F": FHGO})
    whole = run(tmp_path, config, "solver.step=0.0004")
    monkeypatch.setattr("hgorun.simulation.timeline.steps._PIECE", 7)
    pieces = run(tmp_path, config, "solver.step=0.0004")
    assert same(whole, pieces, "S", "F")


@pytest.mark.costly
def test_a_pause_inside_an_adaptive_segment(tmp_path: Path) -> None:
    """More steps in one segment than native code makes at one go."""
    config = configuration({"noise": SINE}, {"F": FHGO}) | {"plant": PLANT | {"inputs": {"u": "cos(3*t)"}}}
    precise = {"method": "dopri5", "rtol": 1e-10, "atol": 1e-12}
    short = run(tmp_path, config | {"solver": precise | {"max_step": 1e-4}})
    free = run(tmp_path, config | {"solver": precise})
    np.testing.assert_allclose(short.observers["F"].xhat, free.observers["F"].xhat, rtol=0, atol=1e-9)
    np.testing.assert_allclose(short.x, free.x, rtol=0, atol=1e-9)


class Recorded:
    """A program that remembers what it was asked to run."""

    def __init__(self, program: Program) -> None:
        self.program = program

    def run(self, plan: Plan, start: Start, *more: Any, **keys: Any) -> Raw:
        self.plan, self.start = plan, start
        return self.program.run(plan, start, *more, **keys)


def in_lanes(folder: Path, config: dict[str, Any], lanes: list[list[str]]) -> tuple[Raw, list[Raw]]:
    """The same experiment with other numbers in each lane: side by side, and one by one."""
    runs = [prepared(folder, config, *overrides) for overrides in lanes]
    asked, single = [], []
    for each in runs:
        programs = each.structure._programs
        asked.append(Recorded(each.structure.program("rk4")))
        programs["rk4", False, 1] = cast(Program, asked[-1])
        single.append(integrate(each, as_given(each)))
        programs["rk4", False, 1] = asked[-1].program
    numbers: dict[str, Any] = {
        name: np.column_stack([getattr(a.plan, name) for a in asked]) for name in ("gain", "bias", "holds")
    }
    z, p = (np.hstack([getattr(a.start, name) for a in asked]) for name in ("z", "p"))
    program = Program(runs[0].structure.system, "rk4", lanes=len(lanes))
    return program.run(replace(asked[0].plan, **numbers), Start(z, p, asked[0].start.bound)), single


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sampled", "delayed", "phases"])
def test_lanes_have_the_bits_of_single_runs(name: str, tmp_path: Path) -> None:
    """Four runs in one vector register, with their own gains, starts and draws; one of them diverges."""
    measurement = MEASUREMENTS[name]
    if name == "sampled":  # arrivals are common to all lanes, so they must not depend on the seed
        measurement = measurement | {"sampling": {"period": 0.25}}
    config = configuration(measurement, {"S": SHGO, "F": FHGO})
    lanes = [
        [],
        ["observers.S.theta=2.5", "observers.F.initial.x1=-0.4", "seed=6"],
        ["observers.S.theta=1e5", "plant.initial.x1=0.8", "seed=7"],
        ["observers.F.theta=1.2", "observers.F.poles=-1.3", "plant.initial.x2=-0.2", "seed=8"],
    ]
    together, single = in_lanes(tmp_path, config, lanes)
    for lane, alone in enumerate(single):
        for array in ("rows", "measured", "diverged", "error"):
            one, two = getattr(together, array)[..., lane], getattr(alone, array)[..., 0]
            assert np.array_equal(one, two, equal_nan=True), (array, lane)
    assert np.isfinite(together.diverged[0]).tolist() == [False, False, True, False]
    assert not np.any(np.isfinite(together.diverged[1]))
    assert not np.array_equal(together.rows[..., 0], together.rows[..., 1])


# ---- linear plants: the matrix exponential ----

PHI = [-1.0, -2.0, -2.0]
X0, XHAT0 = [1.0, -0.5, 0.3], [0.2, 0.0, -0.4]
LINEAR = {
    "type": "integrator_chain",
    "n": 3,
    "phi": "-x1 - 2*x2 - 2*x3",
    "initial": dict(zip(("x1", "x2", "x3"), X0, strict=True)),
}


def binomial(count: int, pole: float = 1.0) -> np.ndarray:
    """The coefficients of (s + pole)^count after the first."""
    return np.poly(np.full(count, -pole))[1:]


def error_system(n: int, r: int, gain: np.ndarray, theta: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """M, b: (xhat, eta)' = M (xhat, eta) + b e for a chain of integrators."""
    M, b = block_diag(np.eye(n, k=1), theta * np.eye(r, k=1)), np.zeros(n + r)
    kappa = theta ** np.arange(1, n + 1) * gain[r:]
    if r == 0:
        return M, -kappa
    M[:n, n] = -kappa
    M[n:, n] -= theta * gain[:r]
    b[-1] = theta
    return M, b


def whole_system(r: int, theta: float) -> tuple[np.ndarray, np.ndarray]:
    """M, b: z' = M z + b e for z = (x, xhat, eta, alpha) of the linear plant."""
    M, b = error_system(3, r, binomial(3 + r), theta)
    M = block_diag(np.eye(3, k=1), M, [[0]])
    M[2, :3], M[5, 3:6] = PHI, PHI
    b = np.concatenate([np.zeros(3), b, [0]])
    if r:
        M[-1, 6] = M[3, 6]  # alpha' = -kappa_1, as in xhat_1'
    else:
        b[-1] = b[3]
    return M, b


def run_linear(folder: Path, measurement: dict[str, Any], theta: float, solver: dict[str, Any]) -> Result:
    common = {"theta": theta, "initial": dict(zip(("x1", "x2", "x3"), XHAT0, strict=True))}
    config = {
        "time": {"end": 3, "output_step": 0.1},
        "plant": LINEAR,
        "measurement": measurement,
        "observers": {f"F{r}": {"type": "fhgo2", "r": r, **common} for r in range(4)},
        "solver": solver,
    }
    return run(folder, config)


SOLVERS = [{"step": 0.001}, {"method": "dopri5", "rtol": 1e-11, "atol": 1e-13}]


def assert_linear(result: Result, r: int, exact: np.ndarray) -> None:
    found = result.observers[f"F{r}"]
    np.testing.assert_allclose(result.x, exact[:, :3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.xhat, exact[:, 3:6], rtol=0, atol=1e-9)
    if r:
        np.testing.assert_allclose(found.internal["eta"], exact[:, 6:-1], rtol=0, atol=1e-9)


@pytest.mark.costly
@pytest.mark.parametrize("solver", SOLVERS, ids=["rk4", "dopri5"])
def test_linear_plant_measured_continuously(solver: dict[str, Any], tmp_path: Path) -> None:
    result = run_linear(tmp_path, {}, 2.0, solver)
    for r in range(4):
        M, b = whole_system(r, 2.0)
        M[:, 3] += b
        M[:, 0] -= b
        z0 = np.concatenate([X0, XHAT0, np.zeros(r + 1)])
        assert_linear(result, r, np.array([expm(t * M) @ z0 for t in result.time]))


@pytest.mark.costly
@pytest.mark.parametrize("solver", SOLVERS, ids=["rk4", "dopri5"])
def test_linear_plant_sampled_late(solver: dict[str, Any], tmp_path: Path) -> None:
    """Samples every 0.3 that are 0.2 old: between arrivals e is a held number plus alpha."""
    result = run_linear(tmp_path, {"sampling": {"period": 0.3}, "delay": 0.2}, 2.0, solver)
    for r in range(4):
        M, b = whole_system(r, 2.0)
        M[:, -1] += b
        with_held = block_diag(M, [[0]])
        with_held[:-1, -1] = b
        tenth = expm(0.1 * with_held)
        z = [np.concatenate([X0, XHAT0, np.zeros(r + 2)])]
        for k in range(30):
            now = z[-1].copy()
            if k % 3 == 0:  # taken 0.2 = 2 tenths ago, at the start at the earliest
                then = z[max(k - 2, 0)]
                now[-1] = then[3] - then[-2] - then[0]
            z.append(tenth @ now)
        assert_linear(result, r, np.array(z)[:, :-1])


# ---- white noise ----


def exact_covariance(M: np.ndarray, b: np.ndarray, hold: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Stationary covariance of e' = M e + b v, v held for ``hold``, of unit density; and the standard error
    of its estimate from ``count`` successive values, from the autocovariances (Bartlett)."""
    n = len(b)
    lifted = np.block([[M, b[:, None]], [np.zeros((1, n + 1))]])
    step = expm(hold * lifted)
    F, g = step[:n, :n], step[:n, n]
    P = solve_discrete_lyapunov(F, np.outer(g, g) / hold)
    later, total = P, np.outer(np.diag(P), np.diag(P)) + P * P
    while np.abs(later).max() > 1e-6 * np.abs(P).max():
        later = F @ later
        total = total + 2 * (np.outer(np.diag(later), np.diag(later)) + later * later.T)
    return P, np.sqrt(total / count)


@pytest.mark.measured("2-sigma0")
@pytest.mark.costly
@pytest.mark.parametrize(("n", "sigma"), [(2, [3.536, 15.81]), (3, [4.541, 41.83, 136.9])])
def test_held_white_noise(n: int, sigma: list[float], tmp_path: Path) -> None:
    """Poles at -10. Noise of unit density held for 0.01 is white to the observer within half a percent."""
    hold, end, pole = 0.01, 2000.0, 10.0
    observers = {
        f"F{r}": {"type": "fhgo2", "r": r, "theta": 1, "gains": binomial(n + r, pole).tolist()} for r in range(3)
    }
    config = {
        "time": {"end": end, "output_step": hold},
        "plant": {"type": "integrator_chain", "n": n, "initial": {f"x{i + 1}": 0 for i in range(n)}},
        "measurement": {"noise": [{"type": "gaussian", "std": hold**-0.5, "hold": hold}]},
        "observers": observers,
        "solver": {"step": hold / 2},
        "seed": 2,
    }
    result = run(tmp_path, config)
    settled = result.time >= 5
    for r in range(3):
        M, b = error_system(n, r, binomial(n + r, pole))
        M[:, 0] += b  # e = xhat_1 - v, the plant being at rest
        P, standard_error = exact_covariance(M, b, hold, settled.sum())
        found = result.observers[f"F{r}"]
        e = np.hstack([found.xhat, found.internal["eta"]] if r else [found.xhat])[settled]
        gap = np.abs(e.T @ e / len(e) - P)
        # Some products, as xhat_n eta_1, are time derivatives: their mean is a boundary term, with no spread.
        boundary = 1e-3 * np.sqrt(np.outer(np.diag(P), np.diag(P)))
        assert np.all(gap < 4 * standard_error + boundary)
        assert np.all(np.diag(gap) < 4 * np.diag(standard_error))
        if r == 0:
            np.testing.assert_allclose(np.sqrt(np.diag(P)), sigma, rtol=0.005)
            np.testing.assert_allclose(np.sqrt(np.mean(e**2, axis=0)), sigma, rtol=0.03)
    if n == 2:
        l1, l2 = 2 * pole, pole**2
        law = [np.sqrt((l2 + l1**2) / (2 * l1)), l2 / np.sqrt(2 * l1)]
        np.testing.assert_allclose(sigma, law, rtol=1e-3)


# ---- stability limits of a chain of three integrators, all poles at -theta ----


def growth(folder: Path, measurement: dict[str, Any], thetas: dict[str, float]) -> dict[str, float]:
    """How the estimate of a plant at rest has grown between an early and a late window."""
    start = {"x1": 1, "x2": 1, "x3": 1}
    config = {
        "time": {"end": 300, "output_step": 0.5},
        "plant": {"type": "integrator_chain", "n": 3, "initial": {"x1": 0, "x2": 0, "x3": 0}},
        "measurement": measurement,
        "observers": {
            label: {"type": "shgo", "theta": theta, "initial": start}
            if label == "SHGO"
            else {"type": "fhgo2", "r": int(label), "theta": theta, "initial": start}
            for label, theta in thetas.items()
        },
        "solver": {"step": 0.02, "divergence": 1e200},
    }
    result = run(folder, config)
    early = (result.time > 60) & (result.time <= 120)
    late = result.time > 240
    return {
        label: np.abs(found.xhat[late]).max() / np.abs(found.xhat[early]).max()
        for label, found in result.observers.items()
    }


@pytest.mark.costly
@pytest.mark.parametrize(
    ("measurement", "limits"),
    [
        ({"sampling": {"period": 1}}, {"SHGO": 2.896, "1": 2.855, "2": 2.968, "3": 3.014, "4": 3.163}),
        ({"delay": 1}, {"SHGO": 0.927, "1": 1.103, "2": 1.255, "3": 1.400}),
    ],
    ids=["period", "delay"],
)
def test_largest_theta_times_period_or_delay(measurement: dict[str, Any], limits: Any, tmp_path: Path) -> None:
    below = growth(tmp_path, measurement, {k: 0.99 * limit for k, limit in limits.items()})
    above = growth(tmp_path, measurement, {k: 1.01 * limit for k, limit in limits.items()})
    assert max(below.values()) < 0.8
    assert min(above.values()) > 1.25


# ---- divergence ----


@pytest.mark.slow
@pytest.mark.parametrize(
    "solver", [{"step": 0.01}, *({"method": name, "rtol": 1e-9, "atol": 1e-11} for name in ("dopri5", "rodas5p"))]
)
@pytest.mark.parametrize("name", ["sampled", "delayed"])
def test_a_diverging_observer_is_flagged_and_masked(name: str, solver: dict[str, Any], tmp_path: Path) -> None:
    """theta T_e = 15, theta d = 10: far beyond what a filter of order 2 on a chain of two stands."""
    measurement = MEASUREMENTS[name] if name == "delayed" else {"sampling": {"period": 0.25}, "noise": DRAWN}
    lost = FHGO | {"theta": 60 if name == "sampled" else 40}
    config = configuration(measurement, {"S": SHGO, "lost": lost, "F": FHGO}) | {"solver": solver}
    config["time"] = {"end": 20, "output_step": 0.05}
    config["plant"] = {"type": "integrator_chain", "phi": "cos(3*t) - x1", "initial": {"x1": 0.5, "x2": 0.4}}
    result = run(tmp_path, config)
    found, t = result.observers["lost"], result.time
    at = found.diverged_at
    assert at is not None
    assert 0.5 < at < 15
    assert found.verdict.text() == f"diverged at t={at:.6g}"
    assert result.status == "diverged"
    assert np.all(np.isnan(found.xhat[t >= at]))
    assert np.all(np.isnan(found.internal["eta"][t >= at]))
    assert np.all(np.isfinite(found.xhat[t < at - 0.05]))
    assert np.nanmax(np.abs(found.xhat)) < 1e6 * (1 + np.abs(result.x).max())
    assert all(np.all(np.isinf(values)) for values in found.metrics.values())
    del config["observers"]["lost"]
    calm = run(tmp_path, config)
    for label in ("S", "F"):
        assert result.observers[label].diverged_at is None
        gap = np.abs(result.observers[label].xhat - calm.observers[label].xhat).max()
        assert gap == 0 if "step" in solver else gap < 1e-7  # adaptive steps are common to all
    sooner = run(tmp_path, config | {"observers": {"lost": lost}}, "solver.divergence=100")
    first = sooner.observers["lost"].diverged_at
    assert first is not None
    assert first < at
    reached = 100 if "step" in solver else 110  # inside the step that leaves the bound there are output points
    assert 10 < np.nanmax(np.abs(sooner.observers["lost"].xhat)) <= reached


@pytest.mark.measured("solver2")
@pytest.mark.costly
@pytest.mark.parametrize("solver", [{"step": 0.001}, *({"method": name} for name in ("dopri5", "rodas5p"))])
def test_a_diverging_plant_ends_the_run(solver: dict[str, Any], tmp_path: Path) -> None:
    """x' = x^2 from 1 is infinite at t = 1."""
    config = {
        "time": {"end": 3, "output_step": 0.1},
        "plant": {"states": ["x1"], "dynamics": {"x1": "x1**2"}, "output": "x1", "initial": {"x1": 1}},
        "observers": {"S": {"type": "shgo", "theta": 1}},
        "solver": solver,
    }
    with pytest.raises(SimulationError, match=r"plant.* t = (1|1\.0[01]\d*|0\.99\d*)[:, ]"):
        run(tmp_path, config)


def test_an_estimate_may_leave_the_plant_far_behind(tmp_path: Path) -> None:
    """The bound grows with the plant: a plant that grows like e^(3 t) is not a divergence."""
    config = {
        "time": {"end": 12, "output_step": 0.1},
        "plant": {
            "states": ["x1", "x2"],
            "dynamics": {"x1": "x2", "x2": "9*x1"},
            "output": "x1",
            "initial": {"x1": 1, "x2": 3},
        },
        "observers": {"S": {"type": "shgo", "theta": 10}},
        "solver": {"step": 0.001},
    }
    result = run(tmp_path, config)
    assert result.status == "ok"
    assert np.abs(result.x).max() > 1e15
    exact = solve_ivp(lambda t, x: [x[1], 9 * x[0]], (0, 12), [1, 3], rtol=1e-10, atol=1e-10).y[:, -1]
    np.testing.assert_allclose(result.x[-1], exact, rtol=1e-6)
