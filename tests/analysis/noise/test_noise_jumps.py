"""Noise of observers that jump at the samples, predicted along a run, against the run minus its noise_free."""

import pytest
from outside import code_of

import hgorun
from hgorun.analysis.noise.prediction import measured_noise, predicted_noise, without_noise
from hgorun.analysis.reasons import NoValue
from hgorun.observers.base import OBSERVERS
from hgorun.reproduce.shipped import folder
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "name", "settings", "states", "within"),
    [
        ("lee2016/stochastic_approximation.yaml", "fixed", ["time.end=12"], ("x1", "x2"), 0.01),
        ("lee2016/stochastic_approximation.yaml", "sa", ["time.end=6"], ("x1", "x2"), 0.01),
        ("katayama/van_der_pol.yaml", "t005", [], ("x2",), 0.01),
    ],
)
def test_within_one_percent(file: str, name: str, settings: list[str], states: tuple[str, ...], within: float) -> None:
    windows = ["metrics.window=[4,12]", "metrics.transient=[0,4]"] if "time.end=12" in settings else []
    windows += ["metrics.window=[2,6]", "metrics.transient=[0,2]"] if "time.end=6" in settings else []
    experiment = hgorun.load(folder() / file, [*settings, *windows], run=name)
    run = prepare(experiment)
    result, noise_free = simulate_prepared(run), simulate(without_noise(experiment))
    for label in result.observers:
        predicted = predicted_noise(run, label, noise_free, result)
        measured = measured_noise(result, noise_free, label)
        for state in states:
            i = result.states.index(state)
            assert predicted[i] == pytest.approx(measured[i], rel=within), (label, state)


def test_an_observer_that_flows_between_its_jumps_gets_a_reason_and_no_number() -> None:
    names: dict[str, type] = {}
    exec(code_of("extending.md", 'observer("own_ekf")').replace('@observer("own_ekf")\n', ""), names)
    config = {
        "time": {"end": 2, "output_step": 0.1},
        "plant": {"type": "integrator_chain", "n": 2, "phi": "-x1", "initial": {"x1": 1, "x2": 0}},
        "measurement": {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.02}]},
        "observers": {"o": {"type": "own_ekf"}},
    }
    with OBSERVERS.replaced("own_ekf", names["ExtendedKalman"]):
        experiment = hgorun.Experiment(config)
        run = prepare(experiment)
        with pytest.raises(NoValue, match="flows and jumps"):
            predicted_noise(run, "o", simulate(without_noise(experiment)), simulate_prepared(run))
