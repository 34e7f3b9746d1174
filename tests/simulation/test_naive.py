"""The oracle itself: its order, and its numbers against solve_ivp, expm and published limits."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from naive import Field, Run, Vector, binomial_gains, breakpoints, simulate, step_count
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq


def uniform(bound: float, count: int) -> Vector:
    return np.random.default_rng(count).uniform(-bound, bound, count)


def first(x: Vector) -> float:
    return float(x[0])


# ---- plants ----


def van_der_pol_copy(t: float, x: Vector) -> Vector:
    return np.array([x[1], 0.5 * (1 - x[0] ** 2) * x[1] - x[0]])


def van_der_pol(t: float, x: Vector) -> Vector:
    return van_der_pol_copy(t, x) + np.array([0.0, 0.2 * np.sin(0.7 * t)])


def observe_van_der_pol(**options: Any) -> Run:
    options = {"theta": 1.5, "gains": 1.0, **options}
    return simulate(van_der_pol, first, van_der_pol_copy, [1.0, 0.5], [0.0, 0.0], **options)


class Contois:
    """The bioreactor in its own coordinates, and in z = (x_1, growth term), where it is a chain."""

    mu, k_c, s_in = 1.064, 4.39, 20.0

    def __init__(self, rate: Callable[[float], float] = lambda t: 1.064 * (1 - np.sin(t) / 2)) -> None:
        self.rate = rate

    def f(self, t: float, x: Vector) -> Vector:
        g, D = self.growth(x), self.rate(t)
        return np.array([g - D * x[0], -g + D * (self.s_in - x[1])])

    def growth(self, x: Vector) -> float:
        return self.mu * x[0] * x[1] / (self.k_c * x[0] + x[1])

    def jacobian(self, x: Vector) -> Vector:
        q = (self.k_c * x[0] + x[1]) ** 2
        return np.array([[1.0, 0.0], [self.mu * x[1] ** 2 / q, self.mu * self.k_c * x[0] ** 2 / q]])

    def jinv(self, x: Vector) -> Vector:
        return np.asarray(np.linalg.inv(self.jacobian(x)), dtype=float)

    def to_z(self, x: Vector) -> Vector:
        return np.array([x[0], self.growth(x)])

    def to_x(self, z: Vector) -> Vector:
        return np.array([z[0], self.k_c * z[0] * z[1] / (self.mu * z[0] - z[1])])

    def f_z(self, t: float, z: Vector) -> Vector:
        x = self.to_x(z)
        return self.jacobian(x) @ self.f(t, x)

    def observe(self, **options: Any) -> Run:
        options = {"gains": 1.0, "jinv": self.jinv, **options}
        return simulate(self.f, first, self.f, [1.5, 15.0], [1.0, 14.0], **options)


# ---- references: the observer again, in matrices, with e_y given ----


def chain_matrix(k: int) -> Vector:
    return np.eye(k, k=1)


def observer_matrix(n: int, r: int, theta: float, pole: float = 1.0) -> tuple[Vector, Vector, float]:
    """M, b: (eta, xhat)' = M (eta, xhat) + b e_y for xhat' = A_n xhat - kappa; and the row of kappa_1."""
    gain = np.array(binomial_gains(r + n, pole))
    inverse_delta = np.diag(theta ** np.arange(n))
    M, b = np.zeros((r + n, r + n)), np.zeros(r + n)
    M[r:, r:] = chain_matrix(n)
    kappa = theta * inverse_delta @ gain[r:]
    if r == 0:
        return M, -kappa, 0.0
    M[:r, :r] = theta * (chain_matrix(r) - np.outer(gain[:r], np.eye(r)[0]))
    M[r:, 0] = -kappa
    b[r - 1] = theta
    return M, b, kappa[0]


def right_side(
    f: Field, fhat: Field, theta: float, r: int, n: int, jinv: Callable[[Vector], Vector] | None = None
) -> Callable[[float, Vector, float], Vector]:
    """z' of z = (x, xhat, eta, alpha) as a function of t, z and e_y."""
    gain = np.array(binomial_gains(r + n))
    filter_matrix = chain_matrix(r) - np.outer(gain[:r], np.eye(r)[:1])

    def rhs(t: float, z: Vector, e_y: float) -> Vector:
        x, xhat, eta = z[:n], z[n : 2 * n], z[2 * n : 2 * n + r]
        source = eta[0] if r else e_y
        kappa = theta * np.diag(theta ** np.arange(n)) @ gain[r:] * source
        deta = theta * (filter_matrix @ eta + np.eye(r)[-1] * e_y) if r else []
        J_inverse = np.eye(n) if jinv is None else jinv(xhat)
        return np.hstack([f(t, x), fhat(t, xhat) - J_inverse @ kappa, deta, -kappa[0]])

    return rhs


