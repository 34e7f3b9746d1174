"""Findings as records: the reference in the documentation, and findings and observers of other packages."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import chain, experiment, sinusoid
from outside import DOCS, code_of, installed

import hgorun
from hgorun.analysis.finding import FINDINGS, all_findings
from hgorun.cli import main
from hgorun.observers.base import OBSERVERS
from hgorun.tables import analysis as table

# the standard observer again, as somebody else would write it: nothing but bases and capabilities
OUTSIDE = """
import numpy as np
from hgorun.observers.base import ContinuousObserver, Flow
from hgorun.observers.capabilities import HighGain


class Mine(HighGain, ContinuousObserver):
    def design(self, form):
        n = form.plant.n
        k = np.poly(-np.ones(n))[1:]
        return {"gain": self.theta ** np.arange(1, n + 1) * k}

    def equations(self, plant, s, e, k):
        return Flow({"xhat": plant.copy(s.xhat) - k.gain * e})

    def fastest_rate(self, form):
        return self.theta
"""


def test_findings_are_asked_for_by_name() -> None:
    one = experiment(chain(2), {"o": {"type": "shgo", "theta": 2}}, end=0.1)
    found = hgorun.analyze(one, ["hurwitz", FINDINGS.find("poles")])
    assert [finding.name for finding in found.findings] == ["hurwitz", "poles"]
    assert found.observers["o"].values["hurwitz"] is True


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("poles", "findings: expected a list of names, such as ['poles'], found 'poles'"),
        ({"poles": 1}, "findings: expected a list of names, such as ['poles'], found a mapping"),
        (3, "findings: expected a list of names, such as ['poles'], found 3"),
        (["poles", 3], "findings: expected a list of names, such as ['poles'], found 3 in it"),
        (["pole"], "findings: no finding is called 'pole'. Did you mean `poles`? Known: poles, "),
    ],
)
def test_what_is_no_finding_is_said_before_the_run(monkeypatch: pytest.MonkeyPatch, asked: Any, said: str) -> None:
    monkeypatch.setattr("hgorun.analysis.report.prepare", None)
    with pytest.raises(hgorun.ConfigError) as caught:
        hgorun.analyze(experiment(chain(2), {"o": {"type": "shgo", "theta": 2}}), asked)
    assert str(caught.value).startswith(said)


def test_the_page_has_the_reference() -> None:
    assert table.reference(all_findings()) in (DOCS / "analysis.md").read_text(encoding="utf-8")


def test_every_finding_says_what_it_is() -> None:
    for finding in all_findings():
        assert finding.meaning, finding.name
        assert FINDINGS.find(finding.name) is finding


@pytest.mark.costly
def test_a_finding_from_outside_is_like_a_built_in_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code = code_of("extending.md", "@finding(")
    with installed(tmp_path, monkeypatch, FINDINGS, "my_findings", code, damping="damping"):
        observers = {"SHGO": {"type": "shgo", "theta": 4, "poles": [-3, -1]}, "D": {"type": "levant", "G": 1}}
        made = hgorun.analyze(experiment(chain(2), observers, step=0.01))
        found = made.as_json()["observers"]
        assert found["SHGO"]["damping"] == 1
        assert found["D"]["damping"] is None
        assert found["D"]["reasons"]["damping"] == found["D"]["reasons"]["poles"]
        assert "damping" in table.text(made)
        assert "| `damping` |" in table.reference(all_findings())
        monkeypatch.setattr(sys, "argv", ["hgorun", "show", "damping"])
        with pytest.raises(SystemExit) as stop:
            main()
        assert stop.value.code == 0
        assert "least damped pole" in capsys.readouterr().out
    assert "damping" not in {finding.name for finding in all_findings()}


@pytest.mark.slow
def test_an_observer_from_outside_gets_the_theory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same numbers as the built-in observer of the same equations."""
    with installed(tmp_path, monkeypatch, OBSERVERS, "my_observers", OUTSIDE, mine="Mine"):
        observers = {"Mine": {"type": "mine", "theta": 20}, "SHGO": {"type": "shgo", "theta": 20}}
        measurement = {"noise": sinusoid(0.01, 30)}
        made = hgorun.analyze(
            experiment(chain(2, "-x1 - x2"), observers, end=5, output_step=0.01, measurement=measurement)
        )
        mine, shgo = (made.observers[label] for label in observers)
        assert set(mine.values) == set(shgo.values)
        assert mine.reasons == shgo.reasons
        for name in ("beta", "chi", "theta_bound", "delay_bound", "eta_theta", "period_critical", "delay_critical"):
            assert mine.values[name] == pytest.approx(shgo.values[name], rel=1e-9), name
        for name in ("peaking_bound", "noise_rms_predicted", "noise_exponent_theta", "h2", "hinf"):
            assert mine.values[name] == pytest.approx(shgo.values[name], rel=1e-6), name
        assert np.all(mine.values["poles"] == -1)
