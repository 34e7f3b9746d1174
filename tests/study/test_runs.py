"""Files with several runs: what each run is, ensembles, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from ensembles import numbers

import hgorun
from hgorun.errors import ConfigError
from hgorun.noise.sinusoids import Sinusoids
from hgorun.observers.fhgo2 import FilteredObserver2
from hgorun.observers.shgo import StandardObserver
from hgorun.result.quantities.quantities import measure_quantity
from hgorun.result.quantities.quantity import Quantity
from hgorun.study.check import check
from hgorun.study.ensembles import ensemble_of
from hgorun.study.measured import values_of

BASE = """\
title: study
time: {end: 4, output_step: 0.01}
plant: {type: integrator_chain, n: 2, initial: {x1: 1, x2: 0}}
measurement:
  noise: [{type: uniform, low: -1, high: 1, hold: 0.02}]
observers:
  A: {type: shgo, theta: 2}
runs:
  one: {}
  two:
    title: second
    observers: {A: {theta: 3}, B: {type: fhgo2, theta: 2, r: 1}}
  random: {seeds: 4, seed: 7}
  eps:
    measurement: {noise: [{type: sinusoids, terms: [{amplitude: 1, omega: 10}]}]}
    vary: {name: eps, values: [0.01, 0.02, 0.05], set: {measurement.noise.0.terms.0.omega: 1/eps}}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "study.yaml"
    path.write_text(text)
    return path


def theta_of(experiment: hgorun.Experiment) -> float:
    observer = experiment.observers["A"]
    assert isinstance(observer, StandardObserver)
    return observer.theta


def test_a_run_is_the_file_with_its_changes_merged(tmp_path: Path) -> None:
    path = written(tmp_path, BASE)
    study = hgorun.load_study(path)
    assert list(study.runs) == ["one", "two", "random", "eps"]
    one, two = (hgorun.load(path, run=name) for name in ("one", "two"))
    assert (one.blocks.title, two.blocks.title) == ("study", "second")
    assert theta_of(one) == 2
    assert theta_of(two) == 3
    assert list(two.observers) == ["A", "B"]
    assert two.name == "two"


def test_a_run_gives_the_numbers_of_the_same_file_without_runs(tmp_path: Path) -> None:
    path = written(tmp_path, BASE)
    alone = tmp_path / "alone.yaml"
    alone.write_text(BASE[: BASE.index("runs:")])
    a, b = hgorun.simulate(hgorun.load(path, run="one")), hgorun.simulate(hgorun.load(alone))
    np.testing.assert_array_equal(a.observers["A"].xhat, b.observers["A"].xhat)


@pytest.mark.costly
def test_members_of_an_ensemble_are_runs_with_their_seed(tmp_path: Path) -> None:
    path = written(tmp_path, BASE)
    run = hgorun.load_study(path).runs["random"]
    asked = [Quantity("rmse", (("random", "A"),), "x2")]
    found = numbers(run, asked, tmp_path)[str(asked[0])]
    alone = tmp_path / "alone.yaml"
    alone.write_text(BASE[: BASE.index("runs:")])
    expected = [hgorun.simulate(hgorun.load(alone, seed=seed)).metrics()["A"]["rmse"]["x2"] for seed in (7, 8, 9, 10)]
    assert found.tolist() == [expected]


BOTH = """\
  both:
    seeds: 3
    vary: {name: k, values: [2, 4], set: {SET}}
"""