def integrate(rhs: Callable[[float, Vector], Vector], z0: Vector, t0: float, t1: float, **options: Any) -> Any:
    return solve_ivp(rhs, (t0, t1), z0, method="DOP853", rtol=1e-12, atol=1e-13, **options)


def stacked(result: Run) -> Vector:
    return np.column_stack([result["x"], result["xhat"], result["eta"], result["alpha"]])


# ---- order ----

SAMPLES = 0.4 * np.arange(16)
SCENARIOS = {
    "continuous": {"noise": lambda t, mid: 0.1 * np.sin(3 * t)},
    "sampled": {"sampling": SAMPLES, "noise": 0.1 * np.sin(3 * SAMPLES)},
    "sampled, delays, out of order": {
        "sampling": SAMPLES,
        "delay": 0.1 * np.random.default_rng(1).integers(0, 10, 16),
        "noise": 0.1 * np.sin(3 * SAMPLES),
    },
    "constant delay": {"delay": 0.25, "noise": lambda t, mid: 0.1 * np.sin(3 * t)},
    "varying delay": {
        "delay": lambda t: 0.25 + 0.1 * np.sin(t),
        "noise": lambda t, mid: 0.1 * np.sin(3 * t),
    },
}


def order_of(run: Callable[[float], Vector], steps: Sequence[float]) -> float:
    """Slope of log2 of the differences between runs, the step being halved each time."""
    errors = [np.abs(a - b).max() for a, b in pairwise([run(step) for step in steps])]
    return -np.polyfit(range(len(errors)), np.log2(errors), 1)[0]


@pytest.mark.slow
@pytest.mark.one_in(2)
@pytest.mark.parametrize("r", [0, 1, 2, 3])
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_order_four(scenario: str, r: int) -> None:
    def run(step: float) -> Vector:
        options = SCENARIOS[scenario] | {"r": r, "t_end": 6.0, "output_times": [6.0]}
        return stacked(observe_van_der_pol(step=step, **options))

    assert order_of(run, [0.05, 0.025, 0.0125, 0.00625]) == pytest.approx(4.0, abs=0.1)


