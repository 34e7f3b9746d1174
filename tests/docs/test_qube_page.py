"""docs/qube.md says of its tables what stands in them, and its pendula move as pendula do."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from itertools import product, takewhile
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.linalg import expm, solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import minimize_scalar

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "qube.md").read_text(encoding="utf-8")
OURS = ("SHGO", "SHGO_S", "FHGO I", "FHGO II", "impulsive")


def table(first: str) -> list[dict[str, str]]:
    """The rows of the table whose head begins with a word, by the words of its head."""
    lines = PAGE.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith(f"| {first} |"))
    head, _, *cells = (
        line.strip("| ").split(" | ") for line in takewhile(lambda line: line.startswith("|"), lines[start:])
    )
    return [dict(zip(head, row, strict=True)) for row in cells]


def worst(rows: list[dict[str, str]], column: str) -> float:
    return max(float(row[column]) for row in rows)


def test_ratios_are_those_of_the_errors() -> None:
    rows = table("left out")
    assert len(rows) == 3 * 2 * 4
    for row in rows:
        digits = 0.005 if row["error of"].startswith("angle") else 0.00005
        for label in OURS:
            ratio = float(row[label]) / float(row["EKF"])
            assert float(row[f"{label}/EKF"]) == pytest.approx(ratio, abs=2.2 * digits / float(row["EKF"]) + 0.0005)
        largest = max(float(row[label]) for label in OURS) / float(row["Savitzky-Golay (SG)"])
        assert float(row["largest/SG"]) == pytest.approx(largest, abs=0.006)


def test_what_is_said_of_the_machine() -> None:
    """Of each observer the largest ratio of an angle and of a velocity, in the sentence below the table."""
    rows = table("left out")
    angles, velocities = ([row for row in rows if row["error of"].startswith(kind)] for kind in ("angle", "velocity"))
    said = re.findall(r"`?([\w ]+?)`? (\d\.\d{3}) and (\d\.\d{3})", PAGE.replace("\n", " "))
    assert {label.removeprefix("of ").strip() for label, *_ in said} >= set(OURS)
    for label, angle, velocity in said:
        assert float(angle) == worst(angles, f"{label}/EKF")
        assert float(velocity) == worst(velocities, f"{label}/EKF")
    assert worst(rows, "largest/SG") <= 0.26
    assert worst(velocities, "SHGO_S/EKF that knows") <= 1.1
    for label in ("SHGO", "SHGO_S", "FHGO II", "impulsive"):
        assert worst(angles, f"{label}/EKF") <= 1.05
        assert worst(velocities, f"{label}/EKF") <= 1.1


def test_what_is_said_of_the_simulated_pendula() -> None:
    rows = table("pendulum")
    pendula = ("driven", "drag", "windy", "coulomb", "noisy", "small")
    assert [(row["pendulum"], row["rate"]) for row in rows] == list(product(pendula, ("50 Hz", "25 Hz")))
    for label in ("SHGO", "impulsive"):
        assert worst(rows, f"{label}: angle") <= 1.05
        assert worst(rows, f"{label}: velocity") <= 1.1
    said = re.search(
        r"of `SHGO` are ([\d.]+) in an angle and ([\d.]+) in a velocity, those of `impulsive` ([\d.]+) and ([\d.]+)\. ",
        PAGE.replace("\n", " "),
    )
    assert said is not None
    columns = ("SHGO: angle", "SHGO: velocity", "impulsive: angle", "impulsive: velocity")
    assert [float(one) for one in said.groups()] == [worst(rows, column) for column in columns]
    is_small = [row["pendulum"] == "coulomb" and row["rate"] == "50 Hz" for row in rows]
    for label, least, of_small in (("SHGO", 1.085, 1.175), ("impulsive", 1.085, 1.215)):
        for row, small in zip(rows, is_small, strict=True):
            assert trusting(row, label) <= (of_small if small else least)
    assert worst(rows, "largest/SG") <= 0.26


def trusting(row: dict[str, str], label: str) -> float:
    """The ratio of a velocity to that of the filter that trusts its start."""
    return float(row[f"{label}: velocity"]) * float(row["EKF"]) / float(row["EKF that trusts"])


def test_what_is_said_of_poles_that_follow_from_theta() -> None:
    """The damping is that of the rule, with the digits of theta T that are shown, and the bounds hold for all."""
    rows = table("third log of")
    for row in rows:
        x = float(row["theta T"])
        zeta = min(1.8, max(min((1 + x / 2) / 2**0.5, 1.1), x / 2))
        assert float(row["zeta"]) == pytest.approx(zeta, abs=0.008)
    said = re.findall(r"(?:of|those of) `SHGO_[TS]` (?:are )?([\d.]+) of an angle and ([\d.]+) of a velocity", PAGE)
    columns = ("angle", "velocity", "SHGO_S: angle", "SHGO_S: velocity")
    assert [float(one) for pair in said for one in pair] == [worst(rows, column) for column in columns]
    assert worst(rows, "angle") <= 1.05
    assert worst(rows, "velocity") <= 1.1


def averages(F: np.ndarray, Q: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Roots of the mean variances of the first two states over a gap of 1, from the covariance behind a sample."""
    grid = [spread(F, Q, s) for s in np.linspace(0, 1, 11)]
    variances = [np.diag(phi @ after @ phi.T + noise)[:2] for phi, noise in grid]
    return np.asarray(np.sqrt(np.trapezoid(variances, dx=0.1, axis=0)))


