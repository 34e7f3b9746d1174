"""Collected files, read back: axes of every member, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from collected_files import write

from hgorun.ensemble.collected.collected import Collected
from hgorun.ensemble.collected.reading import is_sweep, read
from hgorun.errors import ConfigError

THETA, SEED = "observers.F.theta", "seed"


def product(path: Path, **more: Any) -> Path:
    """Two gains, three seeds, two observers, one state; the error is 100 theta + 10 seed + observer."""
    theta, seed = np.array([2.0, 4.0]), np.arange(3)
    rmse = 100 * theta[:, None, None, None] + 10.0 * seed[:, None, None] + np.arange(2)[:, None]
    return write(path, {THETA: theta, SEED: seed}, {"rmse": rmse}, observers=["F", "S"], states=["x1"], **more)


def test_members_of_a_product_have_the_values_of_all_axes(tmp_path: Path) -> None:
    found = read(product(tmp_path / "a.sweep.h5"))
    assert found.name == "a"
    assert list(found.axes) == [THETA, SEED]
    assert len(found) == found.planned == 6
    expected = 100 * found.axes[THETA] + 10 * found.axes[SEED]
    np.testing.assert_array_equal(found.metrics["rmse"][:, 0, 0], expected)
    np.testing.assert_array_equal(found.metrics["rmse"][:, 1, 0], expected + 1)
    assert found.chosen == (THETA,)
    assert found.sound.all()


def test_members_with_coordinates(tmp_path: Path) -> None:
    axes: dict[str, list[object]] = {"observers.F.type": ["shgo", "fhgo2"], SEED: [4, 7]}
    path = write(
        tmp_path / "z.sweep.h5", axes, {"sup": np.ones((2, 1, 3))}, observers=["F"], states=list("abc"), member=True
    )
    with h5py.File(path, "r+") as file:  # something else that every member has is no axis
        file["evaluations"] = np.arange(2)
        file["evaluations"].dims[0].attach_scale(file["member"])
    found = read(path)
    assert list(found.axes) == list(axes)
    assert found.axes["observers.F.type"].tolist() == ["shgo", "fhgo2"]
    assert found.axes[SEED].tolist() == [4, 7]
    assert found.metrics["sup"].shape == (2, 1, 3)
    assert found.at("observers.F.type", "fhgo2").tolist() == [False, True]


def test_some_of_the_members(tmp_path: Path) -> None:
    kept = {
        "member": np.array([1, 4]),
        "time": np.linspace(0, 1, 5),
        "x": np.zeros((2, 5, 1)),
        "xhat": np.arange(20.0).reshape(2, 2, 5, 1),
    }
    found = read(product(tmp_path / "a.sweep.h5", trajectories=kept))
    some = found.where(found.at(THETA, 4))
    assert some.axes[SEED].tolist() == [0, 1, 2]
    assert some.trajectories is not None
    assert some.trajectories.member.tolist() == [1]  # it was member 4, the second of those that are left
    np.testing.assert_array_equal(some.trajectories.xhat, kept["xhat"][1:])


def test_a_value_is_found_by_the_digits_that_are_shown(tmp_path: Path) -> None:
    rmse = np.zeros((3, 1, 1))
    path = write(
        tmp_path / "l.sweep.h5", {"time.end": [1.2345678, 1.2349, 2.0]}, {"rmse": rmse}, observers=["F"], states=["x"]
    )
    found = read(path)
    assert found.at("time.end", 1.235).tolist() == [False, True, False]  # the nearest
    with pytest.raises(ConfigError, match=r"no member has the value 3; there are 1\.235"):
        found.at("time.end", 3)


def test_values_that_a_message_leaves_out_are_counted(tmp_path: Path) -> None:
    axes = {"time.end": [float(i) for i in range(50)]}
    path = write(tmp_path / "l.sweep.h5", axes, {"rmse": np.zeros((50, 1, 1))}, observers=["F"], states=["x"])
    with pytest.raises(ConfigError, match=r"900; there are 0, 1, .*, 18, \.\.\. \(50 values\) \.\.\., 49$"):
        read(path).at("time.end", 900)


def test_a_collected_file_is_told_from_a_result(tmp_path: Path) -> None:
    assert is_sweep(product(tmp_path / "a.sweep.h5"))
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.attrs["format"] = "hgorun-result-1"
    assert not is_sweep(tmp_path / "r.h5")
    assert not is_sweep(tmp_path / "missing.h5")
    assert not is_sweep(tmp_path)


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.attrs.__setitem__("format", "hgorun-sweep-9"), "a file of another version of hgorun"),
        (lambda f: f.__delitem__("status"), "status is missing"),
        (lambda f: f["status"].__setitem__((0, 0, 0), 17), "none of ok, inaccurate"),
        (lambda f: f.__delitem__("observer"), "observer is missing"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, change: Callable[[h5py.File], None], message: str) -> None:
    path = product(tmp_path / "a.sweep.h5")
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(ConfigError, match=message):
        read(path)


def test_a_file_larger_than_allowed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="larger than"):
        read(product(tmp_path / "a.sweep.h5"), max_memory=100)


def test_axes_that_follow_each_other_are_one_choice() -> None:
    """What one name sets is one choice, points that are spread are not, and neither is a product."""
    eps = np.array([1.0, 2.0, 4.0, 4.0])
    spread = np.array([0.3, 0.9, 0.1, 0.5])
    base = Collected(
        name="x",
        axes={"a": eps, "b": 1 / eps, "c": eps**2, "seed": np.array([0, 0, 0, 1])},
        observers=("F",),
        states=("x",),
        metrics={},
        status=np.zeros((4, 1), dtype=np.int8),
        error=np.full(4, "", dtype=object),
    )
    assert base.chosen == ("a",)
    assert replace(base, axes={"a": eps, "b": spread}).chosen == ("a", "b")
    both = {"a": np.array([1.0, 1.0, 2.0, 2.0]), "b": np.array([1.0, 2.0, 1.0, 2.0])}
    assert replace(base, axes=both).chosen == ("a", "b")