def test_euler_is_of_order_one() -> None:
    def run(step: float) -> Vector:
        return stacked(observe_van_der_pol(r=1, t_end=3.0, step=step, output_times=[3.0], method="euler"))

    assert order_of(run, [0.01, 0.005, 0.0025]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.costly
def test_output_between_steps_is_of_order_four() -> None:
    out = np.linspace(0, 6, 2001)

    def run(step: float) -> Vector:
        return stacked(observe_van_der_pol(r=2, t_end=6.0, step=step, output_times=out, **SCENARIOS["sampled"]))

    assert order_of(run, [0.05, 0.025, 0.0125, 0.00625]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.slow
def test_kinks_and_held_noise_keep_order_four_when_they_are_events() -> None:
    """|sin| in the plant, noise held for 0.5, and a delay through which both come back."""
    plant = Contois(lambda t: 1.064 * (1 - abs(np.sin(np.pi * t / 2.35)) / 2))
    draws = uniform(0.2, 10)
    holds = 0.5 * np.arange(1, 10)
    kinks_and_holds = [*holds, 2.35, 4.7]

    def run(step: float, events: Any = kinks_and_holds) -> Vector:
        options: dict[str, Any] = {"theta": 1.0, "r": 0, "t_end": 5.0, "delay": 0.2, "output_times": [5.0]}
        options["noise"] = lambda t, mid: draws[int(mid / 0.5)]
        return stacked(plant.observe(step=step, events=events, **options))

    assert order_of(run, [0.025, 0.0125, 0.00625, 0.003125]) == pytest.approx(4.0, abs=0.1)
    exact = run(0.0125)
    assert np.abs(run(0.1, holds) - exact).max() > 5 * np.abs(run(0.1) - exact).max()


# ---- references ----


@pytest.mark.slow
@pytest.mark.parametrize("r", [0, 1, 2, 3])
def test_continuous_contois_against_dop853(r: int) -> None:
    plant = Contois()
    out = np.linspace(0, 8, 17)
    options: dict[str, Any] = {"theta": 2.0, "r": r, "t_end": 8.0, "step": 0.004, "output_times": out}
    result = plant.observe(noise=lambda t, mid: 0.1 * np.sin(5 * t), **options)
    rhs = right_side(plant.f, plant.f, 2.0, r, 2, plant.jinv)

    def closed(t: float, z: Vector) -> Vector:
        return rhs(t, z, z[2] - z[0] - 0.1 * np.sin(5 * t))

    exact = integrate(closed, np.r_[1.5, 15, 1, 14, np.zeros(r + 1)], 0, 8, t_eval=out).y.T
    np.testing.assert_allclose(stacked(result), exact, atol=1e-7, rtol=0)


@pytest.mark.costly
@pytest.mark.parametrize("r", [0, 2])
def test_original_coordinates_are_the_chain_seen_through_phi(r: int) -> None:
    plant = Contois()
    options: dict[str, Any] = {"theta": 2.0, "r": r, "t_end": 5.0, "step": 0.01, "output_times": [1.0, 3.0, 5.0]}
    options |= {"sampling": 0.25 * np.arange(21), "delay": 0.1, "noise": uniform(0.1, 21)}
    x = plant.observe(**options)
    z0, zhat0 = (plant.to_z(np.array(x)) for x in ([1.5, 15.0], [1.0, 14.0]))
    z = simulate(plant.f_z, first, plant.f_z, z0, zhat0, gains=1.0, **options)
    np.testing.assert_allclose([plant.to_z(p) for p in x["xhat"]], z["xhat"], atol=1e-7, rtol=0)


@pytest.mark.costly
def test_delayed_nonlinear_output_in_two_coordinates() -> None:
    """z_1 = w_1 + w_1^3/10: the interpolated past of h(w) needs dh, that of z_1 does not."""

    def to_z(w: Vector) -> Vector:
        return np.array([w[0] + w[0] ** 3 / 10, w[1]])

    def slope(w: Vector) -> float:
        return 1 + 0.3 * w[0] ** 2

    def in_w(field: Field) -> Field:
        return lambda t, w: field(t, to_z(w)) / np.array([slope(w), 1.0])

    options: dict[str, Any] = {"theta": 1.5, "gains": 1.0, "r": 1, "t_end": 4.0, "step": 0.01}
    options |= {"delay": lambda t: 0.2 + 0.05 * np.sin(t), "noise": lambda t, mid: 0.1 * np.sin(3 * t)}
    options["output_times"] = [1.0, 2.5, 4.0]
    curved: dict[str, Any] = {"dh": lambda w: np.array([slope(w), 0.0]), "jinv": lambda w: np.diag([1 / slope(w), 1.0])}
    fields = in_w(van_der_pol), lambda w: float(to_z(w)[0]), in_w(van_der_pol_copy)
    x0, xhat0 = np.array([0.8, 0.5]), np.array([0.1, 0.0])
    f, h, fhat = fields
    w = simulate(f, h, fhat, x0, xhat0, **curved, **options)
    z = simulate(van_der_pol, first, van_der_pol_copy, to_z(x0), to_z(xhat0), **options)
    np.testing.assert_allclose([to_z(p) for p in w["xhat"]], z["xhat"], atol=1e-8, rtol=0)


PHI = np.array([[0.0, 0, 0], [0, 0, 0], [-1, -2, -2]])
CHAIN = chain_matrix(3) + PHI
X0, XHAT0 = [1.0, -0.5, 0.3], [0.2, 0.0, -0.4]


def linear(t: float, x: Vector) -> Vector:
    return CHAIN @ x


def observe_linear(**options: Any) -> Run:
    return simulate(linear, first, linear, X0, XHAT0, gains=1.0, **options)


def augmented(n: int, r: int, theta: float) -> tuple[Vector, Vector]:
    """z' = M z + b e_y with z = (x, xhat, eta, alpha) for the linear plant above."""
    size = 2 * n + r + 1
    M, b = np.zeros((size, size)), np.zeros(size)
    block, input_, k1 = observer_matrix(n, r, theta)
    order = [*range(2 * n, 2 * n + r), *range(n, 2 * n)]  # (eta, xhat) in z
    M[np.ix_(order, order)] = block
    M[:n, :n] = CHAIN
    M[n : 2 * n, n : 2 * n] += PHI
    b[order] = input_
    if r:
        M[-1, 2 * n] = -k1
    else:
        b[-1] = b[n]
    return M, b


def unit(size: int, *where: tuple[int, float]) -> Vector:
    row = np.zeros(size)
    for i, sign in where:
        row[i] = sign
    return row


@pytest.mark.parametrize("r", [0, 1, 2, 3])
def test_linear_continuous_is_the_rk4_polynomial_and_near_expm(r: int) -> None:
    M, b = augmented(3, r, 2.0)
    M = M + np.outer(b, unit(len(b), (3, 1), (0, -1)))
    z0 = np.r_[X0, XHAT0, np.zeros(r + 1)]
    result = stacked(observe_linear(theta=2.0, r=r, t_end=2.0, step=0.02, output_times=[2.0]))[0]
    w = 0.02 * M
    polynomial = np.eye(len(b)) + w + w @ w / 2 + w @ w @ w / 6 + w @ w @ w @ w / 24
    np.testing.assert_allclose(result, np.linalg.matrix_power(polynomial, 100) @ z0, atol=1e-12)
    np.testing.assert_allclose(result, expm(2 * M) @ z0, atol=2e-5)


@pytest.mark.parametrize("r", [0, 2])
def test_linear_sampled_with_delays_against_expm(r: int) -> None:
    """Between arrivals the innovation is a held number plus alpha: (z, held) is linear, expm exact."""
    times = np.array([0.05, 0.3, 0.7, 0.8, 1.3, 1.5])
    delays = np.array([0.2, 0.1, 0.3, 0.6, 0.0, 0.35])  # the 4th and the last are older than what is known
    used = [0, 1, 2, 4]
    noise = uniform(1.0, 6)
    M, b = augmented(3, r, 2.0)
    size = len(b)
    M = M + np.outer(b, unit(size, (-1, 1)))

    def go(z: Vector, held: float | None, gap: float) -> Vector:
        if held is None:  # nothing has arrived: no innovation
            A, offset = augmented(3, r, 2.0)[0], np.zeros(size)
        else:
            A, offset = M, b * held
        lifted = np.block([[A, offset[:, None]], [np.zeros((1, size + 1))]])
        return (expm(lifted * gap) @ np.r_[z, 1.0])[:size]

    pieces: list[tuple[float, Vector, float | None]] = []  # start, z there, held
    t, z, held = 0.0, np.r_[X0, XHAT0, np.zeros(r + 1)], None
    for k in used:
        pieces.append((t, z, held))
        taken = max(times[k] - delays[k], 0.0)
        z = go(z, held, times[k] - t)
        t = times[k]
        started = [p for p in pieces if p[0] <= taken][-1]
        old = go(started[1], started[2], taken - started[0])
        held = (old[3] - old[-1]) - (old[0] + noise[k])
    exact = go(z, held, 2.0 - t)
    options: dict[str, Any] = {"theta": 2.0, "r": r, "t_end": 2.0, "step": 0.005, "output_times": [2.0]}
    result = observe_linear(sampling=times, delay=delays, noise=noise, **options)
    np.testing.assert_allclose(stacked(result)[0], exact, atol=1e-7)
    np.testing.assert_allclose(result["taken"], np.maximum(times - delays, 0))


@pytest.mark.parametrize("r", [0, 2])
def test_linear_constant_delay_against_expm_of_the_method_of_steps(r: int) -> None:
    """z on the j-th interval of length d is driven by z on the one before: a stack of linear equations."""
    d, intervals, omega = 0.3, 5, 4.0
    M, b = augmented(3, r, 1.0)
    size = len(b) + 2  # with an oscillator p, v = p_1 = sin(omega t)
    now, past = np.zeros((size, size)), np.zeros((size, size))
    b = np.r_[b, 0, 0]
    alpha = size - 3
    now[:-2, :-2] = M
    now[-2:, -2:] = omega * np.array([[0, 1], [-1, 0]])
    now += np.outer(b, unit(size, (alpha, 1), (-2, -1)))
    past += np.outer(b, unit(size, (3, 1), (alpha, -1), (0, -1)))
    z0 = np.r_[X0, XHAT0, np.zeros(r + 1), 0, 1]
    stack = np.zeros(((intervals + 1) * size,) * 2)  # its first block, constant, is the time before 0
    for j in range(1, intervals + 1):
        rows = slice(j * size, (j + 1) * size)
        stack[rows, rows] = now
        stack[rows, (j - 1) * size : j * size] = past
    flow = expm(stack * d)
    starts = [z0, z0]
    exact = []
    for j in range(1, intervals + 1):
        block = slice(j * size, (j + 1) * size)
        exact.append(flow[block, : (j + 1) * size] @ np.hstack(starts))
        starts.append(exact[-1])
    options: dict[str, Any] = {"theta": 1.0, "r": r, "t_end": intervals * d, "step": 0.005, "delay": d}
    options["output_times"] = d * np.arange(1, intervals + 1)
    result = observe_linear(noise=lambda t, mid: np.sin(omega * t), **options)
    np.testing.assert_allclose(stacked(result), np.array(exact)[:, :-2], atol=2e-8)


@pytest.mark.costly
@pytest.mark.parametrize("r", [0, 2])
def test_varying_delay_against_dop853_between_breakpoints(r: int) -> None:
    def lag(t: float) -> float:
        return 0.3 + 0.1 * np.sin(2 * t)

    def v(t: float) -> float:
        return 0.1 * np.sin(3 * t)

    breaks = [0.0]
    while breaks[-1] < 2.5:
        breaks.append(brentq(lambda t: t - lag(t) - breaks[-1], breaks[-1], breaks[-1] + 0.5, xtol=1e-15))
    breaks = [*breaks[:-1], 2.5]
    corners = sorted({*breaks, *((a + b) / 2 for a, b in pairwise(breaks))})
    z0 = np.r_[1.0, 0.5, 0.0, 0.0, np.zeros(r + 1)]
    rhs = right_side(van_der_pol, van_der_pol_copy, 1.5, r, 2)
    pieces: list[Any] = []

    def earlier(t: float) -> Vector:
        known = [p for p in pieces if p.t_min <= t]
        return known[-1](t) if t > 0 and known else z0

    def closed(t: float, z: Vector) -> Vector:
        old = earlier(t - lag(t))
        return rhs(t, z, old[2] - old[-1] + z[-1] - old[0] - v(t))

    z = z0
    for a, b in pairwise(corners):  # each shorter than the smallest delay
        solution = integrate(closed, z, a, b, dense_output=True)
        pieces.append(solution.sol)
        z = solution.y[:, -1]
    out = np.array([0.1, 0.5, 1.1, 1.9, 2.5])
    options: dict[str, Any] = {"r": r, "t_end": 2.5, "step": 0.004, "delay": lag, "output_times": out}
    result = observe_van_der_pol(noise=lambda t, mid: v(t), **options)
    np.testing.assert_allclose(stacked(result), [earlier(t) for t in out], atol=1e-9, rtol=0)


def test_held_noise_against_dop853_piece_by_piece() -> None:
    draws = uniform(1.0, 10)
    rhs = right_side(van_der_pol, van_der_pol_copy, 1.5, 0, 2)
    z = np.r_[1.0, 0.5, 0.0, 0.0, 0.0]
    for k, v in enumerate(draws):

        def closed(t: float, z: Vector, v: float = v) -> Vector:
            return rhs(t, z, z[2] - z[0] * (1 + v))

        z = integrate(closed, z, 0.3 * k, 0.3 * (k + 1)).y[:, -1]
    options: dict[str, Any] = {"r": 0, "t_end": 3.0, "step": 0.01, "output_times": [3.0], "multiplicative": True}
    options["events"] = 0.3 * np.arange(1, 10)
    result = observe_van_der_pol(noise=lambda t, mid: draws[int(mid / 0.3)], **options)
    np.testing.assert_allclose(stacked(result)[0], z, atol=1e-8)


# ---- known numbers ----


@pytest.mark.slow
@pytest.mark.parametrize(("r", "limit"), [(0, 0.927), (1, 1.103), (2, 1.255), (3, 1.400)])
def test_largest_constant_delay_of_a_triple_integrator(r: int, limit: float) -> None:
    assert_turns_unstable(r, limit, lambda x: {"delay": x})


@pytest.mark.costly
@pytest.mark.parametrize(("r", "limit"), [(0, 2.896), (1, 2.855), (2, 2.968), (3, 3.014)])
def test_largest_sampling_period_of_a_triple_integrator(r: int, limit: float) -> None:
    assert_turns_unstable(r, limit, lambda x: {"sampling": x * np.arange(100)})


def assert_turns_unstable(r: int, limit: float, scenario: Callable[[float], dict[str, Any]]) -> None:
    """theta = 1: the estimate of a plant at rest decays 3 % below the limit and grows 3 % above it."""

    def chain(t: float, x: Vector) -> Vector:
        return np.array([x[1], x[2], 0.0])

    def late_over_early(x: float) -> float:
        options: dict[str, Any] = {"theta": 1.0, "gains": 1.0, "r": r, "t_end": 200.0, "step": 0.5}
        options["output_times"] = np.arange(40, 200.1, 0.5)
        result = simulate(chain, first, chain, [0.0] * 3, [1.0] * 3, **options, **scenario(x))
        size = np.abs(result["xhat"][:, 0])
        return size[-80:].max() / size[:80].max()

    assert late_over_early(0.97 * limit) < 0.8
    assert late_over_early(1.03 * limit) > 1.25


@pytest.mark.slow
@pytest.mark.parametrize(
    ("r", "theta", "rmse"),
    [(0, 1, [0.072, 0.094]), (1, 2, [0.033, 0.23]), (2, 2, [0.0071, 0.0084]), (3, 2, [0.0014, 0.0067])],
)
def test_contois_example_of_the_thesis(r: int, theta: float, rmse: float) -> None:
    plant = Contois(lambda t: 1.064 * (1 - abs(np.sin(t)) / 2))
    k = np.arange(241)
    out = np.linspace(10, 60, 2501)
    noise = 0.5 * np.sin(0.95 * np.pi * k) + 0.5 * np.sin(0.97 * np.pi * k)
    options: dict[str, Any] = {"theta": theta, "r": r, "t_end": 60.0, "step": 0.1, "output_times": out}
    result = plant.observe(sampling=0.25 * k, noise=noise, events=np.pi * np.arange(1, 20), **options)
    error = result["xhat"] - result["x"]
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=0)), rmse, rtol=0.02)


