"""Metrics: records, their numbers against plain formulas, and one from another package."""

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from examples import VAN_DER_POL, simulated
from hypothesis import given, settings
from hypothesis import strategies as st
from outside import code_of, installed

from hgorun import Result
from hgorun.commands.catalogue import list_all, show
from hgorun.commands.catalogue_options import List, Show
from hgorun.errors import HgorunError, PluginError
from hgorun.result.evaluation.measure import measure
from hgorun.result.metrics.base import METRICS, Metric, all_metrics, largest
from hgorun.result.quantities.quantities import measure_quantity
from hgorun.result.reading import read
from hgorun.result.windows import MetricSettings, points_in
from hgorun.study.sentences import read_sentence
from hgorun.tables import metrics as tables
from hgorun.tables.latex import latex

OBSERVERS: dict[str, Any] = {"A": {"type": "shgo", "theta": 3}, "B": {"type": "shgo", "theta": 5}}

BIAS = code_of("extending.md", "BIAS")


def small(**more: Any) -> Result:
    return simulated(VAN_DER_POL, OBSERVERS, end=3, output_step=0.01, step=0.01, **more)


def naive(t: np.ndarray, x: np.ndarray, xhat: np.ndarray, s: MetricSettings) -> dict[str, float]:
    """The formulas of the documentation for one state, point by point."""
    e = xhat - x
    near = 1e-9 * (t[1] - t[0])
    steady = [i for i in range(t.size) if s.steady[0] - near <= t[i] <= s.steady[1] + near]
    transient = [i for i in range(t.size) if s.transient[0] - near <= t[i] <= s.transient[1] + near]
    nan = float("nan")
    peak = max((abs(e[i]) for i in transient), default=nan)
    late = [t[i] for i in range(t.size) if abs(e[i]) > s.settling * peak]
    half = round(s.average / (t[1] - t[0]) / 2)
    inner = steady[half : len(steady) - half]
    rough = [e[i] - np.mean(e[i - half : i + half + 1]) for i in inner]
    ways = [sum(abs(v[i + 1] - v[i]) for i in steady[:-1]) for v in (xhat, x)]
    return {
        "rmse": float(np.sqrt(np.mean([e[i] ** 2 for i in steady]))) if steady else nan,
        "sup": max((abs(e[i]) for i in steady), default=nan),
        "peak": peak,
        "settling": late[-1] if late else t[0],
        "hf": float(np.std(rough)) if rough else nan,
        "tv": ways[0] / ways[1] if ways[1] else nan,
    }


