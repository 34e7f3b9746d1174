"""Mistakes of people who see hgorun for the first time, and the words by which each finds what is right."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from shell import Shell

CONFIG = """\
time: {end: 1, output_step: 0.1}
plant:
  states: [x1, x2]
  dynamics:
    x1: x2
    x2: -k*x1 + u
  output: x1
  parameters: {k: 4.5}
  inputs: {u: 0.5}
  initial: {x1: 1, x2: 0}
measurement:
  sampling: {period: 0.1}
  noise: [{type: gaussian, std: 0.1}]
observers:
  SHGO: {type: shgo, theta: 2}
solver: {method: rk4, step: 0.01}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.measured
@pytest.mark.slow
@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ("period: 0.1", "period: 0.1 h", "a number has no unit here, so `h` is too much"),
        ("k: 4.5", "k: 4.5 1/h", "a number has no unit here"),
        ("states: [x1, x2]", "states: x1 x2", "found 'x1 x2'; a list has brackets: [x1, x2]"),
        ("states: [x1, x2]", "states: {x1: 1, x2: 0}", "found a mapping; a list has brackets: [x1, x2]"),
        ("noise: [{type: gaussian, std: 0.1}]", "noise: {type: gaussian, std: 0.1}", "a list of one is [{...}]"),
        ("x2: -k*x1 + u", "x2: -k*sin x1 + u", "a function has parentheses, as in `sin(x1)`"),
        ("x2: -k*x1 + u", "x2: x1 > 0 ? 1", "write a choice as where(condition, a, b)"),
        ("type: gaussian, std: 0.1", "type: uniform, min: 0, high: 0.1", "unknown key 'min'. Did you mean `low`?"),
        ("std: 0.1", "variance: 0.01", "Did you mean `std`, its square root?"),
        ("sampling: {period: 0.1}", "sampling: {rate: 10}", "Did you mean `period`, its inverse?"),
        ("theta: 2", "epsilon: 0.1", "Did you mean `theta`, its inverse?"),
        ("sampling: {period: 0.1}", "sampling: 0.1", "found 0.1: write {period: 0.1}"),
        ("sampling: {period: 0.1}", "period: 0.1", "unknown key 'period'. It is a key of `sampling`."),
        ("SHGO: {type: shgo, theta: 2}", "SHGO: shgo", "such as SHGO: {type: shgo}"),
        ("solver:", "figures: {f: {state: x1}}\nsolver:", "unknown key 'state'. It is a key of `panels`."),
        ("k: 4.5", "k: 4 500", "digits are not grouped"),
        ("k: 4.5", "k: 4'500", "digits are not grouped"),
        ("std: 0.1", "std: 5%", "a percentage is a fraction, 0.05"),
        ("k: 4.5", "k: 4,5", "a decimal number is written with a point"),
        ("SHGO: {type: shgo, theta: 2}", "SHGO: {type: shgo, theta: 2,5e1}", "key '5e1'. A decimal number is written"),
        ("initial: {x1: 1, x2: 0}", "initial: {x1:1, x2:0}", "a space belongs behind the colon, as in x1: 1"),
        ("output: x1", "output:x1", "c.yaml:7: a space belongs behind the colon, as in output: x1"),
        ("plant:", "// my plant\nplant:", "a comment begins with #"),
        ("    x1: x2", "    x1': x2", "the right-hand side of x1' stands under x1"),
        ("    x1: x2", "    dx1: x2", "dx1 is no state: the key is the name of the state itself"),
        ("inputs: {u: 0.5}", "inputs: 0.5", "write lines `name: value`"),
        ("observers:", "observers:\n  Z: ~", "or leave the key out: null removes only what is inherited by `extends`"),
        ("noise: [{type: gaussian, std: 0.1}]", "noise: gaussian", "a list of one is [{type: gaussian, std: 0.1}]"),
        ("noise: [{type: gaussian, std: 0.1}]", "noise: uniform", "a list of one is [{type: uniform, ...}]"),
        ("noise: [{type: gaussian, std: 0.1}]", "noise: 0.1", "; a list of one is [{type: gaussian, std: 0.1}]"),
        ("theta: 2", "theta: 2, r: 1", "unknown key 'r': it is a key of fhgo2"),
        ("{type: shgo, theta: 2}", "{type: deadbeat, theta: 2}", " more, see `hgorun list observers`. Known here: "),
        ("std: 0.1", "std: 0.02 rad", "a number has no unit here, so `rad` is too much"),
        ("std: 0.1", "std: 2 pixels", "write a product as `2*pixels`; a number has no unit here"),
        ("u: 0.5", "u: 45°", "write `*pi/180`"),
        ("u: 0.5", "u: 45 deg", "write 45*pi/180"),
        ("u: 0.5", "u: np.sin(t)", "write `sin` for `np.sin`"),
        ("u: 0.5", "u: sin(1.3*time)", "Did you mean `t`?"),
        ("u: 0.5", "u: 1 - |sin(t)|", "an absolute value is abs(x)"),
        (
            "initial: {x1: 1, x2: 0}",
            "initial: {x1 = 1, x2 = 0}",
            "a colon separates a name from its value, as in x1: 1",
        ),
        ("period: 0.1", "perod: 0.1", "found perod. Did you mean `period`?"),
        ("type: shgo", "type: high_gain", "Did you mean `shgo`?"),
        ("theta: 2", "theta: one", "observers.SHGO.theta: `one` is not a number. A number"),
        ("method: rk4", "method: ode45", "Did you mean `dopri5`?"),
        ("solver:", "runs: {a: {sees: 3}}\nsolver:", "runs.a.sees: unknown key 'sees'. Did you mean `seeds`?"),
        (
            "solver:",
            "runs: {a: {vary: {observers.SHGO.theta: [1, 2]}}}\nsolver:",
            "a path stands under set: {name: v, values: [1, 2], set: {observers.SHGO.theta: v}}",
        ),
        (
            "solver:",
            "runs: {a: {vary: {name: observers.SHGO.theta, values: [1, 2]}}}\nsolver:",
            "a path stands under set: {name: v, values: [1, 2], set: {observers.SHGO.theta: v}}",
        ),
        (
            "-k*x1 + u\n  output: x1\n  parameters: {k: 4.5",
            "-k*x1 + u/k\n  output: x1\n  parameters: {k: 0",
            "by k, which is 0",
        ),
        ("SHGO: {type", "SHGO {type", "this line has no `:` after its key"),
        ("{type: shgo, theta: 2}", "{type: ekf, Q: 0}", "{state: 0.1, ...} (the diagonal)"),
        ("{type: shgo, theta: 2}", "{type: ekf, Q: [0.1, 0.1]}", "found a list: write {state: 0.1, ...}"),
        ("type: shgo", "typ: shgo", "observers.SHGO: type is missing; found 'typ'. Did you mean `type`?"),
        ("type: shgo", "type: SHGO", "Did you mean `shgo`? Known: shgo, "),
        (
            "{type: shgo, theta: 2}",
            "{theta: 2}",
            "type is missing: the label SHGO is a name of your own, the type one from hgorun list observers",
        ),
        ("output_step: 0.1", "dt: 0.1", "Did you mean `output_step`?"),
        ("end: 1", "tf: 1", "Did you mean `end`?"),
        ("  initial:", "  x0:", "Did you mean `initial`?"),
        ("  dynamics:", "  ode:", "Did you mean `dynamics`?"),
        ("std: 0.1", "sigma: 0.1", "Did you mean `std`?"),
        ("theta: 2", "gain: 2", "Did you mean `theta`?"),
    ],
)
def test_what_is_written_wrong(shell: Shell, right: str, wrong: str, words: str) -> None:
    assert right in CONFIG
    (shell.folder / "c.yaml").write_text(CONFIG.replace(right, wrong))
    code, out, err = shell("simulate", "c.yaml")
    assert (code, out, words in err) == (2, "", True), err
    assert "c.yaml:" in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "c.yaml"), "there is no command 'run'. Did you mean `hgorun simulate`?"),
        (("plot", "c.yaml"), "Did you mean `hgorun compare`?"),
        (("observers",), "Did you mean `hgorun list observers`?"),
        (("help",), "Did you mean `hgorun -h`?"),
        (("c.yaml",), "a command comes first: hgorun simulate c.yaml"),
        (("c.h5",), "a command comes first: hgorun compare c.h5"),
        (("simulate", "log.csv"), "this is a log, not a configuration: hgorun estimate CONFIG log.csv"),
        (
            ("report", "c.yaml"),
            "this is a configuration, not a result: a report is of an ensemble, such as 20 seeds: `echo '{base: c.yaml",
        ),
        (("simulate", "c.yaml", "--set", "theta=2"), "Did you mean `observers.SHGO.theta`?"),
        (("simulate", "c.yaml", "--set", "observers.shgo.theta=2"), "Did you mean `SHGO`?"),
    ],
)
def test_what_is_typed_wrong(shell: Shell, arguments: tuple[str, ...], words: str) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG)
    (shell.folder / "log.csv").write_text("t,y\n0,1\n")
    code, out, err = shell(*arguments)
    assert (code, out, words in err) == (2, "", True), err