# ---- rules ----

RULES: dict[str, Any] = {"r": 1, "t_end": 2.0, "step": 0.1, "output_times": np.linspace(0, 2, 9)}


def rules(**options: Any) -> Run:
    return observe_van_der_pol(**(RULES | options))


def test_no_innovation_before_the_first_sample() -> None:
    result = rules(sampling=[1.0])
    free = rules(gains=[0.0] * 3)
    np.testing.assert_array_equal(result["xhat"][:5], free["xhat"][:5])
    assert abs(result["xhat"][-1] - free["xhat"][-1]).max() > 0.1
    np.testing.assert_array_equal(result["eta"][:5], 0)


def test_a_late_older_sample_is_recorded_and_not_used() -> None:
    noise = [0.3, -0.2, 50.0, 0.1]
    late = rules(sampling=[0.4, 0.8, 1.0, 1.6], delay=[0.0, 0.1, 0.7, 0.0], noise=noise)
    without = rules(sampling=[0.4, 0.8, 1.6], delay=[0.0, 0.1, 0.0], noise=[0.3, -0.2, 0.1], events=[0.3, 1.0])
    np.testing.assert_allclose(stacked(late), stacked(without), atol=1e-15)
    np.testing.assert_allclose(late["taken"], [0.4, 0.7, 0.3, 1.6])
    assert late["y"][2] > 50


