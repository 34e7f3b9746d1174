"""Standard errors of gains that recordings determine, beside those of linear regression in closed form."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.linalg import toeplitz
from shell import Shell

from hgorun.config.tuning import Range
from hgorun.estimate.gains import determined
from hgorun.estimate.gains.cases import Case
from hgorun.estimate.gains.determined import spread, standard_errors
from hgorun.estimate.gains.goal import Goal
from hgorun.estimate.gains.tuning import Trials
from hgorun.estimate.scores.outlying import Errors
from hgorun.symbolic.evaluate import Floats

N, STRETCHES = 2000, 20
t = np.linspace(0, 1, N)
X = np.column_stack([np.ones(N), t, np.sin(40 * t)])


def cut(of: Floats) -> list[Floats]:
    return np.array_split(of, STRETCHES)


@pytest.mark.parametrize("kept", [0.0, 0.95])
def test_errors_that_hang_together_count_less(kept: float) -> None:
    """Least squares under noise with the correlation kept^|i - j|: the exact covariance, and the mean of 40."""
    rng, found = np.random.default_rng(3), []
    of_noise = 0.1**2 * toeplitz(kept ** np.arange(N))
    inverse = np.linalg.inv(X.T @ X)
    exact = np.sqrt(np.diag(inverse @ X.T @ of_noise @ X @ inverse))
    for _ in range(40):
        noise = rng.standard_normal(N)
        for k in range(1, N):
            noise[k] = kept * noise[k - 1] + np.sqrt(1 - kept**2) * noise[k]
        errors = 0.1 * noise - X @ (inverse @ X.T @ (0.1 * noise))
        found.append(np.diag(spread(cut(X), cut(errors))))
    np.testing.assert_allclose(np.sqrt(np.mean(found, axis=0)), exact, rtol=0.15)


def test_what_no_error_depends_on_is_not_known() -> None:
    slopes = np.column_stack([X[:, 0], 0 * t, X[:, 1], X[:, 2], X[:, 2]])
    errors = np.random.default_rng(4).standard_normal(N)
    found = np.sqrt(np.diag(spread(cut(slopes), cut(errors))))
    assert list(np.isinf(found)) == [False, True, False, True, True]
    of_three = np.sqrt(np.diag(spread(cut(X), cut(errors))))
    np.testing.assert_allclose(found[[0, 2]], of_three[:2], rtol=1e-6)


@pytest.mark.parametrize(
    ("count", "most", "known"), [(20, 2.0, True), (1, 2.0, False), (20, 1.0, False), (20, 1.5, False)]
)
def test_nothing_is_said_of_few_samples_or_beside_a_lost_estimate(
    monkeypatch: pytest.MonkeyPatch, count: int, most: float, known: bool
) -> None:
    """The mean of some numbers, at the upper end of a logarithmic range where an observer is lost, or beside it."""
    values = np.random.default_rng(6).standard_normal(count)
    values += 1.0 - values.mean()

    def errors(_: object, __: object, gains: dict[str, float]) -> list[Errors] | None:
        lost = gains["k"] >= most or (most < 2 and gains["k"] < 1)
        return None if lost else [Errors("a", np.arange(1.0 * count), values - gains["k"], 0.0, None, 1)]

    monkeypatch.setattr(determined, "errors_of", errors)
    trials = Trials([object.__new__(Case)], Goal("holdout_rmse", "o", "a"), {"k": Range(log=(0.1, 1.0))}, 9)
    trials.tried.append(((1.0,), 1.0))
    trials.left_out = [np.zeros(count, dtype=bool)]
    found = standard_errors(trials)
    assert set(found) == ({"k"} if known else set())
    if known:  # of the mean; ten pairs
        assert found["k"] == pytest.approx(values.std(ddof=1) / np.sqrt(count), rel=0.35)


CONFIG = """
plant: {states: [a], parameters: {p: 1, s: 0, q: 0}, dynamics: {a: p + s*t + q*t**2}, output: a}
solver: {step: 0.1}
data: {file: log.csv, time: t, outputs: {a: {column: a, std: 0.1}}}
observers:
  o: {type: shgo, theta: 1.0e-9, poles: -1, initial: {a: 0}}
tune:
  gains:
    plant.parameters.p: {linear: [0.5, 4]}
    plant.parameters.s: {linear: [-1, 1]}
    plant.parameters.q: {linear: [0, 1]}
  minimise: holdout_rmse(o, a)
  budget: 40
  seeds: 1
"""


def test_of_a_curve_through_the_origin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An observer that corrects nothing is p t + s t^2/2 + q t^3/3: linear regression."""
    times = 0.05 * np.arange(201)
    values = 2 * times + 0.1 * np.random.default_rng(8).standard_normal(times.size)
    lines = [f"{one:.2f},{value:.6f}" for one, value in zip(times, values, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(["t,a", *lines]) + "\n")
    (tmp_path / "line.yaml").write_text(CONFIG)
    shell = Shell(tmp_path, monkeypatch, capsys)
    code, out, err = shell("tune", "line.yaml")
    assert code == 0, err
    assert "at the lower end" not in err  # q: no advice to look below 0
    found = yaml.safe_load((tmp_path / "results" / "line.tuned.yaml").read_text())["plant"]["parameters"]
    search = times[1::5]
    slopes = np.column_stack([search, search**2 / 2, search**3 / 3])
    best, (square,), *_ = np.linalg.lstsq(slopes, values[1::5], rcond=None)
    exact = np.sqrt(square / (search.size - 3) * np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert [found[one] for one in "psq"] == pytest.approx(best, abs=0.1 * exact.min())
    told = re.search(r"o: standard errors: p (.+), s (.+), q (.+)\no: within two of them 0 is as good: s, q\n", out)
    assert told is not None
    np.testing.assert_allclose([float(one) for one in told.groups()], exact, rtol=0.5)  # ten stretches tell no more
