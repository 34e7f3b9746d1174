"""Gains that are tuned: against brute force, fronts against their definition, and what is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from shell import Shell

from hgorun import load
from hgorun.config.tuning import Tune
from hgorun.ensemble.statistics.fronts import non_dominated
from hgorun.errors import ConfigError, Problem
from hgorun.figures.tuning import Tuned, tuning
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.tuning.evidence import Evidence, _shown, evidence
from hgorun.tuning.loading import gains_of
from hgorun.tuning.search import search
from hgorun.tuning.task import Task, tasks
from hgorun.tuning.trials import Trials, measured

CONFIG = """\
# a double integrator with a noisy sensor
time: {end: 4, output_step: 0.02, unit: s}
plant:
  type: inline
  states: [x1, x2]
  dynamics: {x1: x2, x2: -x1}   # an oscillator
  output: x1
  initial: {x1: 1, x2: 0}
measurement: {sampling: {period: 0.02}, noise: [{type: gaussian, std: 0.1}]}
observers:
  # the gain is to be tuned
  SHGO: {type: shgo, theta: 2, initial: {x1: 0, x2: 2}}
  FHGO: {type: fhgo2, r: 1, theta: 2, initial: {x1: 0, x2: 2}}
solver: {method: rk4, step: 0.02}
"""
THETA = "observers.SHGO.theta"


@pytest.fixture
def experiment(tmp_path: Path) -> Experiment:
    path = tmp_path / "c.yaml"
    path.write_text(CONFIG)
    return load(path)


def block(**more: Any) -> Tune:
    given = {
        "gains": {THETA: {"log": [0.5, 10]}},
        "minimise": "rmse(SHGO, x2)",
        "seeds": 5,
        "held_out": 30,
        "budget": 300,
    }
    return Tune.model_validate(given | more)


def tuned(task: Task) -> Evidence:
    return evidence(search(Trials(task)))


def held_out(task: Task, gains: np.ndarray) -> np.ndarray:
    """Means of all quantities on held-out seeds, for rows of gains."""
    seeds = np.array(task.held_out)
    values = measured(task, np.repeat(gains, len(seeds), axis=0), np.tile(seeds, len(gains)))
    return np.asarray(values.reshape(len(gains), len(seeds), -1).mean(axis=1))


@pytest.mark.costly
def test_the_minimum_of_brute_force(experiment: Experiment) -> None:
    (task,) = tasks(experiment, block())
    found = tuned(task)
    grid = np.geomspace(0.5, 10, 80)[:, None]
    brute = held_out(task, grid)[:, 0].min()
    assert held_out(task, np.array([[found.tuned[THETA]]]))[0, 0] <= 1.05 * brute
    assert found.mean(held_out=True)[0][found.chosen, 0] == held_out(task, np.array([[found.tuned[THETA]]]))[0, 0]


@pytest.mark.costly
def test_the_least_noise_that_settles_in_time(experiment: Experiment) -> None:
    """The limit is active: brute force over the grid that meets it is not beaten by more than the grid's spacing."""
    (task,) = tasks(experiment, block(minimise="hf(SHGO, x2)", subject=[{"value": "settling(SHGO, x2)", "below": 2.2}]))
    found = tuned(task)
    tuned_means = found.mean(held_out=False)[0][found.chosen]
    assert tuned_means[1] <= 2.2
    grid = np.geomspace(0.5, 10, 80)[:, None]
    means = held_out(task, grid)
    brute = means[means[:, 1] < 2.2, 0].min()
    hf, settling = found.mean(held_out=True)[0][found.chosen]
    assert hf <= 1.05 * brute
    assert settling < 1.05 * 2.2


def test_two_gains_against_a_grid(experiment: Experiment) -> None:
    gains = {"observers.FHGO.theta": {"log": [0.5, 10]}, "observers.FHGO.poles": {"linear": [-2, -0.5]}}
    (task,) = tasks(experiment, block(gains=gains, minimise="rmse(FHGO, x2)", budget=1000))
    found = tuned(task)
    theta, poles = np.meshgrid(np.geomspace(0.5, 10, 16), np.linspace(-2, -0.5, 8), indexing="ij")
    brute = held_out(task, np.column_stack([theta.ravel(), poles.ravel()]))[:, 0].min()
    assert found.mean(held_out=True)[0][found.chosen, 0] <= 1.05 * brute


