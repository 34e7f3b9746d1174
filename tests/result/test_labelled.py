"""Results as labelled data of other packages hold the arrays of the result."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from hgorun.errors import HgorunError
from hgorun.result.records.data import Measurements
from hgorun.result.records.observer import ObserverResult
from hgorun.result.records.recorded import Assessed, Recorded, RecordedOutput
from hgorun.result.result import Result

TIME = np.linspace(0, 1, 5)
RANDOM = np.random.default_rng(0)
XHAT = {label: RANDOM.normal(size=(5, 2)) for label in ("A", "B")}


def result(*, recorded: bool) -> Result:
    """Two observers of a plant with two states, simulated or of recorded data."""
    samples = np.arange(3.0)
    band = {label: Assessed(xhat - 1, xhat + 1, {}, {}) for label, xhat in XHAT.items()}
    more: dict[str, Any] = {}
    if recorded:
        flags = np.ones((3, 2), dtype=bool)
        output = RecordedOutput(samples, samples + 0.5, samples**2, flags, np.zeros((3, 2)), np.zeros((3, 2)))
        more["recorded"] = Recorded({"y": output})
    return Result(
        name="small",
        title="small",
        time=TIME,
        x=np.zeros((5, 0)) if recorded else np.stack([TIME, TIME**2], axis=1),
        u=TIME[:, None] * 3,
        y=np.zeros((5, 0)) if recorded else TIME[:, None],
        states=("x1", "x2"),
        inputs=("D",),
        outputs=("y",),
        units={"time": "h"},
        measurements=Measurements(np.zeros(0), np.zeros((0, 1)), np.zeros((0, 1))),
        observers={
            label: ObserverResult(
                type="shgo", xhat=xhat, internal={}, gains={}, dimension=2, assessed=band[label] if recorded else None
            )
            for label, xhat in XHAT.items()
        },
        config="",
        resolved="",
        seed=0,
        **more,
    )


def test_a_simulation_as_a_table() -> None:
    table = result(recorded=False).to_pandas()
    assert list(table.columns) == [
        ("plant", "x1"), ("plant", "x2"), ("plant", "D"), ("A", "x1"), ("A", "x2"), ("B", "x1"), ("B", "x2")
    ]  # fmt: skip
    np.testing.assert_array_equal(table.index, TIME)
    np.testing.assert_array_equal(table["plant", "x2"], TIME**2)
    np.testing.assert_array_equal(table["B"], XHAT["B"])


def test_an_estimate_as_a_table_has_bands_and_no_truth() -> None:
    table = result(recorded=True).to_pandas()
    assert list(table["A"].columns) == ["x1", "x1_lower", "x1_upper", "x2", "x2_lower", "x2_upper"]
    assert list(table["plant"].columns) == ["D"]
    np.testing.assert_array_equal(table["A", "x2_upper"], XHAT["A"][:, 1] + 1)


def test_a_simulation_with_labels() -> None:
    data = result(recorded=False).to_xarray()
    np.testing.assert_array_equal(data["xhat"].sel(observer="B", state="x2"), XHAT["B"][:, 1])
    np.testing.assert_array_equal(data["x"].sel(state="x2"), TIME**2)
    assert data["time"].attrs["units"] == "h"


def test_an_estimate_with_labels_has_its_samples_and_bands() -> None:
    data = result(recorded=True).to_xarray()
    assert "x" not in data
    np.testing.assert_array_equal(data["lower"].sel(observer="A"), XHAT["A"] - 1)
    np.testing.assert_array_equal(data["y_available"], [0.5, 1.5, 2.5])
    np.testing.assert_array_equal(data["y"], [0, 1, 4])


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_a_package_that_is_missing_is_named(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(HgorunError, match=rf"pip install 'hgorun\[{package}\]'"):
        getattr(result(recorded=False), f"to_{package}")()
