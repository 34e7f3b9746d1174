"""The dynamic gain: its equilibrium, its special case, and the matrix behind its constants.

Its trajectories are compared with a loop in test_direct.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from examples import VAN_DER_POL, chain, simulated

import hgorun
from hgorun.analysis.papers.lmi import certificate
from hgorun.errors import ConfigError

BLOCK = {"type": "dynamic_gain", "l": [2, 1], "a": 1.06, "b": 2.3, "q": 0.15, "gamma": "0.5*y**2"}


def simulate(observers: dict[str, Any], plant: dict[str, Any], end: float = 10.0) -> hgorun.Result:
    return simulated(plant, observers, end=end, output_step=0.01, step=1e-3)


@pytest.mark.parametrize(("a", "b"), [(1.17, 2.42), (1.06, 2.3)], ids=["b = 2.42 repairs it", "a = 1.06 repairs it"])
def test_the_certificate_satisfies_the_inequalities(a: float, b: float) -> None:
    Q = certificate((2, 1), a, b, 0.15).Q
    assert Q is not None
    closed, Delta = np.array([[-2.0, 1], [-1, 0]]), np.diag([0.0, 1])
    both = Q @ Delta + Delta @ Q
    for M in (
        -(Q @ closed + closed.T @ Q) - a * Q,
        Q - 0.15 * np.eye(2),
        np.eye(2) - Q,
        b * Q - both,
        b * Q + both,
    ):
        np.testing.assert_allclose(M, M.T)
        assert np.linalg.eigvalsh(M).min() >= 0


@pytest.mark.costly
def test_no_certificate_for_the_constants_in_print() -> None:
    """And an independent search agrees: on a grid of all Q with q I <= Q <= I none comes near."""
    a, b, q = 1.17, 2.3, 0.15
    assert certificate((2, 1), a, b, q).feasible is False
    x, y, z = np.meshgrid(np.linspace(q, 1, 80), np.linspace(-1, 1, 80), np.linspace(q, 1, 80), indexing="ij")
    Q = np.stack([np.stack([x, y], -1), np.stack([y, z], -1)], -2).reshape(-1, 2, 2)
    closed, Delta, eye = np.array([[-2.0, 1], [-1, 0]]), np.diag([0.0, 1]), np.eye(2)
    both = Q @ Delta + Delta @ Q
    conditions = (-(Q @ closed + closed.T @ Q) - a * Q, Q - q * eye, eye - Q, b * Q - both, b * Q + both)
    assert np.min([np.linalg.eigvalsh(M)[:, 0] for M in conditions], axis=0).max() < -1e-3


@pytest.mark.slow
@pytest.mark.parametrize("gains", [(3, 3, 1), (4, 6, 4, 1)])
def test_certificates_of_higher_order(gains: tuple[float, ...]) -> None:
    """For some a, b, q there is always one [Praly]; with a twice the decay rate of A - l c there is none."""
    n = len(gains)
    Q = certificate(gains, 0.1, 20, 5e-4).Q
    assert Q is not None
    closed = np.eye(n, k=1) - np.outer(gains, np.eye(n)[0])
    assert np.linalg.eigvalsh(Q @ closed + closed.T @ Q + 0.1 * Q).max() <= 0
    assert certificate(gains, 2.1, 20, 5e-4).feasible is False


def test_at_constant_output_theta_goes_to_its_equilibrium() -> None:
    plant = chain(2, start=[2, 0])
    result = simulate({"o": {**BLOCK, "initial": {"x1": 2}}}, plant, 60)
    expected = 1 + 6 * 0.5 * 2**2 / (1.06 * np.sqrt(0.15))
    assert result.observers["o"].internal["theta"][-1] == pytest.approx(expected, rel=1e-6)


def test_without_gamma_theta_stays_at_one() -> None:
    """Then it is the observer with constant gain."""
    constant = {"type": "direct", "theta": 1, "poles": -1}
    result = simulate({"dynamic": {**BLOCK, "gamma": "0"}, "constant": constant}, VAN_DER_POL)
    np.testing.assert_allclose(
        result.observers["dynamic"].xhat, result.observers["constant"].xhat, rtol=1e-12, atol=1e-14
    )


def test_converges_with_a_certified_gain() -> None:
    """van der Pol: |g_2(x_1, x_2 + xi) - g_2(x_1, x_2)| = 0.5 |1 - y^2| |xi|, so this gamma fulfils (6)."""
    block = {**BLOCK, "gamma": "0.5*abs(1 - y**2)"}
    result = simulate({"o": block}, VAN_DER_POL, 30)
    assert np.abs(result.observers["o"].xhat - result.x)[-1].max() < 1e-6
    assert result.observers["o"].internal["theta"].min() >= 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"internal": {"theta": 0.5}}, "1 or above, found 0.5"),
        ({"gamma": "4*x"}, "`x` is not known"),
        ({"q": 2}, "a number of at most 1"),
    ],
)
def test_keys_that_do_not_fit(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        simulate({"o": {**BLOCK, **change}}, VAN_DER_POL, 0.1)