@pytest.mark.costly
def test_three_gains_against_a_grid(experiment: Experiment) -> None:
    """The coefficients of an observer, one by one."""
    own = experiment.varied(
        {"observers.FHGO.theta": 1, "observers.FHGO.poles": None, "observers.FHGO.gains": [3, 3, 1]}
    )
    gains = {f"observers.FHGO.gains.{i}": {"log": [0.5, 20]} for i in range(3)}
    (task,) = tasks(own, block(gains=gains, minimise="rmse(FHGO, x2)", held_out=10, budget=2000))
    found = tuned(task)
    axis = np.geomspace(0.5, 20, 12)
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    assert found.mean(held_out=True)[0][found.chosen, 0] <= 1.05 * held_out(task, grid)[:, 0].min()


@pytest.mark.costly
def test_a_front_beats_what_was_tried(experiment: Experiment) -> None:
    (task,) = tasks(experiment, block(minimise=["hf(SHGO, x2)", "settling(SHGO, x2)"]))
    found = tuned(task)
    trials = found.found.trials
    means = trials.values[trials.complete].mean(axis=1)
    naive = {tuple(row) for row in means[non_dominated(means)]}
    assert {tuple(row) for row in trials.values[found.found.front].mean(axis=1)} == naive
    assert np.all(np.diff(trials.means[found.found.front][:, 0]) >= 0)
    assert trials.spent <= task.budget
    assert found.confidence.shape == (len(found.front),)
    assert np.all((found.confidence >= 0) & (found.confidence <= 1))


def test_every_observer_has_the_same_budget_and_the_same_number_of_gains(experiment: Experiment) -> None:
    found = tasks(experiment, block(gains={"observers.*.theta": {"log": [0.5, 10]}}, minimise="rmse(*, x2)"))
    assert [task.label for task in found] == ["SHGO", "FHGO"]
    assert [list(task.base.observers) for task in found] == [["SHGO"], ["FHGO"]]
    assert len({(task.budget, len(task.gains), task.seeds, task.held_out) for task in found}) == 1
    uneven = {"observers.*.theta": {"log": [0.5, 10]}, "observers.FHGO.poles": {"linear": [-2, -0.5]}}
    with pytest.raises(Problem, match="equally many gains; found SHGO 1, FHGO 2"):
        tasks(experiment, block(gains=uneven, minimise="rmse(*, x2)"))


@pytest.mark.costly
def test_the_same_file_is_tuned_to_the_same_gains(experiment: Experiment) -> None:
    (task,) = tasks(experiment, block())
    assert tuned(task).tuned == tuned(task).tuned


@pytest.mark.costly
def test_what_cannot_be_met_is_said(experiment: Experiment) -> None:
    (task,) = tasks(experiment, block(subject=[{"value": "settling(SHGO, x2)", "below": 1e-3}]))
    with pytest.raises(ValueError, match=r"no gains that were tried meet all limits: settling.* at best"):
        search(Trials(task))


@pytest.mark.costly
def test_why_there_is_no_run_with_any_gains_is_said(experiment: Experiment) -> None:
    """It is no divergence."""
    (task,) = tasks(experiment, block(gains={"observers.SHGO.internal.x": {"log": [0.5, 10]}}, budget=40))
    said = r"gains were tried, and with the first of them there is no run: .*SHGO.internal: unknown internal state 'x'"
    with pytest.raises(ValueError, match=said):
        search(Trials(task))


