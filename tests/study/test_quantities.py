"""Quantities of claims against the same computed from the trajectories with plain numpy."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hgorun
from hgorun.config.expressions import ExpressionError
from hgorun.config.study import Claim
from hgorun.errors import Problem
from hgorun.result.quantities.quantities import exponent, measure_quantity
from hgorun.study.check import check
from hgorun.study.measured import asked_of, values_of
from hgorun.study.sentences import read_sentence
from hgorun.study.theory import theory_of
from hgorun.study.verdict import judge

CONFIG = """\
time: {end: 6, output_step: 0.01}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
measurement: {noise: [{type: sinusoids, terms: [{amplitude: 1, omega: 30}]}]}
observers: {A: {type: shgo, theta: 2}, B b: {type: fhgo2, theta: 2, r: 1}}
runs:
  noisy: {}
  quiet: {measurement: {noise: [{type: sinusoids, terms: [{amplitude: 0, omega: 1}]}]}}
"""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, hgorun.Result]:
    path = tmp_path_factory.mktemp("quantities") / "file.yaml"
    path.write_text(CONFIG)
    return {name: hgorun.simulate(hgorun.load(path, run=name)) for name in ("noisy", "quiet")}


def error(result: hgorun.Result, label: str, state: int, window: tuple[float, float]) -> np.ndarray:
    inside = (result.time >= window[0] - 1e-9) & (result.time <= window[1] + 1e-9)
    return (result.observers[label].xhat[:, state] - result.x[:, state])[inside]


STEADY = (2.0, 6.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("rmse('noisy/A', x2)", lambda r: np.sqrt(np.mean(error(r["noisy"], "A", 1, STEADY) ** 2))),
        ("rmse('noisy/A', x2, 3, 5)", lambda r: np.sqrt(np.mean(error(r["noisy"], "A", 1, (3, 5)) ** 2))),
        ("sup('noisy/B b', x1, 1, 6)", lambda r: np.abs(error(r["noisy"], "B b", 0, (1, 6))).max()),
        ("std('noisy/B b', x1)", lambda r: np.std(error(r["noisy"], "B b", 0, STEADY))),
        ("mean('noisy/A', x1, 0, 6)", lambda r: np.mean(error(r["noisy"], "A", 0, (0, 6)))),
        ("amplitude('noisy/A', x1)", lambda r: np.ptp(error(r["noisy"], "A", 0, STEADY)) / 2),
        ("integral('noisy/A', x1)", lambda r: np.trapezoid(np.abs(error(r["noisy"], "A", 0, (0, 6))), dx=0.01)),
        ("largest('noisy', x1)", lambda r: np.abs(r["noisy"].x[:, 0]).max()),
        (
            "difference('noisy/A', 'quiet/A', x2)",
            lambda r: np.abs(error(r["noisy"], "A", 1, STEADY) - error(r["quiet"], "A", 1, STEADY)).max(),
        ),
        (
            "ni('noisy/A','quiet/A',x2)",
            lambda r: np.sqrt(np.mean((error(r["noisy"], "A", 1, STEADY) - error(r["quiet"], "A", 1, STEADY)) ** 2)),
        ),
        (
            "max(rmse('noisy/A', x1)/rmse('noisy/B b', x1), 2*sup('noisy/A', x2))",
            lambda r: max(
                np.sqrt(np.mean(error(r["noisy"], "A", 0, STEADY) ** 2))
                / np.sqrt(np.mean(error(r["noisy"], "B b", 0, STEADY) ** 2)),
                2 * np.abs(error(r["noisy"], "A", 1, STEADY)).max(),
            ),
        ),
    ],
)
def test_values(results: dict[str, hgorun.Result], text: str, expected: object) -> None:
    sentence = read_sentence(text, ("noisy", "quiet"))
    value = sentence.value({str(q): measure_quantity(q, results) for q in sentence.quantities})
    assert value == pytest.approx(expected(results), rel=1e-9)  # type: ignore[operator]  # a function


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rmse(A, x1)", "'A' is no observer's label"),
        ("2*x1", "expected quantities"),
        ("rms('noisy/A', x1)", "no quantity is called 'rms'"),
        ("rmse('A', x1)", "several runs"),
        ("rmse('noisy/A')", "needs a state"),
        ("rmse('noisy/A', x1, 3)", "from and to"),
        ("difference('noisy/A', x1)", "takes 2 name"),
        ("largest('noisy/A', x1)", "name of a run"),
        ("rmse('noisy/A', x1) + y", "y"),
        ("__import__('noisy/A', x1)", "no quantity"),
        ("rmse('noisy/A', x1)('noisy')", "outside"),
    ],
)
def test_wrong_text_is_refused(text: str, words: str) -> None:
    with pytest.raises(ExpressionError, match=None) as caught:
        read_sentence(text, ("noisy", "quiet"))
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("bare", "quoted"),
    [
        ("rmse(A, x1)/rmse('B b', x1)", "rmse('A', x1)/rmse('B b', x1)"),
        ("2*rmse( A ,x1, 2, 3)", "2*rmse('A', x1, 2, 3)"),
        ("difference(A, C, x1) + ni('B b', C, x1)", "difference('A', 'C', x1) + ni('B b', 'C', x1)"),
        ("difference(A, x1, x2)", "difference('A', 'x1', x2)"),  # an observer may be called as a state
        ("largest(x1) - cost(plant)", "largest(x1) - cost('plant')"),
        ('rmse("B b", x1)', "rmse('B b', x1)"),
        ("rmse('say \"C\"', x1)", "rmse('say \"C\"', x1)"),
    ],
)
def test_labels_without_quotes(bare: str, quoted: str) -> None:
    labels = ["A", "B b", "C", "x1", 'say "C"']
    found, right = read_sentence(bare, ("only",), labels), read_sentence(quoted, ("only",))
    assert found.quantities == right.quantities
    values = {str(q): 1.5 + i for i, q in enumerate(found.quantities)}
    assert found.value(values) == right.value(values)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("rmse(leeky, x1)", "'leeky' is no observer's label"),
        ("rmse(leeky, x1)", "rmse('leeky', ...). Did you mean `leaky`? Known: leaky, B b"),
        ("rmse(r/leaky, x1)", "stand in quotes: rmse('r/leaky', ...)"),
        ("2*rmse(B b, x1)", "stand in quotes: rmse('B b', ...). Known: leaky"),
        ("difference(leaky, B b, x1)", "stand in quotes: difference('leaky', 'B b', ...)"),
        ("rmse(x1)", "'x1' is no observer's label"),
        ("difference(leaky, x1)", "takes 2 name"),
    ],
)
def test_what_is_no_label_is_named(text: str, words: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        read_sentence(text, ("only",), ["leaky", "B b"])
    assert words in str(caught.value)


def test_exponent_is_the_slope_of_the_logarithms() -> None:
    eps = np.array([1e-3, 1e-2, 1e-1, 1.0])
    assert exponent(eps, 3 * eps**1.7, None) == pytest.approx(1.7)
    bent = np.where(eps < 0.05, eps**2, 0.05**2)
    assert exponent(eps, bent, (1e-3, 1e-2)) == pytest.approx(2)
    assert np.isnan(exponent(eps, bent, (5, 6)))


def claim(**threshold: object) -> Claim:
    return Claim.model_validate({"id": "1", "claim": "so", "value": "rmse('A', x1)", **threshold})


def test_verdicts_of_one_number() -> None:
    assert judge(claim(below=1), [[0.5]]).verdict == "confirmed"
    assert judge(claim(below=1), [[1.5]]).verdict == "refuted"
    assert judge(claim(above=1), [[1.5]]).verdict == "confirmed"
    assert judge(claim(between=[1, 2]), [[1.5]]).verdict == "confirmed"
    assert judge(claim(between=[1, 2]), [[2.5]]).verdict == "refuted"
    assert judge(claim(below=1), [[float("nan")]]).verdict == "undecidable"
    assert judge(claim(above=1), [[float("inf")]]).verdict == "confirmed"


def test_interval_is_students() -> None:
    from scipy import stats

    values = np.random.default_rng(3).normal(2, 0.5, 12)
    found = judge(claim(below=3), [list(values)])
    expected = stats.t.interval(0.95, 11, loc=values.mean(), scale=stats.sem(values))
    assert found.measured[0].interval == pytest.approx(expected)
    assert found.verdict == "confirmed"
    low, high = expected
    assert judge(claim(below=(low + high) / 2), [list(values)]).verdict == "undecided"
    assert judge(claim(above=high + 1), [list(values)]).verdict == "refuted"
    assert judge(claim(between=[low - 1, (low + high) / 2]), [list(values)]).verdict == "undecided"


def test_a_claim_on_an_ensemble_has_a_value_a_seed(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    text = CONFIG + "  many: {seeds: 3, measurement: {noise: [{type: uniform, low: -1, high: 1, hold: 0.1}]}}\n"
    text += "claims:\n  - {id: a, claim: so, value: \"sup('many/A', x1)/sup('noisy/A', x1)\", below: 9}\n"
    path.write_text(text)
    study = hgorun.load_study(path)
    check(study)
    noisy = hgorun.simulate(hgorun.load(path, run="noisy"))
    members = {"sup('many/A', x1)": np.array([[1.0, 2.0, 3.0]])}
    (values,) = values_of(study, 0, {"noisy": noisy}, {"many": members}, lambda quantity: 0.0)
    assert values == pytest.approx([v / noisy.metrics()["A"]["sup"]["x1"] for v in (1, 2, 3)])


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("rmse('nosy/A', x1)", "Did you mean"),
        ("rmse('noisy/C', x1)", "has no observer"),
        ("rmse('noisy/A', x3)", "no state is called"),
    ],
)
def test_claims_that_name_nothing_are_refused(tmp_path: Path, value: str, words: str) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(CONFIG + f'claims:\n  - {{id: a, claim: so, value: "{value}", below: 9}}\n')
    with pytest.raises(hgorun.ConfigError, match=r"file.yaml:9: claims\.0\.value") as caught:
        check(hgorun.load_study(path))
    assert words in str(caught.value)


def test_numbers_of_the_analysis(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(CONFIG)
    study = hgorun.load_study(path)
    noisy = hgorun.simulate(hgorun.load(path, run="noisy"))
    look_up = theory_of(study, {"noisy": noisy})
    (beta,) = read_sentence("analysis('noisy/A', beta)", ("noisy", "quiet")).quantities
    assert look_up(beta) == pytest.approx(1 / (2 * (2 + np.sqrt(2))))  # P = [[1, -1], [-1, 3]], mu = 1
    (tau,) = read_sentence("analysis('noisy/A', tau_bound)", ("noisy", "quiet")).quantities
    with pytest.raises(Problem, match="fhgo1"):
        look_up(tau)


def test_a_value_of_what_is_no_number_or_too_large() -> None:
    sentence = read_sentence("rmse('A', x1)/rmse('B', x1)", ("only",))
    one, other = (str(q) for q in sentence.quantities)
    assert np.isnan(sentence.value({one: float("nan"), other: 1.0}))
    assert np.isnan(sentence.value({one: 1.0, other: 0.0}))
    assert sentence.value({one: float("inf"), other: 2.0}) == np.inf
    assert sentence.value({one: -float("inf"), other: 2.0}) == -np.inf
    assert sentence.value({one: 3.0, other: 2.0}) == 1.5


def test_a_number_of_the_analysis_needs_its_key() -> None:
    with pytest.raises(ExpressionError, match="analysis needs a key after the name in quotes"):
        read_sentence("analysis('A')", ("only",))
    (quantity,) = read_sentence("analysis('A', noise_rms_predicted, x2)", ("only",)).quantities
    assert (quantity.key, quantity.state) == ("noise_rms_predicted", "x2")
    assert str(quantity) == "analysis('only/A', noise_rms_predicted, x2)"


def test_a_difference_of_runs_with_other_grids_is_none(results: dict[str, hgorun.Result]) -> None:
    (quantity,) = read_sentence("difference('noisy/A', 'quiet/A', x2)", ("noisy", "quiet")).quantities
    noisy, quiet = results["noisy"], results["quiet"]
    later = replace(quiet, time=quiet.time + 1)
    with pytest.raises(ExpressionError, match="the runs have different output grids"):
        measure_quantity(quantity, {"noisy": noisy, "quiet": later})


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("difference('many/A', 'noisy/A', x1)", "members of different ensembles cannot be compared"),
        ("rmse('noisy/A', x1, 3, 9)", "run noisy lasts from 0 to 6"),
        ("rmse('noisy/A', x1, 3.001, 3.002)", "no output point of run noisy lies in this window"),
        ("exponent('many/A', x1)", "an exponent needs a run with vary, and many has none"),
        ("exponent('eps/A', x1, 5, 6)", "an exponent needs at least two different values > 0 of eps"),
    ],
)
def test_claims_that_cannot_be_measured(tmp_path: Path, value: str, words: str) -> None:
    path = tmp_path / "file.yaml"
    text = CONFIG + "  many: {seeds: 3}\n  eps: {vary: {name: eps, values: [1, 2], set: {observers.A.theta: 1/eps}}}\n"
    path.write_text(text + f'claims:\n  - {{id: a, claim: so, value: "{value}", below: 9}}\n')
    with pytest.raises(hgorun.ConfigError) as caught:
        check(hgorun.load_study(path))
    assert words in str(caught.value)
    assert caught.value.key == "claims.0.value"


def test_two_claims_of_one_name(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    claims = "".join(f"  - {{id: a, claim: so, value: \"rmse('noisy/A', x1)\", below: {i}}}\n" for i in (1, 2))
    path.write_text(CONFIG + "claims:\n" + claims)
    with pytest.raises(hgorun.ConfigError, match=r"file.yaml:10: claims\.1\.id: two claims have the id 'a'"):
        hgorun.load_study(path)


def test_the_slope_of_an_ensemble_of_amplitudes(tmp_path: Path) -> None:
    """Amplitudes 5 eps^2, measured on the members; the claim is about their slope."""
    path = tmp_path / "file.yaml"
    text = CONFIG + "  eps: {vary: {name: eps, values: [0.1, 0.2, 0.4], set: {observers.A.theta: 1/eps}}}\n"
    path.write_text(text + "claims:\n  - {id: a, claim: so, value: \"exponent('eps/A', x1)\", between: [1.9, 2.1]}\n")
    study = hgorun.load_study(path)
    check(study)
    (asked,) = asked_of(study, "eps", [0], [])
    assert str(asked) == "amplitude('eps/A', x1)"
    members = {str(asked): 5 * np.array([[0.1], [0.2], [0.4]]) ** 2}
    ((slope,),) = values_of(study, 0, {}, {"eps": members}, lambda quantity: 0.0)
    assert slope == pytest.approx(2.0)


def test_of_a_file_with_one_run_a_state_needs_no_name_of_it() -> None:
    """So that a file keeps its claims under another name."""
    named, unnamed = read_sentence("2*largest('f', x2, 1, 2)", ("f",)), read_sentence("2*largest( x2, 1, 2)", ("f",))
    assert unnamed.quantities == named.quantities
    assert unnamed.expression.number({"q0": 3.0}) == 6.0
    with pytest.raises(ExpressionError, match=r"several runs: expected largest\('run', state\), found largest\(x2\)"):
        read_sentence("largest(x2)", ("a", "b"))


def test_the_claims_of_every_experiment_of_one_run_hold_under_another_name(tmp_path: Path) -> None:
    for file in (Path(__file__).parents[2] / "experiments").rglob("*.yaml"):
        text = file.read_text()
        if file.name.startswith("_") or "claims:" not in text or "\nruns:" in text:
            continue
        base = re.search("^extends: (.+)$", text, re.MULTILINE)
        if base is not None:
            (tmp_path / base[1]).write_text((file.parent / base[1]).read_text())
        (tmp_path / "mine.yaml").write_text(text)
        check(hgorun.load_study(tmp_path / "mine.yaml"))