@pytest.mark.parametrize("command", ["simulate", "analyze", "compare"])
def test_recorded_data_given_to_a_command_of_simulations(shell: Shell, command: str) -> None:
    recorded = CONFIG.replace("end: 1, output_step: 0.1", "unit: s") + "data: {file: log.csv, outputs: {x1: y}}\n"
    (shell.folder / "c.yaml").write_text(recorded)
    code, _, err = shell(command, "c.yaml")
    assert (code, "this configuration is of recorded data" in err, "hgorun estimate c.yaml" in err) == (
        2,
        True,
        True,
    ), err


def test_of_a_file_that_extends_recorded_data_the_file_itself_is_advised(shell: Shell) -> None:
    recorded = CONFIG.replace("end: 1, output_step: 0.1", "unit: s") + "data: {file: log.csv, outputs: {x1: y}}\n"
    (shell.folder / "c.yaml").write_text(recorded)
    (shell.folder / "week.yaml").write_text("extends: c.yaml\ntitle: a week\n")
    code, _, err = shell("simulate", "week.yaml")
    assert code == 2
    assert "data: this configuration is of recorded data: hgorun estimate week.yaml\n" in err


def test_a_run_without_an_accurate_fixed_step_is_exported_with_a_given_one(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a right-hand side jumps; a run in which no step is enough takes long to find that out."""
    none = SimpleNamespace(integration=SimpleNamespace(step=None, method=None))
    monkeypatch.setattr("hgorun.export.steps.controlled", lambda run: none)
    (shell.folder / "c.yaml").write_text(CONFIG.replace("{method: rk4, step: 0.01}", "{accuracy: 1e-5}"))
    code, _, err = shell("export", "c.yaml")
    assert (code, "solver.step: no fixed step reaches the accuracy 1e-05 in this run" in err) == (2, True), err
    assert "--check-step tells its error" in err


def test_a_step_that_was_given_may_be_why_an_observer_diverges(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG.replace("theta: 2", "theta: 1e5"))
    code, _, err = shell("simulate", "c.yaml")
    assert (code, "SHGO: a step of 0.01 was given; a shorter one, or none" in err) == (0, True), err
    (shell.folder / "c.yaml").write_text(CONFIG)
    assert shell("simulate", "c.yaml")[2] == ""


@pytest.mark.parametrize("command", ["simulate", "estimate", "list", "cite", "doctor", "init", "claims", "analyze"])
def test_each_command_says_what_it_takes_and_its_exit_codes(shell: Shell, command: str) -> None:
    code, out, _ = shell(command, "-h")
    assert (code, "Exit codes: 0 done" in out) == (0, True)
    assert out == shell(command, "--help")[1]
    assert not re.search(r"<\w+>|\{|\[\[", out)  # names of what it takes, not types of Python


def test_the_list_of_commands_fits_an_ordinary_terminal(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    _, out, _ = shell("-h")
    assert out.count("\n") > 30
    assert max(map(len, out.splitlines())) <= 80
    assert "..." not in out.split("Commands:")[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("simulate", "a.yaml", "--seed", "-3"), "--seed: expected an integer of at least 0, found -3"),
        (("simulate", "a.yaml", "--seed", "1.5"), "--seed: expected an integer of at least 0, found 1.5"),
        (("explore", "a.yaml", "--port", "99999"), "--port: expected an integer from 0 to 65535, found 99999"),
        (("sweep", "a.yaml", "--jobs", "0"), "--jobs: expected an integer of at least 1, found 0"),
    ],
)
def test_a_number_of_the_command_line_has_its_limits(shell: Shell, arguments: tuple[str, ...], words: str) -> None:
    (shell.folder / "a.yaml").write_text(CONFIG)
    assert shell(*arguments) == (2, "", f"hgorun: {words}\n")


@pytest.mark.costly
def test_an_unknown_figure_is_told_with_those_that_there_are(shell: Shell) -> None:
    code, _, err = shell("figures", "lee9")
    assert code == 2
    assert "no figure or experiment is called 'lee9'. Known: astolfi2016: linear-eps" in err


def test_an_observer_in_the_place_of_a_claim_is_told_as_what_it_is(shell: Shell) -> None:
    _, _, err = shell("claims", "kalman_bucy")
    assert "'kalman_bucy'. It is an observer: claims and figures have names of their own" in err
    _, _, err = shell("claims", "shgo")
    assert "; it is in astolfi2016/noise_linear, astolfi2016/noise_nonlinear, robles2023/" in err
    assert "It is a plant: " in shell("figures", "lee_second_order")[2]
    assert "; lee2016: 1, 2, 3, 4, 5, 6; " in err
    assert "Did you mean `3.9`? Known: " in shell("claims", "3.99")[2]


@pytest.mark.parametrize(
    ("arguments", "near"),
    [
        (("compare", "results/second.h5"), "results/second.h5: there is no such file. Did you mean `seconds.h5`?"),
        (("rerun", "results/seconds.yaml"), "results/seconds.yaml: there is no such file. Did you mean `seconds.h5`?"),
        (("compare", "nowhere/x.h5"), "nowhere/x.h5: there is no such file\n"),
        (("export", "c.yaml", "--observer", "SHG"), "no observer is called 'SHG'. Did you mean `SHGO`? Known: SHGO"),
    ],
)
def test_the_nearest_name_is_told(shell: Shell, arguments: tuple[str, ...], near: str) -> None:
    (shell.folder / "results").mkdir()
    (shell.folder / "results" / "seconds.h5").write_bytes(b"")
    (shell.folder / "c.yaml").write_text(CONFIG)
    code, _, err = shell(*arguments)
    assert (code, near in err) == (2, True), err


def test_a_file_of_another_kind_is_told_what_it_is(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG)
    assert shell("simulate", "c.yaml")[0] == 0
    code, _, err = shell("report", "results/c.h5")
    assert (code, "this is the result of a single run, not the result of a sweep: hgorun compare" in err) == (2, True)
    code, _, err = shell("benchmark", "c.yaml")
    assert (code, "c.yaml: this is a configuration; the file of a benchmark names plants" in err) == (2, True)
    code, _, err = shell("merge", "results/d")
    assert (code, "results/d: there is no such folder" in err) == (2, True)


@pytest.mark.slow
def test_a_figure_that_is_named_is_the_only_one_and_what_it_replaces_is_told(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(CONFIG)
    assert shell("compare", "c.yaml", "-o", "one.png")[1].endswith("\nwritten: one.png\n")
    assert shell("compare", "c.yaml", "-o", "one.png")[1].endswith("\nwritten: one.png (replaced)\n")
    assert not (shell.folder / "one.pdf").exists()


def test_faults_of_several_blocks_are_told_at_once(shell: Shell) -> None:
    """One of each block, the first as before; what follows from another fault is none."""
    (shell.folder / "c.yaml").write_text(
        "time: {end: 5, outptu_step: 0.1}\n"
        "plant: {type: van_der_pol, initial: {x1: 1, x2: 0}, parametrs: {a: 1}}\n"
        "measurement: {sampling: {perod: 0.1}}\n"
        "observers:\n"
        "  A: {type: shgoo, theta: 2}\n"
        "  B: {type: shgo, thet: 2}\n"
        "  C: {type: shgo, theta: 2}\n"
        "metrics: {windw: [1, 2]}\n"
    )
    code, out, err = shell("simulate", "c.yaml")
    assert (code, out) == (2, "")
    places = [line.removeprefix("hgorun: c.yaml:").split(": ")[:2] for line in err.splitlines()]
    assert sorted(places) == [
        ["1", "time.outptu_step"],
        ["2", "plant.parametrs"],
        ["3", "measurement.sampling"],
        ["5", "observers.A.type"],
        ["6", "observers.B.thet"],
        ["8", "metrics.windw"],
    ]
    assert places[0] == ["1", "time.outptu_step"]
    many = "".join(f"  O{i}: {{type: shgoo}}\n" for i in range(12))
    (shell.folder / "c.yaml").write_text(f"{CONFIG.split('observers')[0]}observers:\n{many}")
    told = shell("simulate", "c.yaml")[2].splitlines()
    assert len(told) == 11
    assert told[-1] == "hgorun: c.yaml: there are more faults: they are told when some of these are put right"
    (shell.folder / "c.yaml").write_text("observers: {S: {type: shgo, thet: 1}, T: 5}\nmeasurement: {perod: 1}\n")
    keys = [line.split(": ")[2] for line in shell("simulate", "c.yaml")[2].splitlines()]
    assert keys == ["time", "plant", "observers.T", "measurement.perod", "observers.S.thet"]


def _places(err: str) -> list[str]:
    """Line and key of every fault that is told of ``c.yaml``."""
    return [":".join(line.removeprefix("hgorun: c.yaml:").split(": ")[:2]) for line in err.splitlines()]


def test_all_keys_of_a_block_that_are_not_known_are_told_at_once(shell: Shell) -> None:
    """Also those of other observers and without a value; what may be missing because of them is not told."""
    (shell.folder / "c.yaml").write_text(
        "tiem: {end: 5}\n"
        "plant: {type: van_der_pol, intial: {x1: 1}, parametrs: {a: 1}}\n"
        "observers:\n"
        "  A: {type: shgo, thetta: 2, map: , initail: {x1: 1}}\n"
        "  B: {type: shgo, eta: 2, n: 3, thet: 3}\n"
        "solver: {step: -1, stpe: 0.1}\n"
    )
    _, _, err = shell("simulate", "c.yaml")
    wanted = ["1:tiem", "6:solver.stpe", "2:plant.intial", "2:plant.parametrs"]
    wanted += ["4:observers.A.thetta", "4:observers.A.map", "4:observers.A.initail"]
    wanted += ["5:observers.B.eta", "5:observers.B.n", "5:observers.B.thet"]
    assert _places(err) == wanted, err
    told = [line for line in err.splitlines() if "observers.A." in line]
    assert ["Known here" in line for line in told] == [True, False, False]
    assert told[2].endswith("unknown key 'initail'. Did you mean `initial`?")


def test_faults_of_figures_runs_and_blocks_are_told_at_once(shell: Shell) -> None:
    (shell.folder / "c.yaml").write_text(
        "time: {end: 5, output_step: 0.1}\n"
        "plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}\n"
        "observers: {A: {type: shgo, thetta: 2}}\n"
        "figures: {f: {panles: 3}}\n"
        "claims: [{id: a, claim: b, valeu: 3}]\n"
        "runs:\n"
        "  a: {sede: 3, claims: [], solver: {stpe: 1}}\n"
        "  b: {seeds: 1}\n"
        "  c.d: {}\n"
    )
    _, _, err = shell("simulate", "c.yaml")
    wanted = ["4:figures.f.panles", "5:claims.0.valeu", "7:runs.a.sede", "7:runs.a.claims", "9:runs.c.d"]
    assert _places(err) == [*wanted, "8:runs.b.seeds", "7:runs.a.solver.stpe", "3:observers.A.thetta"], err
    assert _places(shell("estimate", "c.yaml", "--run", "a")[2])[:2] == ["7:runs.a.sede", "7:runs.a.claims"]


def test_faults_of_several_runs_claims_and_figures_are_told_at_once(shell: Shell) -> None:
    claim = "{{id: {}, claim: x, value: \"rmse('{}', x2)\", below: 1}}"
    runs = "a: {observers: {A: {type: shgo, theta: -1}}}, b: {observers: {A: {type: shgo, theta: -2}}}"
    (shell.folder / "c.yaml").write_text(f"{CONFIG}runs: {{{runs}}}\n")
    assert shell("simulate", "c.yaml")[2].count(": expected a number above 0, found -") == 2
    figures = "f: {panels: [{state: x8}]}, g: {panels: [{state: x9}]}"
    claims = f"{claim.format('a', 'X')}, {claim.format('b', 'Y')}"
    (shell.folder / "c.yaml").write_text(f"{CONFIG}figures: {{{figures}}}\nclaims: [{claims}]\n")
    keys = [line.split(": ")[2] for line in shell("claims", "c.yaml")[2].splitlines()]
    assert keys == ["figures.f.panels.0.state", "figures.g.panels.0.state"]
    (shell.folder / "c.yaml").write_text(f"{CONFIG}claims: [{claims}, {claim.format('a', 'X')}]\n")
    keys = [line.split(": ")[2] for line in shell("claims", "c.yaml")[2].splitlines()]
    assert keys == ["claims.2.id"]
    (shell.folder / "c.yaml").write_text(f"{CONFIG}claims: [{claims}]\n")
    keys = [line.split(": ")[2] for line in shell("claims", "c.yaml")[2].splitlines()]
    assert keys == ["claims.0.value", "claims.1.value"]