@pytest.mark.costly
@given(
    points=st.integers(2, 90),
    states=st.integers(1, 3),
    observers=st.integers(1, 4),
    bounds=st.tuples(*[st.floats(-0.5, 10) for _ in range(4)]),
    average=st.floats(0.05, 3),
    seed=st.integers(0, 2**32),
)
@settings(max_examples=60)
def test_they_are_their_formulas(
    points: int, states: int, observers: int, bounds: tuple[float, ...], average: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    t, x = 0.1 * np.arange(points), random.normal(size=(points, states))
    estimates = {f"O{j}": np.asfortranarray(x + random.normal(size=x.shape)) for j in range(observers)}
    (a, b), (c, d) = sorted(bounds[:2]), sorted(bounds[2:])
    s = MetricSettings((a, b), (c, d), average, 0.05)
    with np.errstate(all="ignore"):
        found = measure(t, x, estimates, s)
    for label, xhat in estimates.items():
        alone = measure(t, x, {label: xhat}, s)[label]
        for i in range(states):
            for name, value in naive(t, x[:, i], xhat[:, i], s).items():
                np.testing.assert_allclose(found[label][name][i], value, rtol=1e-9, atol=1e-12)
        for name, values in found[label].items():
            np.testing.assert_array_equal(values, alone[name])  # the same bits in any company


def test_what_is_not_finite_is_infinitely_wrong_and_spoils_no_other() -> None:
    t, x = 0.1 * np.arange(50), np.random.default_rng(1).normal(size=(50, 2))
    good, lost = x + 1, x.copy()
    lost[30:, 0] = np.nan
    s = MetricSettings((1.0, 4.9), (0.0, 1.0), 0.3, 0.05)
    found = measure(t, x, {"lost": lost, "good": good}, s)
    assert all(np.all(np.isinf(values)) for values in found["lost"].values())
    np.testing.assert_equal(found["good"], measure(t, x, {"good": good}, s)["good"])
    with np.errstate(over="ignore", invalid="ignore"):
        huge = measure(t, x, {"huge": np.full_like(x, 1e308)}, s)["huge"]  # finite, though its sum is not
    assert huge["sup"][0] == pytest.approx(1e308)


@given(rows=st.integers(1, 200), columns=st.integers(1, 5), seed=st.integers(0, 2**32))
@settings(max_examples=30)
def test_largest_is_the_maximum(rows: int, columns: int, seed: int) -> None:
    values = np.random.default_rng(seed).normal(size=(rows, columns, 2))
    np.testing.assert_array_equal(largest(values), values.max(axis=0))


@given(window=st.tuples(st.integers(-3, 23), st.integers(-3, 23)), start=st.floats(-1e3, 1e3))
def test_a_window_has_its_ends_in_spite_of_rounding(window: tuple[int, int], start: float) -> None:
    t = start + 0.1 * np.arange(20)
    inside = points_in(t, (start + 0.1 * window[0] * (1 + 1e-15), start + 0.1 * window[1] * (1 - 1e-15)))
    expected = [i for i in range(20) if window[0] <= i <= window[1]]
    assert list(range(20))[inside] == expected


def test_a_window_between_two_measured_points_is_refused() -> None:
    with pytest.raises(HgorunError, match=r"no output point lies in \[1\.2, 1\.8\]"):
        small(metrics={"record": 1, "window": [1.2, 1.8]})


@pytest.fixture
def bias(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    with installed(tmp_path, monkeypatch, METRICS, "my_metrics", BIAS, bias="BIAS"):
        yield


@pytest.mark.usefixtures("bias")
def test_a_metric_of_another_package_is_like_one_of_ours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = small()
    window = points_in(result.time, result.windows["steady"])
    expected = np.abs(np.mean((result.observers["A"].xhat - result.x)[window], axis=0))
    np.testing.assert_allclose(result.observers["A"].metrics["bias"], expected, rtol=1e-12)
    path = result.save(tmp_path / "a.h5")
    np.testing.assert_equal(read(path).metrics(), result.metrics())
    with h5py.File(path) as file:
        assert file["metrics/A/bias"].attrs["long_name"] == "size of the mean error over the steady window"
        assert file["metrics/A/settling"].attrs["units"] == "s"
    assert "bias x1" in tables.text([result])
    assert "rmse, sup, hf, tv, bias: 1 to 3 s" in tables.text([result])
    assert tables.as_json(result)["observers"]["A"]["bias"]["x2"] == result.metrics()["A"]["bias"]["x2"]
    rows = list(csv.DictReader(tables.csv([result]).splitlines()))
    assert {row["metric"] for row in rows} == set(all_metrics())
    assert "{bias}" in latex([result])
    whole, part = (
        measure_quantity(read_sentence(f"bias('A', x1{more})", ("r",)).quantities[0], {"r": result})
        for more in ("", ", 2, 3")
    )
    assert whole == result.metrics()["A"]["bias"]["x1"]
    late = points_in(result.time, (2, 3))
    assert part == pytest.approx(abs(np.mean((result.observers["A"].xhat - result.x)[late, 0])), rel=1e-12)
    list_all(List(kind="metrics", json=True))
    assert list(json.loads(capsys.readouterr().out)["metrics"])[-1] == "bias"
    show(Show(name="bias"))
    assert "size of the mean error" in capsys.readouterr().out


@pytest.mark.costly
def test_files_with_more_and_with_fewer_metrics_are_compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = small().save(tmp_path / "few.h5")
    with installed(tmp_path, monkeypatch, METRICS, "my_metrics", BIAS, bias="BIAS"):
        many = small().save(tmp_path / "many.h5")
    shown = tables.text([read(few), read(many)])
    head, *rows = next(block for block in shown.split("\n\n") if "bias x1" in block).splitlines()
    column = head.split().index("bias")
    assert head.split()[column : column + 4] == ["bias", "x1", "bias", "x2"]
    assert [row.split()[-1] == "-" or " - " in row for row in rows] == [True, True, False, False]
    assert "{bias}" in latex([read(few), read(many)])
    with installed(tmp_path / "again", monkeypatch, METRICS, "my_metrics", BIAS, bias="BIAS"):
        old = read(few)  # a quantity that the file lacks is measured on its trajectories
        value = measure_quantity(read_sentence("bias('A', x1)", ("r",)).quantities[0], {"r": old})
    assert value == pytest.approx(read(many).metrics()["A"]["bias"]["x1"], rel=1e-12)


def test_a_metric_that_cannot_be_loaded_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = "BIAS = 3\n"
    with (
        installed(tmp_path, monkeypatch, METRICS, "my_metrics", code, bias="BIAS"),
        pytest.raises(HgorunError, match=r"the metric 'bias' must be a record hgorun\.result\.metrics\.base\.Metric"),
    ):
        small()


def test_windows_without_points_have_no_numbers() -> None:
    """Of the moving mean, too: it needs all of its points."""
    t = 0.1 * np.arange(20)
    x = np.random.default_rng(2).normal(size=(20, 2))
    found = measure(t, x, {"": x + 1}, MetricSettings((5.0, 6.0), (-2.0, -1.0), 0.3, 0.05))[""]
    for name in ("rmse", "sup", "hf", "tv", "peak"):
        assert np.all(np.isnan(found[name])), name
    assert found["settling"].tolist() == [0.0, 0.0]  # without a peak it has settled from the start
    long_mean = measure(t, x, {"": x + 1}, MetricSettings((0.0, 1.9), (0.0, 1.0), 5.0, 0.05))[""]
    assert np.all(np.isnan(long_mean["hf"]))
    assert np.all(np.isfinite(long_mean["rmse"]))


def test_a_metric_of_the_wrong_shape_is_told() -> None:
    one = Metric(name="one", meaning="a single number", unit="1", measure=lambda estimates: np.array(1.0))
    t, x = np.arange(3.0), np.zeros((3, 2))
    with pytest.raises(PluginError, match=r"metric 'one': measure returned an array of shape \(\), expected \(1, 2\)"):
        measure(t, x, {"": x}, MetricSettings((0.0, 2.0), (0.0, 1.0), 1.0, 0.05), [one])