def test_samples_before_the_start_speak_of_the_start_and_the_later_arrival_wins() -> None:
    result = rules(sampling=[0.2, 0.4], delay=0.5, noise=[9.0, 0.25])
    np.testing.assert_array_equal(result["taken"], [0, 0])
    np.testing.assert_array_equal(result["y"], [10.0, 1.25])
    # With K_n = 0 eta is a filter of e_y alone, and e_y is -1 on [0.2, 0.4], then -1.25.
    filtered = rules(sampling=[0.2, 0.4], delay=0.5, noise=[0.0, 0.25], gains=[1.0, 0.0, 0.0])
    rest = np.exp(-1.5 * 1.6)
    expected = -(1 - np.exp(-1.5 * 0.2)) * rest - 1.25 * (1 - rest)
    assert filtered["eta"][-1, 0] == pytest.approx(expected, abs=1e-5)


def test_delay_forms_agree() -> None:
    times = 0.3 * np.arange(7)
    lags = [0.1 + 0.05 * t for t in times]
    by_number = rules(sampling=times, delay=lags)
    by_function = rules(sampling=times, delay=lambda t: 0.1 + 0.05 * t)
    np.testing.assert_array_equal(stacked(by_number), stacked(by_function))
    constant = rules(delay=0.35)
    np.testing.assert_allclose(stacked(rules(delay=lambda t: 0.35)), stacked(constant), atol=1e-15)
    np.testing.assert_array_equal(stacked(rules(delay=lambda t: 0.0)), stacked(rules()))