def spread(F: np.ndarray, Q: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray]:
    """Of x' = F x + noise of the density Q over a time, by Van Loan: the transition, and the covariance."""
    n = len(F)
    both = expm(np.block([[-F, Q], [np.zeros((n, n)), F.T]]) * s)
    phi = both[n:, n:].T
    return phi, phi @ both[:n, n:]


def of_filter(m: float, tau: float, density: float | None) -> np.ndarray:
    """Errors of a Kalman filter that takes the acceleration as white, or that knows its law."""
    F, Q = np.array([[0, 1, 0], [0, 0, 1], [0, 0, -1 / tau]]), np.diag([0, 0, 2 / tau])
    model = (F, Q) if density is None else (F[:2, :2], np.diag([0, density]))
    phi, noise = spread(*model, 1.0)
    before = solve_discrete_are(phi.T, np.eye(len(phi))[:, :1], noise, [[m**2]])
    gain = np.zeros(3)
    gain[: len(phi)] = before[:, 0] / (before[0, 0] + m**2)
    if density is None:
        return averages(F, Q, before - np.outer(gain, before[0]))
    # the error: position, velocity, and minus what the filter does not know of
    jump, (phi, noise) = np.eye(3) - np.outer(gain, [1, 0, 0]), spread(F, Q, 1.0)
    after = solve_discrete_lyapunov(jump @ phi, jump @ noise @ jump.T + m**2 * np.outer(gain, gain))
    return averages(F, Q, after)


def of_observer(m: float, tau: float, theta: float, g: tuple[float, ...]) -> np.ndarray:
    """Errors of a flow: position, velocity, acceleration as it is estimated and as it is, and the innovation."""
    K = theta ** np.arange(1, 4) * np.array([*g, 0.0][:3])
    F = np.zeros((5, 5))
    F[[0, 1, 1, 3], [1, 2, 3, 3]] = 1, 1, -1, -1 / tau
    F[[0, 1, 2, 4], 4] = -K[0], -K[1], -K[2], -K[0]
    Q, jump, noisy = np.diag([0, 0, 0, 2 / tau, 0]), np.diag([1.0, 1, 1, 1, 0]), np.diag([0, 0, 0, 0, m**2])
    jump[4, 0] = 1
    kept = [0, 1, 2, 3, 4] if K[2] else [0, 1, 3, 4]
    F, Q, jump, noisy = (matrix[np.ix_(kept, kept)] for matrix in (F, Q, jump, noisy))
    phi, noise = spread(F, Q, 1.0)
    if np.max(np.abs(np.linalg.eigvals(jump @ phi))) >= 1:
        return np.full(2, np.inf)
    return averages(F, Q, solve_discrete_lyapunov(jump @ phi, jump @ noise @ jump.T + noisy))


BETWEEN = (0.2, 0.4, 0.6, 0.8)  # the samples of five that no observer gets


