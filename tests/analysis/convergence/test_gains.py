"""Error matrices against the publications' formulas, Lyapunov matrices against pencil and paper."""

from typing import Any

import examples
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun import Experiment
from hgorun.analysis.convergence import chain_matrices
from hgorun.analysis.convergence.gains import ErrorDynamics, error_dynamics
from hgorun.analysis.convergence.lyapunov import Lyapunov
from hgorun.analysis.linear.linear import Linearisation
from hgorun.analysis.reasons import NoValue
from hgorun.memo import Memo
from hgorun.observers.lowpass import F
from hgorun.simulation.design.design import Design
from hgorun.simulation.simulate import prepare
from hgorun.symbolic.forms import Form
from hgorun.symbolic.matrices import hurwitz_gain


def experiment(n: int, block: dict[str, Any], **plant: Any) -> Experiment:
    return examples.experiment(plant or examples.chain(n, start=0), {"observer": block})


def dynamics(n: int, **block: Any) -> ErrorDynamics:
    made = experiment(n, block)
    return error_dynamics(made.observers["observer"], made.forms["observer"])


def chain(gain: np.ndarray) -> np.ndarray:
    """A - K C."""
    return np.eye(len(gain), k=1) - np.outer(gain, np.eye(len(gain))[0])


def same_spectrum(A: np.ndarray, B: np.ndarray) -> bool:
    """By characteristic polynomials: eigenvalues of multiple poles lose digits."""
    return A.shape == B.shape and bool(np.allclose(np.poly(A), np.poly(B), rtol=1e-9, atol=1e-9))


@pytest.mark.parametrize("n", [2, 3, 5])
def test_standard_observer(n: int) -> None:
    found = dynamics(n, type="shgo", theta=7, poles=-2)
    G = hurwitz_gain(n, -2)
    assert np.allclose(found.A, chain(G), rtol=1e-12)
    assert np.allclose(found.B.ravel(), G, rtol=1e-12)
    assert found.powers.tolist() == list(range(n))
    assert np.array_equal(found.flux, np.eye(n, k=1)[:1])


@pytest.mark.parametrize("r", [1, 2, 3])
@pytest.mark.parametrize("n", [2, 3])
def test_filtered_observer_is_a_chain_of_order_r_plus_n(n: int, r: int) -> None:
    """(3.37), (3.39), the filter first."""
    found = dynamics(n, type="fhgo2", theta=7, r=r)
    order = [*range(n, n + r), *range(n)]
    assert np.allclose(found.A[np.ix_(order, order)], chain(hurwitz_gain(n + r, -1)), rtol=1e-12)
    assert np.allclose(found.B[order].ravel(), -np.eye(n + r)[r - 1])  # of v, and e = C xhat - x_1 - v
    assert found.powers[order].tolist() == [0] * r + list(range(n))


def test_the_integral_observer_is_the_filtered_one_in_other_coordinates() -> None:
    """eta_j^(3.33) = theta^(r+1-j) eta_j^(3.32)."""
    one, other = dynamics(3, type="integral", theta=7, r=2), dynamics(3, type="fhgo2", theta=7, r=2)
    assert np.allclose(one.A, other.A)
    assert one.powers.tolist() == [0, 1, 2, -2, -1]


def test_other_families() -> None:
    G = hurwitz_gain(3, -1)
    assert same_spectrum(dynamics(3, type="lowpass", theta=3, r=2, rho=0.1).A, F(0.1, 2, G))
    found = dynamics(3, type="treangle", theta=3)
    K, D, A, C = np.diag([3.0, 3, 1]), 2 * np.eye(3), np.eye(3, k=1), np.eye(3)[:1]
    assert same_spectrum(found.A, np.block([[A, -K], [C.T @ C, -D + A.T]]))  # M_n, all poles at -1
    assert found.powers.tolist() == [0, 1, 2, 0, 1, 2]
    assert same_spectrum(dynamics(4, type="low_power", theta=3).A, -np.eye(6) + np.eye(6, k=1))
    assert same_spectrum(dynamics(2, type="hgo_fd", eps=0.1, gains=[2, 2]).A, chain(np.array([2.0, 2.0])))


@pytest.mark.parametrize(
    ("block", "order"),
    [
        ({"type": "shgo_riccati"}, 3),
        ({"type": "shgo_riccati", "equation": "lyapunov"}, 3),
        ({"type": "fhgo2_nuos", "r": 2}, 5),
        ({"type": "fhgo2_nuos", "r": 2, "gain": "full"}, 5),
    ],
)
def test_riccati_gains_settle_to_binomials_on_a_chain(block: dict[str, Any], order: int) -> None:
    found = dynamics(3, theta=4, **block)
    assert same_spectrum(found.A, chain(hurwitz_gain(order, -1)))
    assert np.all(found.lyapunov.poles == -1)


@pytest.mark.parametrize("delta", [1, 4, 7.5])
def test_fhgo1_on_a_chain(delta: float) -> None:
    """(s^2 + delta s + delta)^n."""
    found = dynamics(3, type="fhgo1", theta=4, delta=delta)
    expected = np.poly(np.resize(np.roots([1, delta, delta]), 6))
    assert np.allclose(np.poly(found.A), expected, rtol=1e-9)
    assert np.allclose(np.poly(found.lyapunov.poles), expected, rtol=1e-9)