def test_multiplicative_samples() -> None:
    result = rules(sampling=[0.0, 1.0], noise=[0.5, -0.5], multiplicative=True)
    np.testing.assert_allclose(result["y"], [1.5, 0.5 * result["x"][4, 0]])


def test_saturation_leaves_the_linear_part_alone() -> None:
    box = [(-0.2, 0.2), (-0.1, 0.1)]

    def by_hand(t: float, xhat: Vector) -> Vector:
        a, b = np.clip(xhat[0], -0.2, 0.2), np.clip(xhat[1], -0.1, 0.1)
        return np.array([xhat[1], 0.5 * (1 - a**2) * b - a])

    options: dict[str, Any] = {"theta": 1.5, "gains": 1.0} | RULES
    expected = simulate(van_der_pol, first, by_hand, [1.0, 0.5], [0.0, 0.0], **options)
    np.testing.assert_allclose(stacked(rules(box=box)), stacked(expected), atol=1e-14)
    np.testing.assert_allclose(stacked(rules(box=[(-99, 99)] * 2)), stacked(rules()), atol=1e-14)
    assert np.abs(expected["xhat"] - rules()["xhat"]).max() > 0.01


def test_gains_by_pole_or_by_number() -> None:
    assert binomial_gains(4) == [4, 6, 4, 1]
    assert binomial_gains(2, 3.0) == [6, 9]
    np.testing.assert_array_equal(stacked(rules(gains=2.0)), stacked(rules(gains=[6, 12, 8])))


