"""Slopes of phi: closed forms, regions, and coordinates."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from examples import experiment, said

from hgorun import Experiment
from hgorun.analysis.convergence.charts import Chart, chart_of
from hgorun.analysis.convergence.lipschitz import Lipschitz, lipschitz, slopes_met
from hgorun.analysis.convergence.segments import Trajectories, along, compile_slopes
from hgorun.analysis.reasons import NoValue
from hgorun.analysis.report import Findings, analyze
from hgorun.memo import Memo
from hgorun.reproduce.shipped import experiments
from hgorun.result.result import Result
from hgorun.simulation.prepared import PreparedRun
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.symbolic import segment_means

TIME = {"end": 2, "output_step": 0.01}


def found(plant: dict[str, Any], block: dict[str, Any], **more: Any) -> Findings:
    return analyze(experiment(plant, {"observer": block}, **{"time": TIME, **more})).observers["observer"]


def inline(n: int, **dynamics: str) -> dict[str, Any]:
    initial = {f"x{i + 1}": 0.5 for i in range(n)}
    return {"states": list(initial), "dynamics": dynamics, "output": "x1", "initial": initial}


def trajectories_of(chart: Chart, result: Result) -> Trajectories:
    """Of the only observer."""
    x, xhat = result.x, result.observers["observer"].xhat
    return Trajectories(chart=chart, time=result.time, x=x, xhat=xhat, z=chart.image(x), zhat=chart.image(xhat))


def of_run(run: PreparedRun, chart: Chart, saturation: dict[str, tuple[float, float]], result: Result) -> Lipschitz:
    """The bounds of the only observer."""
    of = trajectories_of(chart, result)
    met = np.maximum(*(slopes_met(chart, result, one) for one in (of.x, of.xhat)))
    return lipschitz(run, of, saturation, met)


def test_each_slope_and_its_norms() -> None:
    plant = inline(3, x1="x2 - 2*x1", x2="x3 + 0.5*sin(x2)", x3="tanh(x1) - 4*x3")
    config = {"time": TIME, "plant": plant, "observers": {"observer": {"type": "shgo", "theta": 2}}}
    run = prepare(Experiment(config))
    result = simulate_prepared(run)
    chart = chart_of(run.observers[0].form, run.plant)
    got = of_run(run, chart, {"x1": (-1, 1), "x2": (-1, 1), "x3": (-9, 9)}, result)
    expected = np.array([[2, 0, 0], [0, 0.5, 0], [1, 0, 4]])
    assert got.kind == "interval over box"
    assert got.region == "saturation"
    assert np.all(got.slopes >= expected * (1 - 1e-12))
    assert np.allclose(got.slopes, expected, rtol=0.011)
    assert np.all(got.reached <= got.slopes)
    assert got.value == 4
    for theta in (1.0, 3.0):
        T = np.diag(theta ** -np.arange(3.0))
        assert got.constant(theta) == pytest.approx(np.linalg.norm(T @ got.slopes @ np.linalg.inv(T), 2))


@pytest.mark.costly
def test_the_box_follows_the_saturation_or_the_run() -> None:
    plant = inline(2, x1="x2", x2="-x1**3")
    values = said(found(plant, {"type": "shgo", "theta": 5, "saturation": {"x1": [-2, 2]}}))
    assert values["lipschitz"] == pytest.approx(12, rel=0.011)
    assert values["lipschitz"] >= 12
    assert values["lipschitz_box"]["x1"] == [-2, 2]
    assert "saturation of x1" in values["lipschitz_region"]
    free = said(found(plant, {"type": "shgo", "theta": 5}))
    low, high = free["lipschitz_box"]["x1"]
    assert free["lipschitz"] == pytest.approx(3 * max(low**2, high**2), rel=0.011)
    assert free["lipschitz_reached"] <= free["lipschitz"]


def test_a_saturation_that_the_truth_leaves() -> None:
    of = found(inline(2, x1="x2", x2="-x1"), {"type": "shgo", "theta": 90, "saturation": {"x1": [-0.1, 0.1]}})
    assert "x1 leaves the saturation" in of.reasons["peaking_bound"]


def test_jumps_are_said() -> None:
    of = found(inline(2, x1="x2", x2="-sign(x1)"), {"type": "shgo", "theta": 5})
    assert "switched" in of.reasons["peaking_bound"]


@pytest.mark.costly
def test_inputs_are_enclosed() -> None:
    plant = inline(2, x1="x2", x2="-u*x1") | {"inputs": {"u": "2 + sin(7*t)"}}
    values = said(found(plant, {"type": "shgo", "theta": 5}))
    assert values["lipschitz"] == pytest.approx(3, rel=0.02)
    assert values["lipschitz"] >= 3


def test_a_linear_map_of_states() -> None:
    """x1' = 2 x2, x2' = -x1 - x2, y = x1: z = (x1, 2 x2), z2' = -2 z1 - z2."""
    values = said(found(inline(2, x1="2*x2", x2="-x1 - x2"), {"type": "shgo", "theta": 5}))
    assert values["lipschitz_kind"] == "interval over box"
    assert values["lipschitz"] == pytest.approx(2, rel=1e-9)
    assert list(values["lipschitz_box"]) == ["z1", "z2"]


