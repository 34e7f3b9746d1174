"""The blocks of a sweep file, and what is said of one that is wrong."""

from __future__ import annotations

import pytest

from hgorun.config.sweeps import Every, ListAxis, LogAxis, SeedAxis, SweepFile, Worst
from hgorun.config.validation import validate
from hgorun.config.yaml_source import parse
from hgorun.errors import ConfigError


def read(text: str) -> SweepFile:
    source = parse(text, "f.yaml")
    return validate(SweepFile, source.data, source, ())


KEPT = "4: keep.trajectories: expected none, all, {worst: 5, by: rmse} or {every: 100}, found "


def axis(text: str) -> str:
    return f"base: a.yaml\naxes:\n  a.b: {text}\n"


def test_every_kind_of_axis_is_read() -> None:
    found = read(
        """
base: a.yaml
axes:
  seed: {count: 3}
  observers.F.theta: {log: [2, 20, 10]}
  solver.step: {linear: [1e-3, pi/100, 4]}
  plant.parameters.a: {uniform: [0, 1], draws: 5}
  plant.parameters.b: {normal: [1, 0.1], draws: 5}
  solver.method: [rk4, euler, 2*pi, 1, true]
keep: {metrics: [rmse], trajectories: {worst: 5, by: rmse}}
"""
    )
    assert found.axes["seed"] == SeedAxis(count=3)
    assert found.axes["observers.F.theta"] == LogAxis(log=(2, 20, 10))
    values = found.axes["solver.method"]
    assert isinstance(values, ListAxis)
    assert list(values.values) == ["rk4", "euler", 6.283185307179586, 1, True]
    assert found.keep.trajectories == Worst(worst=5, by="rmse")
    assert read(axis("[1]") + "keep: {trajectories: {every: 100}}").keep.trajectories == Every(every=100)
    assert (found.combine, read(axis("[1]")).keep.trajectories) == ("product", "none")


def test_whole_numbers_stay_whole() -> None:
    found = read(axis('[1, "2", "2*1", 2.0, 1e0]')).axes["a.b"]
    assert isinstance(found, ListAxis)
    assert [type(value) for value in found.values] == [int, int, float, float, float]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("base: a\naxes: {}", "2: axes: it names nothing to vary"),
        ("base: a\naxes: 5", "2: axes: expected a mapping, found 5"),
        *(
            (f"base: a\naxes:\n  {wrong}", f"3: axes.{wrong.partition(':')[0]}: {told}")
            for wrong, told in (
                ("seed: 50", "50 seeds are the axis `seed: {count: 50}`; the seed 50 alone is `seed: [50]`"),
                ("seed: {draws: 50}", "50 seeds are the axis `seed: {count: 50}`"),
                ("seeds: 50", "50 seeds are the axis `seed: {count: 50}`"),
                ("seed: {linear: [0, 49, 50]}", "50 seeds are the axis `seed: {count: 50}`"),
                ("seed: {log: [1, 50, 50]}", "50 seeds are the axis `seed: {count: 50}`"),
                ("seed: {uniform: [0, 100], draws: 50}", "50 seeds are the axis `seed: {count: 50}`"),
                ("seeds: {count: 50}", "50 seeds are the axis `seed: {count: 50}`"),
                ("seeds: [1, 2]", "the axis of seeds is called `seed`"),
            )
        ),
        ("axes: {a: [1]}", "1: base: this key is missing"),
        ("base: 3\naxes: {a: [1]}", "1: base: expected the name of a file or a configuration, found 3"),
        (axis("{log: [0, 2, 3]}"), "3: axes.a.b.log: a logarithmic axis lies between numbers above 0, found 0 and 2"),
        (axis("{log: [1, 2]}"), "3: axes.a.b.log: expected a list of at least 3, found 2"),
        (axis("{linear: [1, 2, 2.5]}"), "3: axes.a.b.linear.2: expected a whole number, found 2.5"),
        (axis("{linear: [1, 2, 0]}"), "3: axes.a.b.linear.2: expected a number of at least 1, found 0"),
        (axis("{uniform: [1, 2]}"), "3: axes.a.b.draws: this key is missing"),
        (axis("{uniform: [2, 1], draws: 3}"), "3: axes.a.b.uniform: expected [low, high] with low < high"),
        (axis("{normal: [2, -1], draws: 3}"), "3: axes.a.b.normal.1: expected a number of at least 0"),
        (axis("{unifrom: [1, 2]}"), "3: axes.a.b: expected [a, b, ...], {linear: [a, b, n]}, {log: [a, b, n]}"),
        (axis("3"), "3: axes.a.b: expected [a, b, ...], {linear: [a, b, n]}"),
        (axis("{linear: [1, 2, 2], draws: 4}"), "3: axes.a.b.draws: unknown key 'draws'"),
        (axis("[1, [2]]"), "3: axes.a.b.1: expected numbers or text, found a list"),
        (axis("[.nan, 2]"), "3: axes.a.b.0: expected finite numbers, found nan"),
        (axis("[1, -.inf]"), "3: axes.a.b.1: expected finite numbers, found -inf"),
        (axis("{log: [1e-200, 1e200, 3]}"), "3: axes.a.b.log: the ratio of 1e+200 to 1e-200 is not a finite number"),
        (axis("{log: [1e200, 1e-200, 3]}"), "3: axes.a.b.log: the ratio of 1e-200 to 1e+200 is not a finite number"),
        (axis("{linear: [-1e308, 1e308, 3]}"), "3: axes.a.b.linear: the difference of -1e+308 and 1e+308 is not"),
        (axis("{uniform: [-1e308, 1e308], draws: 3}"), "3: axes.a.b.uniform: the difference of -1e+308 and 1e+308"),
        (axis("{normal: [1, 1e308], draws: 3}"), "3: axes.a.b.normal: draws with mean 1 and standard deviation 1e+308"),
        (axis("[]"), "3: axes.a.b: expected at least one value, found an empty list"),
        (axis("[1]") + "keep: {trajectories: {worst: 5}}", "4: keep.trajectories.by: this key is missing"),
        (axis("[1]") + "keep: {trajectories: {every: 0}}", "4: keep.trajectories.every: expected a number of at"),
        (axis("[1]") + "keep: {trajectories: yes}", f"{KEPT}'yes'"),
        (axis("[1]") + "keep: {trajectories: 5}", f"{KEPT}5"),
        (axis("[1]") + "keep: {trajectories: al}", f"{KEPT}'al'. Did you mean `all`?"),
        (axis("[1]") + "keep: {metrics: rmse}", "4: keep.metrics: expected a list, found 'rmse'"),
        (axis("[1]") + "combine: grid", "4: combine: expected 'product', 'zip' or 'sobol', found 'grid'"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read(text)
    assert str(caught.value).startswith(f"f.yaml:{message}")