@pytest.mark.costly
def test_gains_that_lose_the_estimate_are_left(experiment: Experiment) -> None:
    """Above some gain the samples are too far apart."""
    (task,) = tasks(experiment, block(gains={THETA: {"log": [1, 500]}}, seeds=2, budget=100))
    found = tuned(task)
    assert found.tuned[THETA] < 60
    assert np.isinf(found.found.trials.values).any()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"minimise": "rmse(SHGOO, x2)"}, "no observer is called 'SHGOO'"),
        ({"minimise": "rmse(SHGO, x3)"}, "no state 'x3'"),
        ({"minimise": "rms(SHGO, x2)"}, "no quantity is called 'rms'"),
        ({"minimise": "holdout_rmse(SHGO, x1)"}, "holdout_rmse is a score of recorded data, of which hgorun estimate"),
        ({"minimise": "std(SHGO, x2)"}, "only metrics without a window can be tuned"),
        ({"minimise": "rmse(SHGO, x2, 1, 2)"}, "without a window"),
        ({"minimise": "rmse(FHGO, x2)"}, "nothing of observer SHGO is minimised"),
        ({"gains": {"SHGO.theta": {"log": [1, 2]}}}, "Did you mean `observers.SHGO.theta`"),
        ({"gains": {"theta": {"log": [1, 2]}}}, "observers.*.theta is that of all observers which have it."),
        ({"gains": {"observers.shgo.theta": {"log": [1, 2]}}}, "called 'shgo'. Did you mean `SHGO`"),
        ({"gains": {"observers.*.gamma": {"log": [1, 2]}}}, "no observer has the key"),
        ({"gains": {"observers.SHGO.gamma": {"log": [1, 2]}}}, "unknown key 'gamma'"),
        ({"gains": {THETA: {"linear": [-1, 2]}}}, r"for the value -1"),
        ({"budget": 20}, "too small for 5 seeds: 40 at least"),
        ({"budget": 20, "minimise": "rmse(SHGO, x3)"}, "no state 'x3'"),
        ({"budget": 20, "gains": {"observers.SHGO.thetta": {"log": [1, 2]}}}, "unknown key 'thetta'"),
    ],
)
def test_what_does_not_fit_is_refused(experiment: Experiment, change: dict[str, Any], message: str) -> None:
    with pytest.raises(Problem, match=message):
        tasks(experiment, block(**change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gains": {}}, "expected 1 to 6 gains, found 0"),
        ({"gains": {THETA: {}}}, "exactly one of log and linear"),
        ({"gains": {THETA: {"log": [0, 1]}}}, "a logarithmic range needs numbers > 0"),
        ({"gains": {THETA: {"linear": [2, 1]}}}, "expected \\[low, high\\] with low < high"),
        ({"minimise": 3}, "expected a quantity"),
        ({"minimise": [3]}, "expected quantities such as .*, found 3"),
        ({"minimise": ["a(F, x)", "b(F, x)", "c(F, x)"]}, "at most 2"),
        ({"subject": [{"value": "sup(F, x)"}]}, "exactly one of below and above"),
        ({"subject": ["sup(F, x)"]}, "expected a mapping"),
    ],
)
def test_blocks_that_say_nothing_sensible_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        block(**change)


def test_yaml_may_cut_quantities_at_their_commas() -> None:
    """As it does with ``[hf(F, x2), settling(F, x2)]`` and ``{value: peak(F, x2), below: 3}``."""
    cut = block(minimise=["hf(F", "x2)", "settling(F", "x2)"], subject=[{"value": "peak(F", "x2)": None, "below": 3}])
    assert cut.minimise == ("hf(F, x2)", "settling(F, x2)")
    assert cut.subject[0].value == "peak(F, x2)"
    assert block(minimise=["rmse(F", "x2", 0, "5)"]).minimise == ("rmse(F, x2, 0, 5)",)
    whole = {"gains": {THETA: {"log": [1, 2]}}, "minimise": "rmse(F", "x2)": None}
    assert Tune.model_validate(whole).minimise == ("rmse(F, x2)",)