@pytest.mark.costly
def test_a_map_without_an_inverse_is_followed_along_the_run() -> None:
    """x1' = x2 + x2^3 + 1: z2 = x1', z2' = -(1 + 3 x2^2) x2, whose slope to z2 is -1 - 6 x2^2/(1 + 3 x2^2)."""
    plant = inline(2, x1="x2 + x2**3 + 1", x2="-x2")
    values = said(found(plant, {"type": "shgo", "theta": 5, "initial": {"x1": 0.4, "x2": 0.6}}))
    assert values["lipschitz_kind"] == "interval along run"
    exact = 1 + 6 * 0.6**2 / (1 + 3 * 0.6**2)
    assert values["lipschitz_reached"] <= values["lipschitz"]
    assert exact <= values["lipschitz"] < 2 * exact


def test_a_chart_does_not_depend_on_the_start() -> None:
    plant = inline(2, x1="x2", x2="x1*x2")
    run = prepare(Experiment({"time": TIME, "plant": plant, "observers": {"o": {"type": "shgo", "theta": 4}}}))
    form, elsewhere = run.observers[0].form, replace(run.plant, initial=run.plant.initial + 1)
    assert chart_of(form, elsewhere) is chart_of(form, run.plant)


@pytest.mark.parametrize(("dynamics", "compiled"), [("x1*x2 - x2**3", True), ("sin(x1)", False)])
def test_compiled_slopes_are_the_same(dynamics: str, compiled: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sine is not compiled."""
    monkeypatch.setattr(segment_means, "_CODE", Memo[object](4))
    plant = inline(2, x1="x2", x2=dynamics)
    run = prepare(Experiment({"time": TIME, "plant": plant, "observers": {"observer": {"type": "shgo", "theta": 4}}}))
    result = simulate_prepared(run)
    chart = chart_of(run.observers[0].form, run.plant)
    of = trajectories_of(chart, result)
    expected, box = along(of), of_run(run, chart, {}, result)
    assert compile_slopes(chart) == compiled
    np.testing.assert_array_equal(along(of), expected)
    np.testing.assert_array_equal(of_run(run, chart, {}, result).slopes, box.slopes)
    assert not compile_slopes(chart)


def test_slopes_between_truth_and_estimate_agree_with_the_box() -> None:
    """Where both can be had, those along the run are smaller, and never below what was met."""
    run = prepare(
        Experiment(
            {
                "time": TIME,
                "plant": inline(2, x1="x2 + sin(x1)", x2="-x1**3 + cos(x2)"),
                "observers": {"observer": {"type": "shgo", "theta": 4}},
            }
        )
    )
    result = simulate_prepared(run)
    chart = chart_of(run.observers[0].form, run.plant)
    box = of_run(run, chart, {}, result)
    own = along(trajectories_of(chart, result))
    assert box.kind == "interval over box"
    assert np.all(own <= box.slopes + 1e-9)
    met = np.array([[0.5, 0], [1, 0.3]])
    assert np.all(own[np.tril_indices(2)] >= 0.2 * met[np.tril_indices(2)])


@pytest.mark.slow
def test_contois_in_the_thesis() -> None:
    """z1' = z2 - D z1: the slope mu of the dilution, and a bound for the other row."""
    import hgorun

    path = next(file for name, file in experiments().items() if name.endswith("contois_te025"))
    observers = analyze(hgorun.load(path)).observers
    for of in observers.values():
        assert said(of)["lipschitz_kind"] == "interval along run"
        assert 1.064 <= said(of)["lipschitz_reached"] <= said(of)["lipschitz"] < 10
        assert said(of)["theta_bound"] > said(of)["theta"]


@pytest.mark.slow
def test_triangular_charts_know_their_coordinates() -> None:
    made = Experiment(
        {
            "time": TIME,
            "plant": {"type": "phytoplankton", "inputs": {"u": "1.71"}, "initial": {"x1": 3, "x2": 1.7, "x3": 0.03}},
            "observers": {
                "observer": {
                    "type": "fhgo1",
                    "theta": 3,
                    "delta": 5,
                    "internal": {"P": 0.1},
                    "initial": {"x1": 2.5, "x2": 1.6, "x3": 0.05},
                    "saturation": {"z1": [0.5, 6], "z2": [0.2, 1], "z3": [1, 50]},
                }
            },
        }
    )
    chart = chart_of(made.forms["observer"], made.plant)
    assert chart.names == ("z1", "z2", "z3")
    x = np.array([[3, 1.7, 0.03]])
    assert np.allclose(chart.image(x), [[3, 1 / 1.7, 1 / 0.05]])
    of = analyze(made).observers["observer"]
    assert said(of)["lipschitz"] > 0
    assert said(of)["peaking"]["z1"] >= 0.5


def test_what_is_not_affine_is_refused() -> None:
    made = Experiment(
        {
            "time": TIME,
            "plant": inline(2, x1="x2 + x2**3", x2="-x2"),
            "observers": {"observer": {"type": "shgo_riccati", "theta": 3}},
        }
    )
    with pytest.raises(NoValue, match="not affine in x2"):
        chart_of(made.forms["observer"], made.plant)
    assert "not affine" in analyze(made).observers["observer"].reasons["lipschitz"]
