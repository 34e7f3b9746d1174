"""A file that is swept: the runs of its figures, what members measure beside theory, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ensembles import numbers

import hgorun
from hgorun.errors import ConfigError
from hgorun.study.measured import asked_of
from hgorun.study.scaling import scaling_data

FILE = """\
time: {end: 40, output_step: 0.01}
plant: {type: integrator_chain, n: 2, initial: {x1: 0, x2: 0}}
measurement: {noise: [{type: sinusoids, terms: [{amplitude: 0.5, omega: 40}]}]}
observers:
  S: {type: shgo, theta: 3}
  F: {type: fhgo2, theta: 3, r: 2}
solver: {step: 2.0e-3}
metrics: {window: [20, 40]}
runs:
  one: {}
  eps: {vary: {name: eps, values: [0.02, 0.04, 0.08], set: {measurement.noise.0.terms.0.omega: 1/eps}}}
figures:
  swept:
    panels:
      - {scaling: {state: x2, of: amplitude, theory: true}}
      - {scaling: {state: x1, of: rmse, run: eps}, observers: [eps/F]}
      - {state: x1, run: one}
  plain: {panels: [{error: x2}, {error: x1, observers: [one/S]}, {error: x1, observers: [F]}]}
claims:
  - {id: "1", claim: Falls like eps., value: "exponent('eps/S', x2, 0.02, 0.08)", between: [0.9, 1.1]}
"""


AGAIN = '{id: "1", claim: Again., value: "rmse(\'one/S\', x1)", below: 1}'


@pytest.fixture
def study(tmp_path: Path) -> hgorun.Study:
    path = tmp_path / "swept.yaml"
    path.write_text(FILE)
    return hgorun.load_study(path)


def transfer(omega: np.ndarray) -> np.ndarray:
    """|x2hat/v| of the standard observer: 9 s/(s + 3)^2."""
    return np.abs(9 * 1j * omega / (1j * omega + 3) ** 2)


def test_runs_of_a_figure(study: hgorun.Study) -> None:
    assert study.runs_of("swept") == ["eps", "one"]
    assert study.runs_of("plain") == ["one"]
    assert {i: (run, len(asked)) for i, (run, asked) in study.scaled("swept").items()} == {0: ("eps", 2), 1: ("eps", 1)}
    assert study.scaled("plain") == {}


def test_measured_values_lie_on_the_line_of_theory(study: hgorun.Study, tmp_path: Path) -> None:
    asked = asked_of(study, "eps", [0], ["swept"])
    assert len(asked) == 3  # the amplitude of x2 that claim and panel share, that of F, its rmse in x1
    found = numbers(study.runs["eps"], asked, tmp_path)
    data = scaling_data(study, "swept", {"eps": found})
    assert list(data) == [0, 1]
    first, second = data[0], data[1]
    assert first.state == "x2"
    expected = 0.5 * transfer(1 / np.array([0.02, 0.04, 0.08]))
    standard, filtered = first.observers["S"], first.observers["F"]
    assert standard.theory is not None
    assert filtered.theory is not None
    np.testing.assert_allclose(standard.theory, expected, rtol=1e-4)
    np.testing.assert_allclose(standard.measured, expected, rtol=0.02)
    np.testing.assert_allclose(filtered.measured, filtered.theory, rtol=0.05)
    assert (standard.filter_order, filtered.filter_order) == (None, 2)
    assert list(second.observers) == ["F"]
    assert second.observers["F"].theory is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("value: \"exponent('eps/S', x2, 0.02, 0.08)\"", 'value: "exponent(x2)"', "exponent"),
        (
            "between: [0.9, 1.1]}",
            'below: 1}\n  - {id: "1", claim: Again., value: "rmse(\'one/S\', x1)", below: 1}',
            "two claims",
        ),
        ("omega: 1/eps}", "omega: 1/epz}", "epz"),
    ],
)
def test_what_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in FILE
    path = tmp_path / "wrong.yaml"
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ConfigError, match=words) as error:
        _ = list(hgorun.load_study(path).runs["eps"].members())
    assert "wrong.yaml:" in str(error.value)