TUNE = """\
tune:
  gains: {observers.SHGO.theta: {log: [0.5, 10]}}
  minimise: [hf(SHGO, x2), settling(SHGO, x2)]   # noise against speed
  subject: [{value: peak(SHGO, x2), below: 30}]
  seeds: 3
  held_out: 10
  budget: 120
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "c.yaml").write_text(CONFIG + TUNE)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.costly
def test_the_command_writes_gains_and_evidence(shell: Shell) -> None:
    code, out, err = shell("tune", "c.yaml", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["files"] == [f"results/c.{end}" for end in ("tuned.yaml", "tune.h5", "tune.png", "tune.pdf")]
    theta = found["observers"]["SHGO"]["gains"][THETA]
    text = (shell.folder / "results" / "c.tuned.yaml").read_text()
    assert text == (CONFIG + TUNE).replace("SHGO: {type: shgo, theta: 2", f"SHGO: {{type: shgo, theta: {theta:.6g}")
    own = load(shell.folder / "results" / "c.tuned.yaml")
    assert own.observers["SHGO"].theta == theta  # type: ignore[attr-defined]  # of this family
    with h5py.File(shell.folder / "results" / "c.tune.h5") as file:
        group = file["SHGO"]
        assert group["scan/values"].shape[1:] == (3, 3)
        chosen = int(group.attrs["chosen"])
        assert group["front/gains"][chosen, 0] == theta
        mean = found["observers"]["SHGO"]["front"][chosen]["held_out"]["hf('SHGO', x2)"]["mean"]
        assert group["front/held_out"][chosen, :, 0].mean() == pytest.approx(mean, rel=1e-14)


def test_one_goal_is_drawn_against_each_gain(shell: Shell) -> None:
    gains = "{observers.FHGO.theta: {log: [0.5, 10]}, observers.FHGO.poles: {linear: [-2, -0.5]}}"
    block_of_two = TUNE.replace("{observers.SHGO.theta: {log: [0.5, 10]}}", gains).replace("SHGO", "FHGO")
    wanted = block_of_two.replace("[hf(FHGO, x2), settling(FHGO, x2)]", "hf(FHGO, x2)")
    (shell.folder / "c.yaml").write_text(
        CONFIG + wanted.replace("peak(FHGO, x2), below: 30", "settling(FHGO, x2), below: 3")
    )
    code, out, _ = shell("tune", "c.yaml")
    assert code == 0
    assert "the least, on 10 held-out seeds" in out
    assert (shell.folder / "results" / "c.tune.png").stat().st_size > 10_000


def test_a_gain_at_an_end_of_its_range_is_said(shell: Shell) -> None:
    one = TUNE.replace("[hf(SHGO, x2), settling(SHGO, x2)]", "hf(SHGO, x2)").replace("log: [0.5, 10]", "log: [5, 10]")
    (shell.folder / "c.yaml").write_text(CONFIG + one)
    code, _, err = shell("tune", "c.yaml", "--no-plots", "-q")
    assert code == 0
    assert "hgorun: c: observers.SHGO.theta = 5" in err
    assert "is at the lower end of its range [5, 10]: better values may lie beyond it" in err


@pytest.mark.parametrize("gain", ["log: [1e-300, 1e300]", "linear: [-1e308, 1e308]"])
def test_a_range_that_overflows_is_refused(shell: Shell, gain: str) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG + TUNE.replace("log: [0.5, 10]", gain))
    code, _, err = shell("tune", "c.yaml")
    assert code == 2
    assert "the range is wider than numbers can tell" in err


def test_seeds_of_a_tuning_end_at_the_largest_one(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(f"seed: {2**63 - 2}\n{CONFIG}{TUNE}")
    code, _, err = shell("tune", "c.yaml")
    assert code == 2
    assert "end above the largest seed" in err


@pytest.mark.costly
def test_a_file_of_its_own(shell: Shell) -> None:
    folder = shell.folder / "own"
    folder.mkdir()
    (folder / "t.yaml").write_text(f"base: ../c.yaml\n{TUNE}")
    code, out, err = shell("tune", "own/t.yaml", "-o", "out", "--no-plots")
    assert (code, err) == (0, "")
    assert "the front, * the knee, on 10 held-out seeds" in out
    assert "# the gain is to be tuned" in (shell.folder / "out" / "t.tuned.yaml").read_text()


def test_keys_of_tune_can_be_changed_on_the_command_line_and_no_others(shell: Shell) -> None:
    code, out, _ = shell("tune", "c.yaml", "--json", "--no-plots", "--set", "tune.held_out=4")
    assert code == 0
    assert json.loads(out)["observers"]["SHGO"]["held_out"] == 4
    code, _, err = shell("tune", "c.yaml", "--set", "time.end=3")
    assert code == 2
    assert "the tuned file would lack other changes" in err


@pytest.mark.costly
def test_a_run_of_several(shell: Shell) -> None:
    runs = "runs:\n  slow: {}\n  fast: {measurement: {sampling: {period: 0.04}}}\n"
    (shell.folder / "c.yaml").write_text(CONFIG + TUNE + runs)
    code, _, err = shell("tune", "c.yaml")
    assert code == 2
    assert "name one with --run" in err
    assert shell("tune", "c.yaml", "--run", "fast", "-q", "--no-plots")[0] == 0
    tuned_file = shell.folder / "results" / "c.tuned.yaml"
    assert load(tuned_file, run="fast").observers["SHGO"].theta != 2  # type: ignore[attr-defined]  # of this family


def test_simulate_names_the_command_that_a_file_of_its_own_is_for(shell: Shell) -> None:
    (shell.folder / "t.yaml").write_text(f"base: c.yaml\n{TUNE}")
    assert shell("simulate", "t.yaml")[::2] == (
        2, "hgorun: t.yaml: this is a file that asks for the gains of another one; hgorun tune t.yaml finds them\n",
    )  # fmt: skip


def test_without_the_key_nothing_is_tuned(shell: Shell) -> None:
    (shell.folder / "plain.yaml").write_text(CONFIG)
    code, _, err = shell("tune", "plain.yaml")
    assert code == 2
    assert "plain.yaml: the key tune is missing" in err


@pytest.mark.parametrize(
    ("observers", "gains"),
    [
        ({"E": {"Q": {"a": 0, "b": 0.05, "c": 1, "d": 2}}}, "observers.E.Q.b: {log: [0.0005, 5]}, observers.E.Q.c: "),
        ({"E": {"q": 2}}, "observers.E.q: {log: [0.02, 200]}"),
        ({"E": {"Q": [[1, 0], [0, 1]]}}, "observers.E.Q.0.0: {log: [1e-6, 1]}"),
        ({"E": {"q": 2}, "S": {"theta": 3}}, "observers.S.theta: {log: [0.5, 20]}"),
        ({"S": {"theta": 3}, "T": None}, "observers.*.theta: {log: [0.5, 20]}"),
        ([], "observers.*.theta: {log: [0.5, 20]}"),
    ],
)
def test_gains_of_an_example_are_those_that_observers_have(observers: object, gains: str) -> None:
    """Of a filter with Q or q theta would be refused."""
    assert gains_of({"observers": observers}).startswith(gains)


@pytest.mark.parametrize(("outputs", "named"), [("{S: glucose}", "S"), ("{1: a, E: b}", "E"), ("[S]", "y")])
def test_without_the_key_an_output_that_is_recorded_is_the_example(shell: Shell, outputs: str, named: str) -> None:
    (shell.folder / "log.yaml").write_text(f"data: {{outputs: {outputs}}}\n")
    code, _, err = shell("tune", "log.yaml")
    assert (code, f"minimise: 'holdout_rmse(*, {named})'" in err) == (2, True)


def test_a_wrong_block_is_refused_by_all_commands(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG + TUNE.replace("budget: 120", "budget: many"))
    for command in ("simulate", "tune"):
        code, _, err = shell(command, "c.yaml")
        assert code == 2
        assert "c.yaml:21: tune.budget" in err


@pytest.mark.costly
def test_the_block_changes_no_result(shell: Shell) -> None:
    (shell.folder / "plain.yaml").write_text(CONFIG)
    digests = []
    for name in ("c", "plain"):
        shell("simulate", f"{name}.yaml", "-q")
        with h5py.File(shell.folder / "results" / f"{name}.h5") as file:
            digests.append(file.attrs["config_resolved"])
    assert digests[0] == digests[1]


def test_only_a_missed_limit_is_told(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG + TUNE.replace("below: 30", "below: 0.1"))
    code, _, err = shell("tune", "c.yaml")
    assert code == 1
    assert "no gains that were tried meet all limits: peak('SHGO', x2) below 0.1, at best" in err


def test_an_observer_that_all_gains_lose_leaves_the_others_theirs(shell: Shell) -> None:
    asked = TUNE.replace("}}\n", "}, observers.FHGO.theta: {log: [1e5, 1e6]}}\n", 1)
    asked = asked.replace("hf(SHGO, x2), settling(SHGO, x2)", "rmse(*, x2)").replace(
        "  subject: [{value: peak(SHGO, x2), below: 30}]\n", ""
    )
    (shell.folder / "c.yaml").write_text(CONFIG + asked)
    code, out, err = shell("tune", "c.yaml", "--no-plots")
    assert code == 1
    assert "SHGO" in out
    assert re.search(
        r"c: FHGO: \d+ gains were tried, and the observer diverges with all of them; it keeps its gains\n", err
    )
    tuned = load(shell.folder / "results" / "c.tuned.yaml").observers
    assert (tuned["SHGO"].theta == 2, tuned["FHGO"].theta) == (False, 2)  # type: ignore[attr-defined]  # of this family


def test_a_base_that_is_missing(shell: Shell) -> None:
    (shell.folder / "t.yaml").write_text(f"base: missing.yaml\n{TUNE}")
    code, _, err = shell("tune", "t.yaml")
    assert code == 2
    assert "t.yaml:1: base: missing.yaml: there is no such file" in err
    with pytest.raises(ConfigError):
        load(shell.folder / "missing.yaml")


@pytest.mark.parametrize(("count", "chosen"), [(3, 1), (12, 5), (13, 6), (40, 1), (40, 38), (40, 17), (40, 39)])
def test_at_most_twelve_points_are_tried_again_and_the_chosen_one_is_among_them(count: int, chosen: int) -> None:
    places = _shown(count, chosen)
    assert len(places) == min(count, 12)
    assert {0, count - 1, chosen} <= set(places.tolist())
    assert np.all(np.diff(places) > 0)


def drawn(front: np.ndarray, half: float, *, goals: np.ndarray, logarithmic: bool = True) -> Tuned:
    """A tuning of one gain, whose candidates are of its front."""
    gains = np.geomspace(1, 4, len(goals))[:, None]
    return Tuned(
        label="F", type="fhgo2", filter_order=1, paths=("observers.F.theta",), logarithmic=(logarithmic,),
        gains=gains, goals=goals, met=np.ones(len(goals), dtype=bool), front_gains=gains[: len(front)],
        front=front, half=np.full_like(front, half), chosen=1 if len(front) > 1 else 0,
    )  # fmt: skip


def test_lines_join_what_nothing_beats_on_held_out_seeds() -> None:
    front = np.array([[1.0, 4.0], [2.0, 2.0], [3.0, 1.0], [4.0, 3.0]])  # the last one is beaten
    figure = tuning([drawn(front, 0.1, goals=front)], ["a", "b"])
    joined = [line for line in figure.axes[0].lines if line.get_linestyle() != "None" and np.size(line.get_xdata()) > 1]
    assert [np.asarray(line.get_xdata()).tolist() for line in joined] == [[1.0, 2.0, 3.0]]
    hollow = [
        line for line in figure.axes[0].lines if line.get_markerfacecolor() == "none" and np.size(line.get_xdata())
    ]
    assert [np.asarray(line.get_ydata()).tolist() for line in hollow if line.get_marker() != "None"][-1] == [3.0]
    assert "hollow: beaten" in figure.legends[0].get_title().get_text()


@pytest.mark.costly
@pytest.mark.parametrize("logarithmic", [True, False])
def test_a_gain_has_the_scale_of_its_range_and_the_minimum_its_whole_interval(logarithmic: bool) -> None:
    goals = np.array([[2.0], [1.5], [1.0], [1.4]])
    (ax,) = tuning([drawn(np.array([[1.0]]), 0.4, goals=goals, logarithmic=logarithmic)], ["a"]).axes
    assert ax.get_xscale() == ("log" if logarithmic else "linear")
    assert ax.get_ylim()[0] < 0.6


def test_a_base_that_cannot_be_run_is_refused_before_anything_is_tried(shell: Shell) -> None:
    """Unless a gain changes what is wrong."""
    wrong = CONFIG.replace("x1: x2, x2: -x1", "x1: 0, x2: -x1")  # x2 is not seen
    text = wrong + f"tune: {{gains: {{{THETA}: {{linear: [1, 9]}}}}, minimise: 'rmse(SHGO, x2)', budget: 160}}\n"
    (shell.folder / "c.yaml").write_text(text)
    code, out, err = shell("tune", "c.yaml", "-q")
    assert (code, out) == (2, "")
    assert "c.yaml:3: plant: " in err


@pytest.mark.parametrize(
    ("gains", "seeds", "budget", "expected"),
    [(1, 20, None, 2000), (2, 20, None, 2000), (3, 20, None, 4000), (4, 20, None, 8000), (6, 20, None, 32000),
     (1, 1000, None, 8000), (4, 20, 500, 500)],
)  # fmt: skip
def test_the_budget_follows_the_number_of_gains(gains: int, seeds: int, budget: int | None, expected: int) -> None:
    block = {"gains": {"observers.H.theta": {"log": [1, 2]}}, "minimise": "rmse(H, x1)", "seeds": seeds}
    assert Tune.model_validate(block if budget is None else block | {"budget": budget}).runs(gains) == expected


@pytest.mark.parametrize(
    ("gains", "budget", "expected"), [(1, None, 200), (2, None, 2000), (3, None, 4000), (1, 2000, 2000)]
)
def test_one_gain_on_recorded_data_needs_few_runs(gains: int, budget: int | None, expected: int) -> None:
    block = {"gains": {"observers.H.theta": {"log": [1, 2]}}, "minimise": "holdout_rmse(H, y)"}
    tune = Tune.model_validate(block if budget is None else block | {"budget": budget})
    assert tune.runs(gains, recorded=True) == expected