def test_start_time_only_shifts() -> None:
    def shifted(t: float, x: Vector) -> Vector:
        return van_der_pol(t - 5, x)

    options: dict[str, Any] = {"theta": 1.5, "gains": 1.0, "t0": 5.0, "delay": 0.25} | RULES
    options |= {"t_end": 7.0, "output_times": RULES["output_times"] + 5}
    late = simulate(shifted, first, van_der_pol_copy, [1.0, 0.5], [0.0, 0.0], **options)
    np.testing.assert_allclose(stacked(late), stacked(rules(delay=0.25)), atol=1e-13)


def test_breakpoints_of_a_constant_delay() -> None:
    found = breakpoints([0.0, 0.1], lambda t: 0.37, np.linspace(0, 5, 501))
    np.testing.assert_allclose(found, [j * 0.37 + e for j in range(1, 5) for e in (0, 0.1)], atol=1e-15)


def test_breakpoints_when_the_delayed_time_runs_backwards() -> None:
    def lag(t: float) -> float:
        return 0.5 + 0.4 * np.sin(5 * t)

    found = breakpoints([0.75], lag, np.linspace(0, 10, 2001))
    first_level = [t for t in found if abs(t - lag(t) - 0.75) < 1e-12]
    assert len(first_level) == 3
    assert all(min(abs(t - lag(t) - e) for e in [0.75, *found]) < 1e-12 for t in found)


def test_no_step_is_longer_than_the_delay() -> None:
    np.testing.assert_array_equal(stacked(rules(delay=0.05)), stacked(rules(delay=0.05, step=0.05)))


def test_step_count() -> None:
    assert [step_count(g, 0.01) for g in (2.500000001, 2.5, 2.505, 1e-17, 0.1 + 0.2)] == [
        250,
        250,
        251,
        1,
        30,
    ]


@pytest.mark.parametrize(
    "options",
    [
        {"delay": -0.1},
        {"delay": lambda t: 0.1 - t},
        {"sampling": [0.5], "delay": [-0.1]},
        {"sampling": [-0.5]},
        {"sampling": [0.5], "noise": [1.0, 2.0]},
        {"delay": lambda t: t**2},
        {"gains": [1.0, 2.0]},
        {"method": "heun"},
        {"output_times": [3.0]},
    ],
)
def test_refusals(options: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"delay|sample|gains|method|output|longer|shorter"):
        rules(**options)
