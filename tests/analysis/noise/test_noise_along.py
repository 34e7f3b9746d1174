"""Noise along a run: predicted from the linearisation, against a run with noise minus its noise_free without."""

from pathlib import Path

import numpy as np
import pytest

import hgorun
from hgorun.analysis.noise.prediction import measured_noise, predicted_noise, without_noise
from hgorun.analysis.reasons import NoValue
from hgorun.reproduce.shipped import folder
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.simulate import prepare, simulate, simulate_prepared

THESIS = folder() / "robles2023"


def ratios(experiment: Experiment) -> dict[str, np.ndarray]:
    """Predicted over measured, shape (n,) for each observer."""
    run = prepare(experiment)
    result, noise_free = simulate_prepared(run), simulate(without_noise(experiment))
    return {
        label: predicted_noise(run, label, noise_free, result) / measured_noise(result, noise_free, label)
        for label in result.observers
    }


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "name", "end"),
    [
        ("chapter3/contois_te025.yaml", None, 30),
        ("chapter3/contois_te050.yaml", None, 30),
        ("chapter2/academic_continuous.yaml", None, 15),
        ("chapter2/academic_sampled.yaml", "te002", 15),
        ("chapter3/academic_fhgo2.yaml", "continuous", 15),
        ("chapter3/academic_fhgo2.yaml", "te02", 20),
        ("chapter2/phytoplankton.yaml", "ts002", 4),
    ],
)
def test_the_thesis_within_five_percent(file: str, name: str | None, end: float) -> None:
    settings = [f"time.end={end}", f"metrics.window=[{end / 3},{end}]", f"metrics.transient=[0,{end / 3}]"]
    for label, ratio in ratios(hgorun.load(THESIS / file, settings, run=name)).items():
        np.testing.assert_allclose(ratio, 1, atol=0.05, err_msg=label)


LINEAR = """\
time: {end: 30, output_step: 0.004}
plant: {type: integrator_chain, n: 2, phi: -x1 - (2 + sin(t))*x2, initial: {x1: 0, x2: 0}}
measurement:
  sampling: {period: 0.1, jitter: 0.02, dropout: 0.2}
  delay: 0.05*abs(cos(t))
  noise: [{type: gaussian, std: 0.3}, {type: sinusoids, terms: [{amplitude: 0.2, omega: 7}]}]
observers:
  SHGO: {type: shgo, theta: 3}
  FHGO: {type: fhgo2, theta: 3, r: 2}
solver: {step: 4.0e-3}
seed: 2
"""


@pytest.mark.slow
def test_linear_plants_within_one_percent_whatever_the_schedule(tmp_path: Path) -> None:
    path = tmp_path / "linear.yaml"
    path.write_text(LINEAR)
    continuous = "measurement={noise: [{type: uniform, low: -1, high: 1, hold: 0.02}]}"
    phases = (
        "measurement.phases=[{until: 15, sampling: {period: 0.2}}, {until: 30, sampling: {period: 0.05, offset: 0.01}}]"
    )
    for settings in ([], [continuous], [phases]):
        for label, ratio in ratios(hgorun.load(path, settings)).items():
            np.testing.assert_allclose(ratio, 1, atol=0.01, err_msg=f"{label} {settings}")


@pytest.mark.costly
def test_what_has_no_answer_says_why(tmp_path: Path) -> None:
    path = tmp_path / "linear.yaml"
    path.write_text(LINEAR)
    late = "measurement={delay: 0.1 + 0.05*sin(t), noise: [{type: uniform, low: -1, high: 1, hold: 0.02}]}"
    experiment = hgorun.load(path, [late])
    run = prepare(experiment)
    result, noise_free = simulate_prepared(run), simulate(without_noise(experiment))
    for label in result.observers:
        with pytest.raises(NoValue, match="continuous and delayed"):
            predicted_noise(run, label, noise_free, result)
