"""A claim is not decided by the number of an observer that diverged, unless it says that one diverges."""

import json
import math
from pathlib import Path

import pytest

from hgorun.commands.catalogue_options import Claims
from hgorun.commands.claims import claims

STUDY = """
time: {end: 3, output_step: 0.1}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
observers: {A: {type: shgo, theta: 2}, B: {type: shgo, theta: 3}}
measurement: {sampling: {period: 0.1}, delay: 0.4}
solver: {step: 0.01}
runs:
  calm: {}
  wild: {observers: {B: {theta: 400}}}
  some: {vary: {name: theta, values: [3, 400], set: {observers.B.theta: theta}}}
  all: {seeds: 2, measurement: {noise: [{type: gaussian, std: 0.01}]}, observers: {B: {theta: 400}}}
claims:
"""
CLAIMS = {  # B of the run wild diverges: its numbers are infinite; so it does in one member of some, in each of all
    "is better": ("rmse('calm/A', x1)/rmse('wild/B', x1)", "below: 0.5", "undecidable"),
    "is not better": ("rmse('calm/A', x1)/rmse('wild/B', x1)", "above: 0.5", "undecidable"),
    "is worse": ("rmse('wild/B', x1)/rmse('calm/A', x1)", "above: 2", "undecidable"),
    "is not much worse": ("rmse('wild/B', x1)/rmse('calm/A', x1)", "below: 2", "undecidable"),
    "own difference": ("rmse('wild/B', x1) - rmse('wild/B', x2)", "below: 2", "undecidable"),
    "difference above": ("rmse('calm/A', x1) - rmse('wild/B', x1)", "above: 0", "undecidable"),
    "difference below": ("rmse('calm/A', x1) - rmse('wild/B', x1)", "below: 0", "undecidable"),
    "difference between": ("rmse('calm/A', x1) - rmse('wild/B', x1)", "between: [-1, 1]", "undecidable"),
    "other difference": ("rmse('wild/B', x1) - rmse('calm/A', x1)", "below: 0", "undecidable"),
    "sum": ("rmse('calm/A', x1) + rmse('wild/B', x1)", "below: 5", "undecidable"),
    "minus": ("-rmse('wild/B', x1)", "above: 0", "undecidable"),
    "reciprocal": ("1/rmse('wild/B', x1)", "above: 0.5", "undecidable"),
    "has a sign": ("mean('wild/B', x1)", "below: 2", "undecidable"),
    "is large": ("rmse('wild/B', x1)", "above: 2", "undecidable"),
    "is small": ("rmse('wild/B', x1)", "below: 2", "refuted"),
    "is small in per cent": ("100*rmse('wild/B', x1)", "below: 2", "refuted"),
    "some small": ("rmse('some/B', x1)", "below: 5", "refuted"),
    "some between": ("rmse('some/B', x1)", "between: [0, 5]", "refuted"),
    "some large": ("rmse('some/B', x1)", "above: 0", "undecidable"),
    "some better": ("rmse('some/B', x1) - rmse('some/A', x1)", "below: 0", "undecidable"),
    "some diverge": ("rmse('some/B', x1)", "above: 1.0e+6, divergence: true", "undecidable"),
    "all small": ("rmse('all/B', x1)", "below: 5", "refuted"),
    "all large": ("rmse('all/B', x1)", "above: 0", "undecidable"),
    "all diverge": ("rmse('all/B', x1)", "above: 1.0e+6, divergence: true", "confirmed"),
    "others of some": ("rmse('some/A', x1)", "below: 5", "confirmed"),
    "lies between": ("rmse('wild/B', x1)", "between: [1, 2]", "refuted"),
    "diverges": ("rmse('wild/B', x1)", "above: 1.0e+6, divergence: true", "confirmed"),
    "before": ("sup('wild/B', x1, 0, 0.05)", "below: 10", "confirmed"),
}


def test_what_follows_from_an_observer_that_diverged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = [
        f'  - {{id: {name}, claim: It {name}., value: "{value}", {relation}}}'
        for name, (value, relation, _) in CLAIMS.items()
    ]
    Path("study.yaml").write_text(STUDY + "\n".join(lines) + "\n")
    assert claims(Claims(names=["study.yaml"], json=True)) == 0
    printed = capsys.readouterr()
    told = {one["id"]: one for one in json.loads(printed.out)}
    assert {name: one["verdict"] for name, one in told.items()} == {name: one[2] for name, one in CLAIMS.items()}
    assert told["diverges"]["value"] == told["is small"]["value"] == "inf"
    why = told["is better"]["undecidable"]
    assert why.startswith("It has no number: run wild, observer B diverged at t=")
    assert "`divergence: true`" in why
    assert told["is small"]["undecidable"] is None
    # of an ensemble: who, in how many members, since when
    since = "t=0.02 s"
    assert f"run wild, observer B diverged at {since}" in why
    one = f"observer B: of 2 members 1 diverged, the earliest at {since}"
    assert told["some large"]["undecidable"].startswith(f"1 of its 2 numbers are missing: run some, {one}.")
    assert told["some diverge"]["undecidable"].startswith("1 of its 2 numbers are not finite, neither all nor none: ")
    assert "`divergence: true`" not in told["some diverge"]["undecidable"]
    assert "run all, observer B: of 2 members 2 diverged, the earliest" in told["all large"]["undecidable"]
    assert (told["some small"]["value"], told["some small"]["interval"]) == ("inf", None)
    assert f"hgorun: study: some: {one}\n" in printed.err
    # the direction of the threshold decides what the infinite error counts as, so a change of it is seen
    text = Path("study.yaml").read_text()
    Path("study.yaml").write_text(text.replace('x1)", below: 2}', 'x1)", above: 2}'))
    assert claims(Claims(names=["study.yaml"], json=True)) == 0
    assert {one["id"]: one["verdict"] for one in json.loads(capsys.readouterr().out)}["is small"] == "undecidable"


def test_a_slope_is_not_drawn_through_values_at_which_the_observer_diverged() -> None:
    from types import SimpleNamespace
    from typing import Any

    import numpy as np

    from hgorun.result.quantities.quantity import Quantity
    from hgorun.study.measured import _slope

    run: Any = SimpleNamespace(values=(1.0, 2.0, 4.0, 8.0))
    asked = Quantity("exponent", (("r", "A"),), "x1", (1.0, 4.0))
    found = np.array([3.0, 12.0, 48.0, math.inf])  # 3 v^2
    assert _slope(run, found, asked) == pytest.approx(2, rel=1e-12)
    assert math.isinf(_slope(run, found, Quantity("exponent", asked.of, "x1")))


def test_the_reason_is_of_the_observer_and_not_of_one_whose_name_begins_alike() -> None:
    from types import SimpleNamespace
    from typing import Any

    from hgorun.reproduce.job import Outcome
    from hgorun.reproduce.verdicts import _lost
    from hgorun.result.quantities.quantity import Quantity

    of = (("one", "B"), ("many", "B"))
    study: Any = SimpleNamespace(quantities=lambda claim: [Quantity("difference", of, "x1")])
    told = {
        "one": ["observer B b diverged at t=1 s", "observer B diverged at t=2 s"],
        "many": ["observer B b: of 2 members 1 diverged", "observer B: of 3 members 2 diverged"],
    }
    expected = ["run one, observer B diverged at t=2 s", "run many, observer B: of 3 members 2 diverged"]
    assert _lost(study, 0, Outcome(troubles=told)) == expected
