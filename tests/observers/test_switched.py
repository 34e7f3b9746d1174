"""The observer that switches between two gains, and decisions at the ends of steps in all ways to integrate."""

from __future__ import annotations

import numpy as np
import pytest
from examples import Block, experiment, inline, simulated, sinusoid
from scipy.linalg import expm

from hgorun.errors import ConfigError
from hgorun.export.prepared import exported
from hgorun.simulation.checks.checks import longest_step
from hgorun.simulation.passes.passes import as_given, integrate, integrate_lanes
from hgorun.simulation.preparation.preparation import prepare

VAN_DER_POL: Block = {"type": "van_der_pol", "parameters": {"mu": 0.5}, "initial": {"x1": 1, "x2": 0}}
SWITCHED: Block = {"type": "switched", "theta_1": 20, "theta_2": 4, "delta": 0.05, "dwell": 0.1}
NOISE: Block = {"noise": sinusoid(0.02, 40)}
OUTLIER: Block = {"sampling": {"period": 0.1}, "noise": [{"type": "expression", "value": "where(k == 20, 1, 0)"}]}

# an independent simulator, RK4 with steps of 1e-3; t: xhat_1, xhat_2, mode
TRAJECTORY = {
    0.1: (1.13098, 5.24670, 1),
    0.2: (1.04613, 1.37053, 1),
    0.5: (0.89434, -0.33058, 2),
    1: (0.53173, -0.87979, 2),
    2: (-0.75207, -1.40179, 2),
    5: (0.73442, 1.94687, 2),
}


def test_trajectory_computed_elsewhere() -> None:
    result = simulated(VAN_DER_POL, {"S": SWITCHED}, end=5, output_step=1e-3, step=1e-3, measurement=NOISE)
    found = result.observers["S"]
    values = np.column_stack([found.xhat, found.internal["mode"]])
    for t, expected in TRAJECTORY.items():
        np.testing.assert_allclose(values[round(1000 * t)], expected, atol=6e-6)
    (switch,) = np.flatnonzero(np.diff(found.internal["mode"])) + 1
    assert result.time[switch] == pytest.approx(0.287)


def test_between_switches_the_error_is_one_of_two_linear_systems() -> None:
    """CHAIN0: products of exp(M_q dt) with the recorded modes."""
    block = {
        "type": "switched",
        "theta_1": 6,
        "theta_2": 2,
        "delta": 0.3,
        "dwell": 0.05,
        "initial": {"x1": 3, "x2": -60},
    }
    result = simulated(inline({"x1": "x2", "x2": "0"}, "x1", 0.0), {"S": block}, end=4, output_step=0.005, step=0.005)
    found = result.observers["S"]
    mode = np.ravel(found.internal["mode"])
    assert np.count_nonzero(np.diff(mode)) >= 2  # back and forth
    M = {q: np.array([[-2 * theta, 1], [-(theta**2), 0]]) for q, theta in ((1, 6.0), (2, 2.0))}
    e = found.xhat[0]
    for k in range(len(mode) - 1):
        e = expm(M[int(mode[k])] * 0.005) @ e
    np.testing.assert_allclose(found.xhat[-1], e, atol=1e-7)  # RK4 with this step: the modes are those of the steps


def test_an_outlier_switches_at_its_arrival_and_calm_brings_the_slow_gain_back() -> None:
    block = {**SWITCHED, "theta_1": 6, "theta_2": 2, "delta": 0.3, "dwell": 0.45, "initial": {"x1": 1, "x2": 0}}
    result = simulated(VAN_DER_POL, {"S": block}, end=4, output_step=0.01, step=0.01, measurement=OUTLIER)
    mode = np.ravel(result.observers["S"].internal["mode"])
    at = {float(t): int(q) for t, q in zip(result.time.round(3), mode, strict=True)}
    assert at[0.44] == 1
    assert at[0.45] == 2  # calm from the start
    assert at[1.99] == 2
    assert at[2.0] == 1  # with the sample
    back = next(t for t, q in at.items() if t > 2 and q == 2)
    assert 2.1 + 0.45 <= back + 1e-9 < 3.2