@pytest.mark.measured("two")
@pytest.mark.slow
@pytest.mark.parametrize(
    "assigned", ["{observers.A.theta: k}", "{observers.A.theta: k, measurement.noise.0.high: k/2}"], ids=["one", "two"]
)
def test_values_and_seeds_make_a_product(tmp_path: Path, assigned: str) -> None:
    """Metrics, and quantities that only trajectories give, are those of every seed with every value."""
    path = written(tmp_path, BASE + BOTH.replace("{SET}", assigned))
    run = hgorun.load_study(path).runs["both"]
    assert (run.shape, run.values, list(run.seeds)) == ((2, 3), (2, 4), [0, 1, 2])
    asked = [Quantity("rmse", (("both", "A"),), "x2"), Quantity("std", (("both", "A"),), "x1", (1.0, 3.0))]
    found = numbers(run, asked, tmp_path)
    for v, value in enumerate(run.values):
        for seed in run.seeds:
            alone = hgorun.simulate(run.base.varied(run.changes(value) | {"seed": seed}))
            expected = [measure_quantity(q, {"both": alone}) for q in asked]
            assert [found[str(q)][v, seed] for q in asked] == expected
    collected = hgorun.read_sweep(tmp_path / "both.sweep.h5")
    grid = {"observers.A.theta": 2, "seed": 3} if assigned.count("k") == 1 else {"member": 6}
    assert collected.dimensions == grid
    assert collected.axes["seed"].tolist() == [0, 1, 2, 0, 1, 2]


def test_a_claim_on_values_and_seeds_has_a_number_a_seed(tmp_path: Path) -> None:
    """A slope is that of one seed over the values; other numbers are averaged over the values."""
    text = BASE + BOTH.replace("{SET}", "{observers.A.theta: k}")
    measured = {
        "amplitude('both/A', x1)": np.array([[1.0, 1.0, 3.0], [2.0, 4.0, 3.0]]),
        "rmse('both/A', x1)": np.array([[1.0, 2.0, 3.0], [3.0, 4.0, 5.0]]),
    }
    for value, expected in (
        ("exponent('both/A', x1)", [1.0, 2.0, 0.0]),
        ("rmse('both/A', x1)", [2.0, 3.0, 4.0]),
        ("exponent('both/A', x1)*rmse('both/A', x1)", [2.0, 6.0, 0.0]),
    ):
        claims = f'claims:\n  - {{id: a, claim: so, value: "{value}", below: 9}}\n'
        study = hgorun.load_study(written(tmp_path, text + claims))
        check(study)
        (found,) = values_of(study, 0, {}, {"both": measured}, lambda _: 0.0)
        assert found == pytest.approx(expected)


@pytest.mark.slow
def test_a_member_that_fails_says_where(tmp_path: Path) -> None:
    path = written(tmp_path, BASE.replace("n: 2,", "n: 2, phi: x1**3 + x1,"))
    run = hgorun.load_study(path).runs["random"]
    words = r"run random: 4 of 4 members failed, the first with seed 7: .*study.yaml:3"
    with pytest.raises(hgorun.SimulationError, match=words):
        numbers(run, [Quantity("rmse", (("random", "A"),), "x2")], tmp_path)


def test_members_of_vary_differ_in_what_is_set(tmp_path: Path) -> None:
    run = hgorun.load_study(written(tmp_path, BASE)).runs["eps"]
    omegas = []
    for member in run.members():
        (noise,) = member.measurement.noise or ()
        assert isinstance(noise, Sinusoids)
        omegas.append(noise.terms[0].omega)
    assert omegas == pytest.approx([100, 50, 20])


def test_overrides_and_seed_reach_every_run(tmp_path: Path) -> None:
    path = written(tmp_path, BASE)
    study = hgorun.load_study(path, ["time.end=2", "runs.two.observers.B.r=2"], seed=5)
    assert [run.experiment.blocks.time.end for run in study.runs.values()] == [2, 2, 2, 2]
    b = study.runs["two"].experiment.observers["B"]
    assert isinstance(b, FilteredObserver2)
    assert b.r == 2
    assert study.runs["one"].experiment.blocks.seed == 5


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("  one: {}", "  one: 3", 9, "expected a mapping"),
        ("  one: {}", "  a/b: {}", 9, "a run's name"),
        ("  one: {}", "  one: {claims: []}", 9, "belongs to the file"),
        ("  one: {}", "  one: {extends: x.yaml}", 9, "belongs to the file"),
        ("seeds: 4", "seeds: 1", 13, "at least 2"),
        (
            "  random: {seeds: 4, seed: 7}",
            "  random: {seeds: 4, vary: {name: a, values: [1], set: {seed: a}}}",
            13,
            "let one of them set seed",
        ),
        (
            "  random: {seeds: 4, seed: 7}",
            "  random: {seeds: 100000, vary: {name: a, values: [" + "1, " * 10 + "1], set: {observers.A.theta: a}}}",
            13,
            "more than 1000000 members",
        ),
        (
            "  random: {seeds: 4, seed: 7}",
            "  random: {vary: {name: a, values: [1], set: {}}}",
            13,
            "it sets nothing",
        ),
        ("values: [0.01, 0.02, 0.05]", "values: []", 16, "at least one"),
        ("theta: 3", "theta: -3", 12, "above 0"),
    ],
)
def test_wrong_runs_are_refused_with_their_line(tmp_path: Path, old: str, new: str, line: int, words: str) -> None:
    assert old in BASE
    path = written(tmp_path, BASE.replace(old, new))
    with pytest.raises(hgorun.ConfigError) as caught:
        _ = [list(run.members()) for run in hgorun.load_study(path).runs.values()]
    assert words in str(caught.value)
    assert f"study.yaml:{line}" in str(caught.value)