def between(F: np.ndarray, Q: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Errors of the first two states at these times, from the covariance behind a sample."""
    variances = [np.diag(phi @ after @ phi.T + noise)[:2] for phi, noise in (spread(F, Q, s) for s in BETWEEN)]
    return np.asarray(np.sqrt(np.mean(variances, axis=0)))


def of_shrinking(r: float, theta: float, gamma: float) -> np.ndarray:
    """Errors of ``shgo`` with poles at -0.3 and -3.3 and an innovation that shrinks: position, velocity, innovation."""
    F = np.array([[0, 1, -3.6 * theta], [0, 0, -0.99 * theta**2], [0, 0, -gamma]])
    Q, jump = np.diag([0, 1 / r, 0]), np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0]])
    phi, noise = spread(F, Q, 1.0)
    if np.max(np.abs(np.linalg.eigvals(jump @ phi))) >= 1:
        return np.full(2, np.inf)
    return between(F, Q, solve_discrete_lyapunov(jump @ phi, jump @ noise @ jump.T + np.diag([0, 0, 1.0])))


def least(size: Callable[[float], float], first: float, last: float) -> float:
    """Where it is smallest, between two numbers."""
    found = minimize_scalar(
        lambda x: size(np.exp(x)), bounds=np.log([first, last]), method="bounded", options={"xatol": 1e-3}
    )
    return float(np.exp(found.x))


def at_the_best_theta(m: float, tau: float, g: tuple[float, ...]) -> np.ndarray:
    """Errors with the theta that is best for the position."""
    theta = least(lambda one: of_observer(m, tau, one, g)[0], *((0.4, 4) if len(g) == 2 else (0.2, 1.6)))
    return of_observer(m, tau, theta, g)


@pytest.mark.costly
@pytest.mark.one_in(4)
@pytest.mark.parametrize("number", range(8))
def test_what_is_said_of_a_wind(number: int) -> None:
    """A row of the table, of a wind of variance 1 in units of the gap between samples."""
    row = table("rate of")[number]
    m, tau = float(row["m"]), 0.3 * float(row["rate of"].removesuffix(" Hz"))
    density = least(lambda q: of_filter(m, tau, q)[1], 1e-3, 10)
    unit = of_filter(m, tau, density)
    found = {"knows the wind": of_filter(m, tau, None)}
    for poles in ("-0.65, -1.55", "-1, -1, -1", "-0.5, -1, -2"):
        g = tuple(np.poly([float(one) for one in poles.split(", ")])[1:])
        found[poles] = at_the_best_theta(m, tau, g)
    for which, errors in found.items():
        said = [float(row[f"{what}: {which}"]) for what in ("angle", "velocity")]
        np.testing.assert_allclose(errors / unit, said, rtol=0, atol=0.012)


@pytest.mark.parametrize("r", [0.03, 0.3, 3, 30, 300, 3000])
def test_what_is_said_of_an_innovation_that_shrinks(r: float) -> None:
    """gamma T = 10 for noise of any size, beside the Kalman filter whose noise is that of the motion."""
    found = re.search(r"gamma T = 10 .*? within ([\d.]+) % .*? within ([\d.]+) %", PAGE.replace("\n", " "))
    assert found is not None
    phi, noise = spread(F := np.eye(2, k=1), Q := np.diag([0, 1 / r]), 1.0)
    before = solve_discrete_are(phi.T, np.eye(2)[:, :1], noise, [[1.0]])
    unit = between(F, Q, before - np.outer(before[:, 0], before[0]) / (before[0, 0] + 1))
    theta = least(lambda one: of_shrinking(r, one, 10.0)[0], 0.2, 5)
    angle, velocity = of_shrinking(r, theta, 10.0) / unit
    assert 1 <= angle <= 1 + float(found[1]) / 100
    assert 1 <= velocity <= 1 + float(found[2]) / 100


def test_what_is_said_of_an_observer_with_a_torque() -> None:
    """It is taken where its error on the logs that tune it is the smaller one."""
    rows = table("third log, of")
    chosen = [(row, "SHGO_E" if float(row["tuned: SHGO_E"]) < float(row["tuned: SHGO"]) else "SHGO") for row in rows]
    others = {f"{row['third log, of']}" for row, label in chosen if label == "SHGO"}
    assert others == {"dry links", "gusty", "driven", "drag, not modelled", "thick, not modelled"}
    velocities = {
        label: [float(row[f"velocity: {label}"]) for row, one in chosen if one == label] for label in ("SHGO", "SHGO_E")
    }
    said = re.search(
        r"`SHGO_E`, and its velocities are ([\d.]+) to ([\d.]+) times .*? `SHGO`, with ([\d.]+) to ([\d.]+),",
        PAGE.replace("\n", " "),
    )
    assert said is not None
    bounds = [bound(velocities[label]) for label in ("SHGO_E", "SHGO") for bound in (min, max)]
    assert [float(one) for one in said.groups()] == bounds
    assert max(float(row[f"angle: {label}"]) for row, label in chosen) <= 1.08


def test_the_machine_with_a_cable_keeps_its_energy() -> None:
    """What cable.yaml says of the energy of the arm, a rod, its weight and a spring: friction takes it."""
    plant = yaml.safe_load((ROOT / "demos" / "qube" / "cable.yaml").read_text())["plant"]
    p = plant["parameters"]
    for theta, alpha, v, w in np.random.default_rng(5).normal(size=(5, 4)).tolist():
        known = p | {"sin": np.sin, "cos": np.cos, "tanh": np.tanh}
        known |= {"theta": theta, "alpha": alpha, "theta_dot": v, "alpha_dot": w}
        dv, dw = (eval(plant["dynamics"][state], known.copy()) for state in ("theta_dot", "alpha_dot"))
        power = (p["A"] + np.sin(alpha) ** 2) * v * dv + w * dw + np.sin(alpha) * np.cos(alpha) * w * v**2
        power -= p["C"] * (np.cos(alpha) * (dv * w + v * dw) - np.sin(alpha) * w * v * w)
        power += -p["W"] * np.sin(alpha) * w + (p["k"] * theta - p["k_0"]) * v
        lost = p["d_r"] * v**2 + p["c_r"] * v * np.tanh(v / 0.1) + p["d_p"] * w**2 + p["c_p"] * w * np.tanh(w / 0.1)
        assert power == pytest.approx(-lost, abs=1e-9)


def test_two_links_move_as_their_model_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """links.yaml has what links.py has with friction, and without it the log of links.py loses no energy."""
    monkeypatch.syspath_prepend(str(ROOT / "demos" / "qube"))
    links = importlib.import_module("links")
    one = links.Links(G=25.0, rho=1.3, mu=1.5, d_a=0.3, d_b=0.2)
    plant = yaml.safe_load((ROOT / "demos" / "qube" / "links.yaml").read_text())["plant"]
    known = {name: getattr(one, name) for name in plant["parameters"]} | {"sin": np.sin, "cos": np.cos}
    for x in np.random.default_rng(3).normal(size=(5, 4)).tolist():
        names = known | dict(zip(("a", "b", "speed_a", "speed_b"), x, strict=True))
        found = [eval(plant["dynamics"][state], names.copy()) for state in ("speed_a", "speed_b")]
        np.testing.assert_allclose(found, one.accelerations(x, (0.0, 0.0)), rtol=1e-11, atol=1e-11)
    monkeypatch.setattr(links, "END", 0.6)
    links.Links(G=25.0, rho=1.3, mu=1.5, d_a=0.0, d_b=0.0, encoder=0).log(
        tmp_path / "log.csv", (1.4, 0.6, 0, 0), seed=0
    )
    _, a, b, speed_a, speed_b = np.loadtxt(tmp_path / "log.csv", delimiter=",", skiprows=1, unpack=True)
    energy = 2.5 * speed_a**2 / 2 + 1.5 * 1.3**2 * speed_b**2 / 2 + 1.5 * 1.3 * speed_a * speed_b * np.cos(a - b)
    energy -= 25 * (2.5 * np.cos(a) + 1.5 * 1.3 * np.cos(b))
    np.testing.assert_allclose(energy, energy[0], rtol=0, atol=1e-5)
    assert np.ptp(speed_a) > 1


def test_a_simulated_pendulum_loses_what_friction_takes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a small angle Coulomb's friction takes 2 c/omega^2 every half period; then it rests."""
    monkeypatch.syspath_prepend(str(ROOT / "demos" / "qube"))
    pendula = importlib.import_module("pendula")
    monkeypatch.setattr(pendula, "END", 2.0)
    one = pendula.Pendulum(5.0, 0.0, (), c=0.1, noise=0.0, encoder=10**7, jitter=0.0)
    one.log(tmp_path / "log.csv", (0.02, 0.0), seed=0)
    log = np.genfromtxt(tmp_path / "log.csv", delimiter=",", names=True)
    half = np.pi / 5
    assert np.interp(half, log["time"], log["angle"]) == pytest.approx(-(0.02 - 2 * 0.1 / 25), abs=2e-5)
    assert np.interp(2 * half, log["time"], log["angle"]) == pytest.approx(0.02 - 4 * 0.1 / 25, abs=1e-4)
    assert log["velocity"][-1] == 0.0  # 0.004 is what friction holds
