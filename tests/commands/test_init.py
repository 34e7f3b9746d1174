"""``hgorun init`` gives something that runs as it is."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import pytest
import yaml
from chosen_cases import ALL_CASES
from shell import Shell

from hgorun.commands import init, trial
from hgorun.commands.first import first_of, with_observers
from hgorun.commands.trial import FOLLOWS, followed
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.plants.contois import Contois
from hgorun.simulation.simulate import prepare, simulate_prepared
from hgorun.study.loading import load


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_a_plant_gives_a_commented_configuration_that_runs(shell: Shell) -> None:
    code, out, _ = shell("init", "--plant", "contois", "-o", "my.yaml")
    assert code == 0
    assert "written: my.yaml\n" in out
    assert "try: hgorun simulate my.yaml && hgorun compare my.yaml\n" in out
    text = (shell.folder / "my.yaml").read_text()
    assert "mu: 1.064  # maximal growth rate, 1/h" in text
    assert text.count("#") > 15
    address = text.splitlines()[0].removeprefix("# yaml-language-server: $schema=")
    installed = Path(url2pathname(urlsplit(address).path))
    assert (address.startswith("file://"), installed.name) == (True, "hgorun.schema.json")
    assert "plant-contois" in json.loads(installed.read_text())["$defs"]
    assert not (shell.folder / "hgorun.schema.json").exists()
    code, out, _ = shell("simulate", "my.yaml", "--strict")
    assert (code, "FHGO" in out) == (0, True)
    assert shell("init", "--plant", "contois", "-o", "my.yaml")[0] == 0  # it is the same
    (shell.folder / "my.yaml").write_text(text + "# mine\n")
    before = [path.name for path in shell.folder.glob("*")]
    code, _, err = shell("init", "--plant", "contois", "-o", "my.yaml")
    assert (code, "my.yaml exists and differs; --force overwrites it" in err) == (2, True)
    assert shell("init", "--plant", "contois", "-o", "my.yaml", "--schema")[0] == 2
    assert [path.name for path in shell.folder.glob("*")] == before  # no schema either
    assert shell("init", "--plant", "contois", "-o", "my.yaml", "--force")[0] == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", PLANTS.names())
def test_every_plant_has_one_whose_observers_follow_it(name: str, tmp_path: Path) -> None:
    path = tmp_path / "first.yaml"
    path.write_text(first_of(name, PLANTS.find(name)).text("first.yaml"))
    result = simulate_prepared(prepare(load(path)))
    assert result.status == "ok"
    for label, metrics in result.metrics().items():
        for k, state in enumerate(result.states):
            swing = result.x[:, k].max() - result.x[:, k].min()
            assert metrics["rmse"][state] < 0.2 * swing, (label, state)


def test_observers_may_be_named(shell: Shell) -> None:
    assert shell("init", "--plant", "van_der_pol", "--observer", "ekf", "--observer", "levant", "-o", "v.yaml")[0] == 0
    found = yaml.safe_load((shell.folder / "v.yaml").read_text())
    assert {label: keys["type"] for label, keys in found["observers"].items()} == {"EKF": "ekf", "LEVANT": "levant"}


def follows(plant: str, observer: str, folder: Path) -> bool:
    """Whether what ``init`` writes for the two runs, by the file alone; True where it refuses."""
    found = followed(first_of(plant, PLANTS.find(plant), [observer]))
    if found.trouble or found.error >= FOLLOWS:
        return True
    path = folder / f"{plant}-{observer}.yaml"
    path.write_text(found.first.text(path.name))
    result = simulate_prepared(prepare(load(path)))
    (one,) = result.observers.values()
    (rmse,) = (metrics["rmse"] for metrics in result.metrics().values())
    near = all(rmse[state] < 0.5 * np.ptp(result.x[:, k]) for k, state in enumerate(result.states))
    return one.type == observer and result.status == "ok" and near


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("plant", "observer"),
    [
        ("contois", "aekf"),  # that steps over its narrow gain between samples, where it is not corrected at these
        ("contois", "super_twisting"),  # that takes the noise for the signal
        ("van_der_pol", "cascade"),  # with the gain of its example it lags behind
        ("van_der_pol", "kkl"),  # that needs a box of the states
        ("phytoplankton", "ukf"),  # whose points lie where the plant has no meaning
    ],
)
def test_an_observer_gets_what_it_needs_to_follow(plant: str, observer: str, tmp_path: Path) -> None:
    assert follows(plant, observer, tmp_path)
    assert list(tmp_path.iterdir())  # none of these is refused


@pytest.mark.measured_once
@pytest.mark.slow
@pytest.mark.parametrize("plant", PLANTS.names())
def test_observers_run_or_are_refused(plant: str, tmp_path: Path) -> None:
    """Each observer with one plant; HGORUN_CASES=all tries it with every one."""
    apart = 1 if ALL_CASES else len(PLANTS.names())
    names = list(OBSERVERS.names())[list(PLANTS.names()).index(plant) % apart :: apart]
    assert [name for name in names if not follows(plant, name, tmp_path)] == []
    assert len(list(tmp_path.iterdir())) > 1  # not all of these are refused


@pytest.mark.slow
def test_an_observer_that_loses_its_numbers_is_refused_and_nothing_is_written(shell: Shell) -> None:
    code, out, err = shell("init", "--plant", "contois", "--observer", "tracking", "-o", "s.yaml")
    assert (code, out, list(shell.folder.iterdir())) == (2, "", [])
    assert "division by zero at t = " in err
    assert "this plant is mostly run with fhgo2, shgo" in err
    code, _, err = shell("init", "--plant", "contois", "--observer", "hgo_fd")
    assert (code, "observers for this plant are" in err) == (2, True)


@pytest.mark.costly
def test_an_estimate_that_does_not_follow_is_refused(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "FOLLOWS", 1e-9)
    monkeypatch.setattr(init, "FOLLOWS", 1e-9)
    code, _, err = shell("init", "--plant", "integrator_chain", "--observer", "deadbeat")
    assert (code, "in the best, an estimate misses its state by" in err) == (2, True)
    assert not list(shell.folder.iterdir())


def test_an_observer_of_reactions_is_told_them_or_refused(shell: Shell) -> None:
    """The culture grows at the cost of its substrate, gram by gram, and both are washed out at the rate D."""
    assert shell("init", "--plant", "contois", "--observer", "kinetic_rate", "-o", "k.yaml")[0] == 0
    found = yaml.safe_load((shell.folder / "k.yaml").read_text())["observers"]["KINETIC_RATE"]
    told = {"yields": {"x1": [1], "x2": [-1]}, "dilution": "D", "feed": {"x2": "D*s_in"}}
    assert {key: found[key] for key in told} == told
    code, _, err = shell("init", "--plant", "van_der_pol", "--observer", "kinetic_rate", "-o", "v.yaml")
    assert (code, "leaves x2 out, since the equations do not say all it needs" in err) == (2, True)


def test_a_gain_is_sought_until_the_estimate_follows_well() -> None:
    """|y''| is up to about 3 on this chain, and the bound of the example is 1."""
    found = followed(first_of("integrator_chain", PLANTS.find("integrator_chain"), ["red"]))
    assert found.error < 0.1
    assert found.first.start.observers["RED"]["L"] == 10


def test_a_plant_that_names_no_start_gets_numbers_near_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Contois, "first", None)
    (tmp_path / "g.yaml").write_text(first_of("contois", Contois).text("g.yaml"))
    prepare(load(tmp_path / "g.yaml"))


APART = ("own", "", "", "", "", "-x1", "-x2")  # two states, neither of which says anything of the other


def answers(monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))


def test_a_plant_of_your_own_from_answers(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    equations = ("x2", "-a*x1 + w", "", "-a*x1 + u")  # the second of these has an unknown name, and is asked again
    end_and_sampling = ("-5", "5.00000012", "0", "0.01")
    named = ("own", "parsec", "h", "t, x1", "x1, x1", "x1, x2", "b", "a = 1.23456789, c = 3", "u")
    answers(
        monkeypatch, *named, *equations, "", "a*cos(t)", "", "", "", "one", "0", *end_and_sampling, "shgo, ekff", "shgo"
    )
    code, out, err = shell("init", "--ask", "-o", "own.yaml")
    assert code == 0, err
    assert "written: own.yaml" in out
    for words in (
        "'parsec' is not a unit of time",
        "t is the time: take another name",
        "nothing uses the parameter c: it is left out",
        "different names",
        "expected name = number",
        "> 0, found -5",
        "Did you mean `ekf`",
    ):
        assert words in err
    found = yaml.safe_load((shell.folder / "own.yaml").read_text())
    assert found["time"] == {"end": 5.00000012, "output_step": 0.005, "unit": "h"}
    assert found["plant"]["dynamics"] == {"x1": "x2", "x2": "-a*x1 + u"}
    assert found["plant"]["inputs"] == {"u": "a*cos(t)"}
    assert found["plant"]["parameters"] == {"a": 1.23456789}
    assert "sampling" not in found["measurement"]


def test_names_that_only_equations_have_are_asked_for(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    equations = ("speed", "-k*pos - c*spee + F", "", "-k*pos - c*speed + F", "1/2", "0.5*sin(t)", "")
    answers(monkeypatch, "own", "-", "pos, speed", "k = 4", "", *equations, *[""] * 8)
    code, out, err = shell("init", "--ask", "-o", "own.yaml")
    assert code == 0, err
    asked = "F is not known.\n  Its number, or as an input an expression of t (Enter: write it again)"
    assert asked in out
    found = yaml.safe_load((shell.folder / "own.yaml").read_text())
    assert found["time"]["unit"] == "-"
    assert found["plant"]["parameters"] == {"k": 4, "F": 0.5}
    assert found["plant"]["inputs"] == {"c": "0.5*sin(t)"}


TANK = ("own", "", "h", "", "", "(20 - 8*sqrt(h))/50", "h", "4")  # which has no derivative where it is empty


@pytest.mark.parametrize(
    ("guess", "noise", "observer", "written", "told"),
    [
        ("2", "0.05", "shgo", (2, 0.05), ()),
        ("0", "0.05", "ekf", (3.6, 0.05), ("EKF from the first guess h = 0: ", "; h = 3.6 is written in its place")),
        ("2", "1", "shgo", (2, 1), ("an estimate misses its state by ", "try other gains, less noise or a")),
        ("2", "40", "shgo", (2, 4), ("with noise of standard deviation 40: observer SHGO", "; 4 is written in its p")),
    ],
)
def test_answers_stay_or_what_is_written_in_their_place_is_told(
    shell: Shell,
    monkeypatch: pytest.MonkeyPatch,
    guess: str,
    noise: str,
    observer: str,
    written: tuple[float, float],
    told: tuple[str, ...],
) -> None:
    answers(monkeypatch, *TANK, guess, "20", "0.5", noise, observer)
    code, out, err = shell("init", "--ask", "-o", "tank.yaml")
    assert (code, err) == (0, "")
    notes = [line for line in out.splitlines() if line.startswith("note: ")]
    assert [line for line in notes if told and all(words in line for words in told)] == notes[: len(told) > 0]
    found = yaml.safe_load((shell.folder / "tank.yaml").read_text())
    (block,) = found["observers"].values()
    assert (block["initial"]["h"], found["measurement"]["noise"][0]["std"]) == written


def test_samples_that_an_observer_does_not_take_are_told() -> None:
    first = first_of("integrator_chain", PLANTS.find("integrator_chain"), ["kkl"])
    found = followed(first, answered=True)
    assert (found.first.sampled, found.trouble) == (False, "")
    (told,) = found.changes
    assert told.startswith("with samples: ")
    assert told.endswith("; what is written has an output that is known at all times")
    assert not followed(first).changes


@pytest.mark.parametrize(
    ("observer", "noise", "keys"),
    [
        ("ekf", 0.1, {"Q": {"x1": 0.04, "x2": 1.0}}),
        ("ekf", 0.0, {"Q": {"x1": 0.04, "x2": 1.0}, "R": 0.1}),
        ("kalman_bucy", 0.1, {"Q": {"x1": 0.04, "x2": 1.0}, "R": 0.1}),
        ("shgo", 0.1, {"theta": 2.0}),
    ],
)
def test_a_filter_gets_the_noise_of_the_measurement_and_of_the_size_of_states(
    observer: str, noise: float, keys: dict[str, object]
) -> None:
    """Of a density Q the deviation after the time T is sqrt(Q T): 0.2 and 1 after a tenth of the run.

    These are a tenth of x1, and of the distance of x2 from its first guess.
    """
    first = PLANTS.find("van_der_pol").first
    assert first is not None
    start = replace(
        first,
        end=10,
        initial={"x1": 2, "x2": 0},
        estimate={"x1": 1, "x2": 10},
        noise=noise,
        observers={},
    )
    ((_, found),) = with_observers(start, [observer]).observers.items()
    assert {key: value for key, value in found.items() if key != "type"} == keys


def test_a_built_in_plant_from_answers(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    answers(monkeypatch, "contoi", "contois", "0.2 1/h", "0.2*mu", "", "0.5", "", "")
    code, out, err = shell("init", "--ask")
    assert (code, "Did you mean `contois`?" in err, "a number has no unit here" in err) == (0, True, True)
    assert "input D (dilution rate, 1/h), a number or an expression of t" in out
    found = yaml.safe_load((shell.folder / "contois.yaml").read_text())
    assert found["plant"]["inputs"] == {"D": "0.2*mu"}
    assert found["measurement"]["sampling"] == {"period": 0.5}
    answers(monkeypatch, "contois")
    code, _, err = shell("init", "--ask", "-o", "other.yaml")
    assert (code, "the answers ended; nothing is written" in err) == (1, True)
    assert not (shell.folder / "other.yaml").exists()


def test_the_schema_beside_a_file_is_kept(shell: Shell) -> None:
    """It is written once for a folder, where it is asked for, and then used by all that comes there."""
    for arguments, schemas in {("--schema",): 1, (): 0}.items():
        code, out, _ = shell("init", "--plant", "van_der_pol", "-o", f"with{len(arguments)}.yaml", *arguments)
        assert (code, out.count("(for editors)")) == (0, schemas)
        text = (shell.folder / f"with{len(arguments)}.yaml").read_text()
        assert text.startswith("# yaml-language-server: $schema=hgorun.schema.json\n")
    assert json.loads((shell.folder / "hgorun.schema.json").read_text())["$defs"]


@pytest.mark.slow
def test_the_example_with_a_recording_comes_with_its_data(shell: Shell) -> None:
    code, out, _ = shell("init", "fermentation")
    assert (code, "try: hgorun estimate fermentation/fermentation.yaml\n" in out) == (0, True)
    names = {
        "fermentation.yaml",
        "with_laboratory.yaml",
        "online.csv",
        "laboratory.csv",
        "README.md",
    }
    assert {path.name for path in (shell.folder / "fermentation").iterdir()} >= names
    code, out, _ = shell("estimate", "fermentation/fermentation.yaml", "--no-sensitivity", "--no-plots")
    assert (code, "reference_rmse E" in out) == (0, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("contoi",), "no experiment is called 'contoi'. Did you mean"),
        (("contois",), "To start with the plant: hgorun init --plant contois"),
        (("--plant", "contos"), "--plant: no plant is called 'contos'. Did you mean `contois`?"),
        (("--plant", "contois", "--observer", "shgoo"), "no observer is called 'shgoo'. Did you mean `shgo`?"),
        (("--plant", "contois", "-o", "my.csv"), "ends in .yaml, such as my.yaml, found my.csv"),
        (("contois_te025", "--plant", "contois"), "copied as it is"),
        (("--ask", "--observer", "shgo"), "--observer goes with --plant"),
        (("--ask", "--plant", "contois"), "--ask asks for the plant, too: leave --plant contois out"),
        (("contois_te025", "-o", "my.yaml"), "keeps its name and takes a folder: hgorun init contois_te025 FOLDER"),
    ],
)
def test_what_does_not_go_together_is_refused(shell: Shell, arguments: tuple[str, ...], words: str) -> None:
    code, _, err = shell("init", *arguments)
    assert (code, words in err) == (2, True), err


def test_a_plant_of_your_own_that_does_not_run_is_written_and_told(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers(monkeypatch, *APART, "x1", *[""] * 8, "shgo", "")
    code, _, err = shell("init", "--ask", "-o", "a.yaml")
    assert (code, "a.yaml is written, but does not run yet: a.yaml:" in err) == (1, True), err


def test_what_cannot_be_seen_is_told_at_the_output_and_at_the_observers(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers(monkeypatch, *APART, "x1", "", *[""] * 7, "shgo", "ekf")
    code, _, err = shell("init", "--ask", "-o", "a.yaml")
    assert code == 0, err
    at_the_output, at_the_observers = err.splitlines()
    assert at_the_output == "  nothing that is measured depends on x2, now or later: few observers take that"
    assert at_the_observers.startswith(
        "  nothing that is measured (x1) depends on the state x2, now or later: no observer"
    )
    assert [*yaml.safe_load((shell.folder / "a.yaml").read_text())["observers"]] == ["EKF"]


@pytest.mark.parametrize(
    ("given", "told", "written"),
    [
        (("x1, x2",), (), ["x1", "x2"]),
        (("[min(x1, 2), 'x1 + x2']",), (), ["min(x1, 2)", "x1 + x2"]),
        (
            ("x2, x2", "3, x1", "sinn(x1), x2", "x1, x3", "", "x1,", "x2, x1"),
            (
                "outputs must differ, found x2, x2",
                "3 is a number; an output is",
                "mean `sin`?",
                "expected an expression",
            ),
            ["x2", "x1"],
        ),
        (("x1", "x1 + x2"), ("depends on x2, now or later",), "x1 + x2"),
        *(
            ((text, "x1, x2"), ("outputs are separated by commas: x1, x2",), ["x1", "x2"])
            for text in ("x1 and x2", "x1 x2", "x1; x2", "x1 & x2", "['x1' 'x2']")
        ),
        (
            ("x2, sin(x1) and x2 - x1", "x1 x2 > 3", "x2, x1 > 0", "not x1", "x1 > 0 and x2 > 0", "x1, x2"),
            (
                "outputs are separated by commas: x2, sin(x1), x2 - x1",
                "an operator is missing between `x1` and `x2`",
                "x1 > 0 is true or false; an output is a state",
                "not x1 is true or false",
                "x1 > 0 and x2 > 0 is true or false",
            ),
            ["x1", "x2"],
        ),
    ],
)
def test_several_outputs_are_asked_for_until_they_can_be_read(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, given: tuple[str, ...], told: tuple[str, ...], written: object
) -> None:
    monkeypatch.setattr(init, "followed", lambda first, **_: trial.Found(0, first))
    answers(monkeypatch, *APART, *given, *[""] * 7, "ekf")
    code, _, err = shell("init", "--ask", "-o", "a.yaml")
    assert (code, err.count("\n")) == (0, len(told)), err
    assert all(words in line for words, line in zip(told, err.splitlines(), strict=True)), err
    assert yaml.safe_load((shell.folder / "a.yaml").read_text())["plant"]["output"] == written


def test_no_answer_is_lost_for_a_file_that_cannot_be_written(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    (shell.folder / "contois.yaml").write_text("")
    code, out, err = shell("init", "--ask", "-o", "contois.yaml")
    assert (code, out) == (2, "")
    assert err == "hgorun: contois.yaml exists; --force overwrites it, -o FILE names another one\n"
    assert shell("init", "--ask", "-o", "a.txt")[1] == ""
    monkeypatch.setattr(init, "followed", lambda first, **_: trial.Found(0, first))
    answers(monkeypatch, "contois", *[""] * 5, "a.txt", "contois.yaml", "contois.yaml/a.yaml", "")
    code, out, err = shell("init", "--ask")
    assert (code, "written: my_contois.yaml" in out, err.count("\n")) == (0, True, 3), err
    assert "expected the name of a new file, found contois.yaml: it exists already" in err
    assert not (shell.folder / "contois.yaml").read_text()


def test_ctrl_c_at_a_question_leaves_nothing(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_: str) -> str:
        raise KeyboardInterrupt

    monkeypatch.setattr("builtins.input", interrupted)
    assert shell("init", "--ask", "--schema")[0] == 130
    assert not [*shell.folder.iterdir()]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--plant shgo", "no plant is called 'shgo'. It is an observer: hgorun init --plant NAME --observer shgo"),
        ("--plant contois_te025", "no plant is called 'contois_te025'. It is an experiment: hgorun init contois_te025"),
        ("--plant fermentation", "no plant is called 'fermentation'. It is an experiment: hgorun init fermentation"),
        (
            "--plant contois --observer van_der_pol",
            "--observer: no observer is called 'van_der_pol'. It is a plant: --plant",
        ),
        ("shgo", "no experiment is called 'shgo'. It is an observer: hgorun init --plant NAME --observer shgo"),
        ("lee2016", "It is a folder of experiments, of which init copies one: lee2016/stochastic_approximation"),
        (
            "3.10",
            "It is a figure, which hgorun figures 3.10 draws: hgorun init contois_te025 copies the experiment "
            "robles2023/chapter3/contois_te025",
        ),
        ("katayama/1", "draws: hgorun init van_der_pol copies the experiment katayama/van_der_pol"),
        ("1", "copies the experiment katayama/van_der_pol; hgorun init stochastic_approximation copies the"),
        ("--observer shgo", "--observer goes with --plant: hgorun init --plant NAME --observer shgo"),
        (
            "-o new.yaml",
            "--output goes with --plant: hgorun init --plant NAME -o new.yaml; a copy of an experiment keeps",
        ),
        ("--plant contois -o x.txt", "expected a file whose name ends in .yaml, such as x.yaml, found x.txt"),
        (
            "--plant contois -o there",
            "expected a file whose name ends in .yaml, such as there/contois.yaml, found there",
        ),
        ("contois_te025 new.yaml", "expected a folder behind contois_te025, found new.yaml: a copy keeps its name"),
        ("contois_te025 file", "expected a folder behind contois_te025, found file: a copy keeps its name"),
        (
            "--plant contois -o old.yaml",
            "old.yaml exists and differs; --force overwrites it, -o FILE names another one",
        ),
        ("--plant contois -o dir.yaml", "dir.yaml is a folder, and a file is to be written there"),
    ],
)
def test_a_mistake_is_told_with_what_would_be_right(shell: Shell, words: str, said: str) -> None:
    for name in ("there", "dir.yaml"):
        (shell.folder / name).mkdir()
    for name in ("file", "old.yaml"):
        (shell.folder / name).write_text("")
    before = sorted(shell.folder.iterdir())
    code, out, err = shell("init", *words.split())
    assert (code, out, said in err) == (2, "", True), err
    assert sorted(shell.folder.iterdir()) == before


@pytest.mark.parametrize("name", ["there.csv", "my log.csv", "table", "there.nc"])
def test_a_log_leads_to_what_takes_one(shell: Shell, name: str) -> None:
    for there in ("my log.csv", "table"):
        (shell.folder / there).write_text("t,y\n0,1\n1,2\n")
    quoted = f"'{name}'" if " " in name else name
    said = (
        f"hgorun: {name} names a log, and init copies experiments: `hgorun init fermentation` copies a configuration "
        f"with the key data and its log; `hgorun estimate CONFIG {quoted}` runs the observers of such a one on it\n"
    )
    assert shell("init", name) == (2, "", said)