@pytest.mark.parametrize(
    "block",
    [
        {"type": "shgo"},
        {"type": "fhgo2", "r": 2},
        {"type": "integral", "r": 2},
        {"type": "lowpass", "r": 2, "rho": 0.1},
        {"type": "treangle"},
        {"type": "low_power"},
    ],
)
@pytest.mark.parametrize("theta", [0.5, 3.0, 11.0])
def test_theta_scales_the_error_that_the_run_has(block: dict[str, Any], theta: float) -> None:
    """T A(theta) T^-1 = theta A~, T = diag(theta^-s), with A(theta) from the run's own equations."""
    made = experiment(3, {"theta": theta, **block})
    found = error_dynamics(made.observers["observer"], made.forms["observer"])
    run = Linearisation(prepare(made), "observer")
    T = found.scale(theta)
    A = run.at(0.0, np.zeros(run.size)).A
    assert np.allclose(T[:, None] * A / T, theta * found.A, rtol=1e-9, atol=1e-9 * theta)
    assert np.allclose(T[:, None] * run.at(0.0, np.zeros(run.size)).B, theta * found.B, rtol=1e-9)


def test_several_chains() -> None:
    made = Experiment(
        {
            "time": {"end": 1, "output_step": 0.1},
            "plant": {
                "states": ["a1", "b1", "a2"],
                "dynamics": {"a1": "a2", "a2": "-a1", "b1": "-b1"},
                "output": ["a1", "b1"],
                "initial": {"a1": 0, "a2": 0, "b1": 0},
            },
            "observers": {"observer": {"type": "shgo", "theta": 3}},
        }
    )
    found = error_dynamics(made.observers["observer"], made.forms["observer"])
    assert found.A.shape == (3, 3)
    assert found.B.shape == (3, 2)
    assert sorted(found.powers.tolist()) == [0, 0, 1]
    assert same_spectrum(found.A, -np.eye(3) + np.eye(3, k=1))


def test_what_has_no_constant_matrix_says_so() -> None:
    made = experiment(3, {"type": "shgo_riccati", "theta": 3}, type="academic", initial={"x1": 1, "x2": 1, "x3": 1})
    with pytest.raises(NoValue, match="follows F"):
        error_dynamics(made.observers["observer"], made.forms["observer"])


def test_lyapunov_matrix_by_hand() -> None:
    """n = 2, poles -1: P = [[1, -1], [-1, 3]], eigenvalues 2 +- sqrt 2."""
    found = dynamics(2, type="shgo", theta=5).lyapunov
    assert np.allclose(found.P, [[1, -1], [-1, 3]], rtol=1e-12)
    assert found.beta == pytest.approx(1 / (2 * (2 + np.sqrt(2))), rel=1e-12)
    assert found.chi == pytest.approx(3 + 2 * np.sqrt(2), rel=1e-12)
    assert found.poles.tolist() == [-1, -1]
    assert found.hurwitz


@pytest.mark.costly
@given(st.floats(0.1, 10), st.floats(0.1, 10))
def test_lyapunov_matrix_of_two_gains(g1: float, g2: float) -> None:
    """P of [[-g1, 1], [-g2, 0]]: p12 = -1, p11 = (1 + g2)/g1, p22 = (p11 + g1)/g2."""
    found = Lyapunov(np.array([[-g1, 1.0], [-g2, 0.0]]))
    p11 = (1 + g2) / g1
    assert np.allclose(found.P, [[p11, -1], [-1, (p11 + g1) / g2]], rtol=1e-9)


@pytest.mark.parametrize(("n", "expected"), [(2, (0.14645, 5.828)), (3, (0.057640, 22.065)), (4, (0.021067, 82.783))])
def test_lyapunov_matrices_of_binomial_gains(n: int, expected: tuple[float, float]) -> None:
    """The same for every division of the order among filter and plant."""
    for r in range(n):
        found = dynamics(n - r, type="fhgo2", theta=1, r=r).lyapunov if n - r > 1 else None
        if found is not None:
            assert (found.beta, found.chi) == pytest.approx(expected, rel=1e-4)


def test_a_long_filter_still_has_one() -> None:
    found = dynamics(2, type="fhgo2", theta=1, r=8).lyapunov
    assert np.allclose(found.P @ found.A + found.A.T @ found.P, -2 * np.eye(10), atol=1e-4)
    assert found.beta > 0


def test_no_lyapunov_matrix_without_decay() -> None:
    found = Lyapunov(np.array([[0.0, 1.0], [-1.0, 0.0]]))
    assert not found.hurwitz
    with pytest.raises(NoValue, match="not Hurwitz"):
        _ = found.beta


def test_equations_are_derived_once_for_all_poles_and_theta(monkeypatch: pytest.MonkeyPatch) -> None:
    """But not for another order."""
    derived, real = list[object](), chain_matrices._derived

    def counted(design: Design, form: Form, outputs: int) -> chain_matrices._Equations:
        derived.append(design)
        return real(design, form, outputs)

    monkeypatch.setattr(chain_matrices, "_derived", counted)
    for name in ("_EQUATIONS", "_LINEAR"):
        monkeypatch.setattr(chain_matrices, name, Memo[Any](8))
    for poles in ([-1, -2, -3], [-2, -0.5, -4]):
        found = dynamics(3, type="shgo", theta=7, poles=poles)
        assert np.allclose(np.poly(found.A), np.poly(np.array(poles, dtype=float)), rtol=1e-12)
    assert len(derived) == 1
    for r in (1, 2):
        assert np.allclose(np.poly(dynamics(2, type="fhgo2", theta=3, r=r, poles=-2).A), np.poly(np.full(2 + r, -2.0)))
    assert len(derived) == 3