@pytest.mark.parametrize(
    "solver",
    [{"method": "dopri5", "rtol": 1e-9, "max_step": 1e-3}, {"method": "rodas5p", "rtol": 1e-8, "max_step": 1e-3}, {}],
)
def test_other_methods_decide_alike(solver: Block) -> None:
    more: Block = {"solver": solver} if solver else {}
    found = simulated(VAN_DER_POL, {"S": SWITCHED}, end=2, measurement=NOISE, **more).observers["S"]
    assert found.status == "ok"
    for t in (0.1, 0.5, 1, 2):
        np.testing.assert_allclose(found.xhat[round(10 * t)], TRAJECTORY[t][:2], atol=6e-3)


@pytest.mark.parametrize(
    "measurement", [NOISE, OUTLIER, {**NOISE, "delay": 0.013}, {**OUTLIER, "delay": 0.05}], ids=["a", "b", "c", "d"]
)
def test_lanes_decide_for_themselves(measurement: Block) -> None:
    """Eight starts, whose switches fall at other times."""
    runs = [
        prepare(
            experiment(
                VAN_DER_POL,
                {"S": {**SWITCHED, "theta_1": 6, "theta_2": 2, "initial": {"x1": 1 + 0.3 * k, "x2": -k}}},
                end=3,
                output_step=0.01,
                step=0.005,
                measurement=measurement,
            )
        )
        for k in range(8)
    ]
    together = integrate_lanes(runs, as_given(runs[0]))
    modes = set()
    for lane, run in enumerate(runs):
        alone = integrate(run, as_given(run))
        assert np.array_equal(together.rows[..., lane], alone.rows[..., 0])
        modes.add(alone.rows[:, 4, 0].tobytes())
    assert len(modes) > 2


def test_a_gain_that_never_switches_is_the_standard_observer() -> None:
    blocks = {
        "never": {**SWITCHED, "delta": 1e-9},
        "fast": {"type": "shgo", "theta": 20},
        "at once": {**SWITCHED, "delta": 1e9, "dwell": 0},
        "slow": {"type": "shgo", "theta": 4},
    }
    found = simulated(VAN_DER_POL, blocks, end=2, step=1e-3, measurement={**NOISE, "delay": 0.01}).observers
    np.testing.assert_allclose(found["never"].xhat, found["fast"].xhat, atol=1e-12)
    np.testing.assert_allclose(found["at once"].xhat, found["slow"].xhat, atol=1e-12)


def test_steps_that_are_too_long_for_decisions_are_refused_or_not_taken() -> None:
    with pytest.raises(ConfigError, match=r"decides at the ends of steps, which must not be longer than 0\.01"):
        prepare(experiment(VAN_DER_POL, {"S": SWITCHED}, step=0.02))
    with pytest.raises(ConfigError, match=r"internal\.mode: expected 1, the fast gain, or 2, the slow one; found 3"):
        prepare(experiment(VAN_DER_POL, {"S": {**SWITCHED, "internal": {"mode": 3}}}))
    with pytest.raises(ConfigError, match="must be above theta_2"):
        prepare(experiment(VAN_DER_POL, {"S": {**SWITCHED, "theta_1": 2}}))
    run = prepare(experiment(VAN_DER_POL, {"S": {**SWITCHED, "theta_1": 0.2, "theta_2": 0.1}}, end=5))
    assert longest_step(run, 1.0) == longest_step(run, 1.0, adaptive=True) == pytest.approx(0.01)


def test_exported_code_has_no_place_for_decisions() -> None:
    run = prepare(experiment(VAN_DER_POL, {"S": SWITCHED}, step=0.01, measurement={"sampling": {"period": 0.1}}))
    with pytest.raises(ConfigError, match="no place in it for decisions"):
        exported(run)
