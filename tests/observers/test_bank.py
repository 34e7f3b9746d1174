"""The bank of observers: a trajectory computed elsewhere, its modes alone, and what a switch may cost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline, simulated, sinusoid

import hgorun
from hgorun.errors import ConfigError
from hgorun.observers.bank import ContinuousBank
from hgorun.result.records.observer import ObserverResult
from hgorun.result.result import Result
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare
from hgorun.testing import check_observer

VAN_DER_POL: Block = {"type": "van_der_pol", "parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
SHGO: Block = {"type": "shgo", "theta": 2}
BANK: Block = {"type": "bank", "observer": SHGO, "thetas": [2, 8, 1], "nu": 5, "lam2": 0.01}
NOISE: Block = {"noise": sinusoid(0.05, 40)}
SAMPLED: Block = {"sampling": {"period": 0.1}, "noise": sinusoid(0.05, 7)}
LATE: Block = {**SAMPLED, "delay": 0.13}

# t: xhat, mode, eta; an independent simulator, RK4 with steps of 1e-3
TRAJECTORY = {
    0.2: (0.59467, 0.49338, 0, 0.43690, 0.90349, 0.45188),
    0.5: (0.91380, 0.44453, 0, 0.10170, 0.27664, 0.12562),
    1: (0.65528, -0.21183, 2, 0.01449, 0.03387, 0.01205),
    2: (-0.67425, -1.19905, 0, 0.00312, 0.01083, 0.01749),
    5: (0.73371, 1.94810, 0, 0.00035, 0.01090, 0.00033),
    10: (-1.45890, 1.03587, 2, 0.00031, 0.01012, 0.00025),
}
SWITCHES = [0.93, 1.316, 4.05, 4.318, 4.368, 4.459, 4.532, 4.608, 4.697, 4.76, 5.322]


def run(block: Block, measurement: Block, plant: Block = VAN_DER_POL, **more: Any) -> Result:
    options: dict[str, Any] = {"end": 4, "output_step": 0.005, "step": 0.005} | more
    return simulated(plant, {"B": block}, measurement=measurement, **options)


def mode(found: ObserverResult) -> np.ndarray:
    return np.ravel(found.internal["mode"]).astype(int)


def modes(found: ObserverResult) -> list[np.ndarray]:
    """The estimates of all but the nominal mode."""
    return list(np.moveaxis(np.asarray(found.internal["others"]), 1, 0))


def test_trajectory_computed_elsewhere() -> None:
    result = run(BANK, NOISE, end=10, output_step=1e-3, step=1e-3)
    found = result.observers["B"]
    values = np.column_stack([found.xhat, mode(found), found.internal["eta"]])
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(values[round(1000 * t)], expected, atol=6e-6)
    np.testing.assert_allclose(result.time[np.flatnonzero(np.diff(mode(found))) + 1], SWITCHES, atol=1e-9)


@pytest.mark.measured("measurement2")
@pytest.mark.slow
@pytest.mark.parametrize("measurement", [NOISE, SAMPLED, {**NOISE, "delay": 0.13}])
def test_every_mode_is_the_observer_alone(measurement: Block) -> None:
    """As long as nothing is reset; the estimate is that of the mode; costs as they are integrated from the file."""
    block = {**BANK, "observer": {"type": "fhgo2", "r": 1, "theta": 2}}
    result = run(block, measurement)
    found = result.observers["B"]
    alone = {str(theta): {"type": "fhgo2", "r": 1, "theta": theta} for theta in (2, 8, 1)}
    single = simulated(VAN_DER_POL, alone, end=4, output_step=0.005, step=0.005, measurement=measurement).observers
    np.testing.assert_allclose(modes(found)[0], single["8"].xhat, atol=1e-12)
    np.testing.assert_allclose(modes(found)[1], single["1"].xhat, atol=1e-12)
    every = np.array([single["2"].xhat, *modes(found)])
    np.testing.assert_allclose(found.xhat, every[mode(found), np.arange(len(result.time))], atol=1e-12)
    assert len(set(mode(found))) > 1


@pytest.mark.measured("change0-measurement0")
@pytest.mark.slow
@pytest.mark.parametrize("measurement", [{}, NOISE, SAMPLED, LATE])
@pytest.mark.parametrize("change", [{"thetas": [2]}, {"eps": 1e-9}, {"thetas": [2, 2, 2]}])
def test_a_bank_that_has_no_reason_to_switch_is_the_nominal_observer(change: Block, measurement: Block) -> None:
    """One mode, an eps that no cost reaches, or equal modes."""
    found = run({**BANK, **change}, measurement, end=1).observers["B"]
    assert not np.any(mode(found))
    if measurement is LATE:  # which the standard observer takes into its innovation, and the bank replays
        return
    shgo = run(SHGO, measurement, end=1).observers["B"]
    np.testing.assert_allclose(found.xhat, shgo.xhat, atol=2e-13)


@pytest.mark.measured("change1-measurement0")
@pytest.mark.costly
@pytest.mark.parametrize("measurement", [NOISE, SAMPLED, LATE])
@pytest.mark.parametrize("change", [{}, {"reset": True}, {"eps": 0.7}, {"eps": 1.0}])
def test_after_a_decision_no_mode_costs_much_less(change: Block, measurement: Block) -> None:
    block = {**BANK, **change}
    found = run(block, measurement).observers["B"]
    eta = np.asarray(found.internal["eta"])
    shown = eta[np.arange(len(eta)), mode(found)]
    assert np.all(shown <= eta.min(axis=1) / block.get("eps", 0.9) * (1 + 1e-12))
    assert np.any(np.diff(mode(found))) or change.get("eps") == 0.7


def test_a_reset_takes_the_others_to_the_new_mode_and_leaves_the_nominal_alone() -> None:
    """And a mode that does nothing is of use then."""
    block = {name: value for name, value in BANK.items() if name != "thetas"}
    result = run({**block, "gains": [[2, 1], [6, 12], [0, 0]], "reset": True, "lam2": 1e-3, "eps": 1.0}, NOISE)
    found = result.observers["B"]
    np.testing.assert_allclose(found.internal["eta"][0], 1)
    (first, *_) = np.flatnonzero(np.diff(mode(found))) + 1
    now = mode(found)[first]
    assert now > 0
    for other in modes(found):
        np.testing.assert_array_equal(other[first], found.xhat[first])
    np.testing.assert_array_equal(found.internal["eta"][first, 1], found.internal["eta"][first, 2])
    nominal = run(SHGO, NOISE).observers["B"]
    at_rest = mode(found) == 0
    np.testing.assert_allclose(found.xhat[at_rest], nominal.xhat[at_rest], atol=1e-12)


@pytest.mark.costly
def test_it_takes_plants_that_are_no_chains_and_several_outputs() -> None:
    two = inline({"a": "b", "b": "-a", "c": "-c"}, ["a", "c"])
    for plant, start in ((CONTOIS, {"x1": 1.4, "x2": 14}), (two, {"a": 0})):
        result = run({**BANK, "initial": start, "reset": True}, {}, plant, end=8)
        assert np.max(np.abs(result.observers["B"].xhat[-1] / result.x[-1] - 1)) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("measurement", [NOISE, SAMPLED, LATE])
def test_lanes(measurement: Block) -> None:
    runs = [
        prepare(
            experiment(
                VAN_DER_POL,
                {"B": {**BANK, "initial": {"x1": 1 + 0.2 * k}, "reset": True}},
                end=2,
                step=0.01,
                measurement=measurement,
            )
        )
        for k in range(8)
    ]
    together = integrate_lanes(runs, as_given(runs[0]))
    for lane, one in enumerate(runs):
        assert np.array_equal(together.rows[..., lane], integrate(one, as_given(one)).rows[..., 0])


def test_gains_of_modes_can_be_swept_without_other_equations() -> None:
    first, second = (
        prepare(experiment(VAN_DER_POL, {"B": {**BANK, "thetas": [2, theta], "nu": nu}}))
        for theta, nu in ((5, 1), (7, 2))
    )
    assert first.structure is second.structure


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gains": [[2, 1]]}, "by one of thetas and gains"),
        ({"observer": {"type": "shgoo", "theta": 1}}, "shgoo"),
        ({"observer": {"type": "shgo", "theta": 1, "q": 1}}, "unknown key 'q'"),
        ({"observer": {**SHGO, "initial": {"x1": 1}}}, "initial of all modes is a key of the bank itself"),
        ({"observer": {"type": "ekf", "theta": 1}}, "differential equations alone"),
        ({"observer": {"type": "bank", "observer": SHGO, "thetas": [1]}}, "differential equations alone"),
        (
            {"observer": {"type": "piecewise", "theta_1": 4, "theta_2": 2}},
            "ask nothing of the noise",
        ),
        ({"observer": {**SHGO, "poles": [-1, -2, -3]}}, "mode 0: expected 2 numbers"),
        ({"thetas": [2, -1]}, "thetas"),
        ({"thetas": []}, "thetas"),
        ({"eps": 1.5}, "eps"),
        ({"nu": 0}, "nu"),
        ({"internal": {"mode": 3}}, "the number of a mode, 0 to 2; found 3"),
        ({"internal": {"eta": [1, 0, 1]}}, "costs start above 0"),
        ({"internal": {"others": 1}}, "begin at the initial estimate"),
        ({"coordinates": "canonical"}, "in the plant's coordinates"),
        ({"lam2": -1}, "lam2"),
    ],
)
def test_what_does_not_fit_is_refused(change: Block, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        hgorun.simulate(experiment(VAN_DER_POL, {"B": {**BANK, **change}}))


@pytest.mark.parametrize(
    ("change", "delay", "message"),
    [({}, "0.1 + 0.01*t", "the delay of x1 changes"), ({"reset": True}, "0.1", "begins anew has no past yet")],
)
def test_what_late_continuous_outputs_cannot_be_compared_with_is_refused(
    change: Block, delay: str, message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        prepare(experiment(VAN_DER_POL, {"B": {**BANK, **change}}, measurement={"delay": delay}))


@pytest.mark.parametrize("delay", [0, 0.1])
def test_outputs_that_are_sampled_for_a_time_are_refused(delay: float) -> None:
    """Modes would be compared with a held innovation there, which belongs to none of them."""
    phases = [{"until": 0.5, "sampling": {"period": 0.05}}, {"until": 1, "sampling": "continuous"}]
    with pytest.raises(ConfigError, match="x1 is sampled, and it is continuous in other phases"):
        prepare(experiment(VAN_DER_POL, {"B": BANK}, measurement={"delay": delay, "phases": phases}))


@pytest.mark.costly
def test_one_output_may_be_late_and_another_not() -> None:
    plant = inline({"a": "b", "b": "-a", "c": "-c + a"}, ["a", "c"])
    measurement = {"outputs": {"c": {"delay": 0.2, "noise": sinusoid(0.02, 9)}}}
    options = {"end": 2, "step": 0.005, "measurement": measurement}
    found = simulated(plant, {"B": BANK}, **options).observers["B"]
    single = simulated(plant, {"S": {**SHGO, "theta": 8}}, **options).observers["S"]
    np.testing.assert_allclose(modes(found)[0], single.xhat, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("block", [{"reset": True}, {"observer": {"type": "integral", "theta": 2}, "lam2": 0.1}])
def test_it_keeps_the_contract_with_other_keys(block: Block) -> None:
    check_observer(ContinuousBank, block, plants=[chain(2, "-x1 - x2")])


def test_the_analysis_of_samples_says_that_the_gain_changes_by_decisions() -> None:
    """Its flow between samples is driven by innovations, so that must not be the reason."""
    made = experiment(VAN_DER_POL, {"B": BANK}, end=1, step=0.01, measurement=SAMPLED)
    found = hgorun.analyze(made).observers["B"]
    told = {reason for reason in found.reasons.values() if "samples alone" in reason or "decisions" in reason}
    assert told
    assert all("its gain changes by decisions" in reason for reason in told)