def test_a_wrong_expression_of_vary_is_refused(tmp_path: Path) -> None:
    run = hgorun.load_study(written(tmp_path, BASE.replace("1/eps", "1/epsilon"))).runs["eps"]
    with pytest.raises(hgorun.ConfigError, match="epsilon"):
        list(run.members())


def test_all_paths_of_vary_that_lead_nowhere_are_told_with_their_lines(tmp_path: Path) -> None:
    """By a simulation and by whoever looks at every member."""
    paths = ["observers.A.theta", "observers.Q.theta", "observers.R.poles", "measurment.delay"]
    lines = "".join(f"        {path}: v\n" for path in paths)
    varied = f"  all:\n    vary:\n      name: v\n      values: [1, 2]\n      set:\n{lines}"
    path = written(tmp_path, BASE + varied)
    study = hgorun.load_study(path)
    first = 1 + path.read_text().splitlines().index(f"        {paths[1]}: v")
    for refused in (lambda: check(study), lambda: ensemble_of(study.runs["all"])):
        with pytest.raises(ConfigError, match="no observer is called 'Q'") as caught:
            refused()
        told = [caught.value, *caught.value.others]
        assert [(one.key, one.line) for one in told] == [
            (f"runs.all.vary.set.{path}", first + k) for k, path in enumerate(paths[1:])
        ]
        assert "Did you mean `measurement`?" in told[2].message


def test_a_file_with_runs_needs_the_name_of_one(tmp_path: Path) -> None:
    path = written(tmp_path, BASE)
    with pytest.raises(hgorun.ConfigError, match="one, two, random, eps"):
        hgorun.load(path)
    with pytest.raises(hgorun.ConfigError, match="Did you mean"):
        hgorun.load(path, run="ones")
    alone = tmp_path / "alone.yaml"
    alone.write_text(BASE[: BASE.index("runs:")])
    with pytest.raises(hgorun.ConfigError, match="has no runs"):
        hgorun.load(alone, run="one")


def test_a_key_of_all_observers_is_varied_in_each_of_them(tmp_path: Path) -> None:
    """Also with figures and claims beside it, which look at every member."""
    vary = "{name: v, values: [1, 2], set: {observers.*.theta: 2*v}}"
    varied = f"  all: {{observers: {{B: {{type: shgo, theta: 5}}}}, vary: {vary}}}"
    study = hgorun.load_study(written(tmp_path, f"{BASE}{varied}\nfigures: {{f: {{panels: [{{state: x1}}]}}}}\n"))
    check(study)
    members = [[one.observers[label] for label in ("A", "B")] for one in study.runs["all"].of_values()]
    assert [[getattr(observer, "theta", None) for observer in one] for one in members] == [[2, 2], [4, 4]]
    wrong = hgorun.load_study(written(tmp_path, BASE + varied.replace("2*v", "v - 2")))
    with pytest.raises(
        ConfigError, match=r"runs\.all\.vary\.set\.observers\.\*\.theta: .*found -1\.0 \(for the value 1\)"
    ):
        check(wrong)
