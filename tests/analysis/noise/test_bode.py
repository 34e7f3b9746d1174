"""Frequency responses and the noise findings, against closed forms of a double integrator's observer."""

import numpy as np
import pytest
from examples import findings, said

import hgorun
from hgorun.analysis.noise.responses import frequency_responses
from hgorun.analysis.report import analysis_of
from hgorun.analysis.subject import Context
from hgorun.figures.bode import bode_figure
from hgorun.simulation.simulate import prepare, simulate_prepared

CONFIG = """\
time: {end: 30, output_step: 0.002}
plant: {type: integrator_chain, n: 2, initial: {x1: 0, x2: 0}}
measurement: {noise: [{type: sinusoids, terms: [{amplitude: 0.5, omega: 40}]}]}
observers: {A: {type: shgo, theta: 3}}
solver: {step: 2.0e-3}
"""


@pytest.fixture(scope="module")
def context(tmp_path_factory: pytest.TempPathFactory) -> Context:
    path = tmp_path_factory.mktemp("bode") / "chain.yaml"
    path.write_text(CONFIG)
    run = prepare(hgorun.load(path))
    return Context(run, simulate_prepared(run))


def transfer(omega: np.ndarray) -> np.ndarray:
    """(theta k_1 s + theta^2 k_2, theta^2 k_2 s)/(s + theta)^2, k = (2, 1), in size, shape (W, 2)."""
    s = 1j * omega
    return np.abs(np.column_stack([6 * s + 9, 9 * s]) / ((s + 3) ** 2)[:, None])


@pytest.mark.slow
def test_the_response_is_the_transfer_function(context: Context) -> None:
    data = frequency_responses(context)
    np.testing.assert_allclose(data.magnitude["A"], transfer(data.omega), rtol=1e-9)
    assert list(data.own) == [40]
    figure = bode_figure(data, context.result)
    assert [ax.get_xscale() for ax in figure.axes] == ["log", "log"]


def test_the_findings_are_its_numbers(context: Context) -> None:
    values = said(analysis_of(context.run, context.result, findings("noise")).observers["A"])
    amplitude = 0.5 * transfer(np.array([40.0]))[0]
    assert list(values["noise_amplitude"].values()) == pytest.approx(amplitude, rel=1e-9)
    for key in ("noise_rms_predicted", "noise_rms_measured"):
        assert list(values[key].values()) == pytest.approx(amplitude / np.sqrt(2), rel=0.01)
    assert values["hinf"]["x1"] == pytest.approx(transfer(np.logspace(-2, 2, 4001))[:, 0].max(), rel=1e-5)
    assert values["h2"]["x2"] == pytest.approx(9 / np.sqrt(12), rel=1e-9)  # l_2/sqrt(2 l_1), l = (6, 9)
    assert values["noise_exponent_theta"]["x2"] == pytest.approx(2, abs=0.02)
    assert values["noise_exponent_eps"]["x1"] == pytest.approx(1, abs=0.02)
