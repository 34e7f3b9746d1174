"""``hgorun sweep`` and ``hgorun merge`` as from a shell."""

from __future__ import annotations

import json
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import pytest
import yaml
from shell import Shell

import hgorun
from hgorun.ensemble.members.fingerprint import fingerprint
from hgorun.ensemble.sweep import Count

BASE = """
time: {end: 0.5, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}
measurement: {sampling: {period: 0.1}, noise: [{type: gaussian, std: 0.1}]}
observers:
  SHGO: {type: shgo, theta: 3}
  FHGO: {type: fhgo1, theta: 2, delta: 3}
solver: {step: 0.01}
"""
ESCAPES = "plant: {states: [a, b], dynamics: {a: b, b: b**2}, output: a, initial: {a: 0, b: 10}}"  # at 0.1
SWEEP = """
title: Gains and seeds
base: base.yaml
axes:
  observers.SHGO.theta: {log: [2, 20, 3]}
  seed: {count: 4}
keep: {metrics: [rmse, peak]}
"""


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "base.yaml").write_text(BASE)
    (tmp_path / "s.yaml").write_text(SWEEP)
    return Shell(tmp_path, monkeypatch, capsys)


@pytest.mark.slow
def test_a_sweep_is_carried_out_and_collected(shell: Shell) -> None:
    assert shell("sweep", "s.yaml") == (
        0,
        "s: 12 members\n  SHGO  12 ok\n  FHGO  12 ok\n"
        "kept: results/s.sweep (the members, which the same call finds again; it may be deleted)\n"
        "written: results/s.sweep.h5\n",
        "",
    )
    assert (shell.folder / "results" / "s.sweep" / "manifest.json").is_file()
    code, out, _ = shell("sweep", "s.yaml", "--json")
    assert code == 0
    assert json.loads(out) == {
        "name": "s",
        "file": "results/s.sweep.h5",
        "folder": "results/s.sweep",
        "members": 12,
        "finished": 12,
        "status": "ok",
        "failed": 0,
        "observers": {"SHGO": {"ok": 12}, "FHGO": {"ok": 12}},
    }
    assert shell("sweep", "s.yaml", "-q")[1] == ""
    found = hgorun.read_sweep(shell.folder / "results" / "s.sweep.h5")
    assert (found.title, list(found.metrics)) == ("Gains and seeds", ["rmse", "peak"])
    code, out, _ = shell("compare", "results/s.sweep", "--json", "--no-plots")
    assert (code, json.loads(out)["members"]) == (0, 12)


@pytest.mark.slow
def test_output_names_the_file_or_the_folder_around(shell: Shell) -> None:
    assert shell("sweep", "s.yaml", "-q", "-o", "x.h5")[0] == 0
    assert shell("sweep", "s.yaml", "-q", "-o", "there")[0] == 0
    assert shell("sweep", "s.yaml", "-q", "-o", "y.sweep.h5")[0] == 0
    made = {str(p.relative_to(shell.folder)) for p in shell.folder.rglob("*") if p.suffix in (".h5", ".json")}
    assert {"x.h5", "x.sweep/manifest.json", "there/s.sweep.h5", "there/s.sweep/manifest.json"} <= made
    assert {"y.sweep.h5", "y.sweep/manifest.json"} <= made
    code, _, err = shell("sweep", "s.yaml", "-o", "x.png")
    assert (code, "--output: expected a file" in err) == (2, True)


@pytest.mark.measured
@pytest.mark.slow
def test_parts_are_merged_to_the_same_file(shell: Shell) -> None:
    assert shell("sweep", "s.yaml", "-q")[0] == 0
    code, out, _ = shell("sweep", "s.yaml", "--part", "1/2", "-o", "one")
    assert (code, out) == (0, "one/s.sweep: part 1/2 is finished; 6 of 12 members are there\n")
    code, out, _ = shell("sweep", "s.yaml", "--part", "2/2", "-o", "two", "--json")
    assert (code, json.loads(out)["finished"], json.loads(out)["file"]) == (0, 6, None)
    code, _, err = shell("sweep", "s.yaml", "--collect", "-o", "one")
    assert (code, "6 of 12 members are missing, the first is 6" in err) == (1, True)
    code, out, _ = shell("merge", "one/s.sweep", "two/s.sweep", "-o", "both")
    assert (code, out.splitlines()[-1]) == (0, "written: both/s.sweep.h5")
    whole = (shell.folder / "results" / "s.sweep.h5").read_bytes()
    assert (shell.folder / "both" / "s.sweep.h5").read_bytes() == whole
    assert shell("sweep", "s.yaml", "--part", "2/2", "-o", "one", "-q")[0] == 0  # array jobs share a folder
    assert (shell.folder / "one" / "s.sweep.h5").read_bytes() == whole
    assert shell("sweep", "s.yaml", "--collect", "-o", "both")[0] == 0


def test_folders_of_different_sweeps_are_not_merged(shell: Shell) -> None:
    shell("sweep", "s.yaml", "--part", "1/2", "-o", "one", "-q")
    (shell.folder / "s.yaml").write_text(SWEEP.replace("20, 3", "30, 3"))
    shell("sweep", "s.yaml", "--part", "2/2", "-o", "two", "-q")
    code, out, err = shell("merge", "one/s.sweep", "two/s.sweep", "-o", "both")
    assert (code, out) == (2, "")
    assert "two/s.sweep: holds members of something else: axes.observers.SHGO.theta.log.1: 30.0 -> 20.0" in err
    assert "--fresh" not in err
    code, _, err = shell("merge", "two/s.sweep", "-o", "one")
    assert (code, "choose another --output" in err, "--fresh" in err) == (2, True, False)
    assert shell("merge", "nowhere")[0] == 2
    manifest = shell.folder / "two" / "s.sweep" / "manifest.json"
    said = json.loads(manifest.read_text())
    said["made_of"]["version"] = "0.0.1"
    manifest.write_text(json.dumps(said | {"fingerprint": fingerprint(said["made_of"])}))
    code, _, err = shell("merge", "two/s.sweep", "-o", "both")
    assert (code, f"hgorun 0.0.1 -> {hgorun.__version__}" in err) == (2, True)
    assert not (shell.folder / "both").exists()


@pytest.mark.slow
def test_a_change_is_refused_with_the_difference(shell: Shell) -> None:
    shell("sweep", "s.yaml", "-q")
    (shell.folder / "base.yaml").write_text(BASE.replace("delta: 3", "delta: 4"))
    code, out, err = shell("sweep", "s.yaml")
    said = "results/s.sweep: holds members of something else: observers.FHGO.delta: 3.0 -> 4.0; --fresh starts anew"
    assert (code, out, err) == (2, "", f"hgorun: {said}\n")
    assert shell("sweep", "s.yaml", "--fresh", "-q")[0] == 0
    (shell.folder / "base.yaml").write_text("# a comment\n" + BASE.replace("delta: 3", "delta: 4"))
    assert shell("sweep", "s.yaml", "-q")[0] == 0


@pytest.mark.costly
def test_members_that_fail_are_said_on_stderr(shell: Shell) -> None:
    (shell.folder / "s.yaml").write_text("base: base.yaml\naxes: {observers.SHGO.theta: [-1, 2]}\n")
    code, out, err = shell("sweep", "s.yaml")
    assert (code, out.splitlines()[1]) == (0, "  SHGO  1 ok, 1 failed")
    assert err == (
        "hgorun: s: 1 of 2 members failed; the first is member 0: axis observers.SHGO.theta: "
        "expected a number above 0, found -1\n"
    )
    assert shell("sweep", "s.yaml", "--strict", "-q")[0] == 3


def test_each_reason_why_members_fail_is_said_once(shell: Shell) -> None:
    axes = "{measurement.sampling.period: [0.1, 0.1, 0.1, -1, 0.1], observers.SHGO.theta: [2, -1, -3, 2, 2]}"
    (shell.folder / "s.yaml").write_text(f"base: base.yaml\ncombine: zip\naxes: {axes}\n")
    _, _, err = shell("sweep", "s.yaml", "-q")
    above = "expected a number above 0, found"
    assert err.splitlines() == [
        f"hgorun: s: 3 of 5 members failed; the first is member 1: axis observers.SHGO.theta: {above} -1",
        f"hgorun: s: member 3 for another reason: axis measurement.sampling.period: {above} -1.0",
    ]


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        ("{observers.SHGO.theta: [1, two]}", "s.yaml:2: axes.observers.SHGO.theta: `two` is not a number"),
        ('{observers.SHGO.theta: [1, 2, "3,5", 4]}', "a decimal number is written with a point"),
        ("{solver.method: [rk4, euler, ode45, rk4]}", "found 'ode45'. Did you mean `dopri5`?"),
    ],
)
def test_a_text_that_a_key_cannot_have_is_refused_before_anything_runs(shell: Shell, axes: str, words: str) -> None:
    (shell.folder / "s.yaml").write_text(f"base: base.yaml\naxes: {axes}\n")
    code, _, err = shell("sweep", "s.yaml")
    assert (code, words in err) == (2, True), err
    assert not (shell.folder / "results").exists()


@pytest.mark.measured
@pytest.mark.slow
def test_a_base_that_is_refused_is_said_as_of_a_single_run(shell: Shell) -> None:
    (shell.folder / "base.yaml").write_text(
        BASE.replace("theta: 3}", "theta: 3}\n  L: {type: lowpass, theta: 2, rho: 5}")
    )
    alone = shell("simulate", "base.yaml")
    assert alone[0] == 2
    assert alone[2].startswith("hgorun: base.yaml:7: observers.L")
    assert shell("sweep", "s.yaml") == alone
    assert not (shell.folder / "results").exists()
    (shell.folder / "s.yaml").write_text("base: base.yaml\naxes: {observers.L.rho: [0.1, 5]}\n")
    assert shell("sweep", "s.yaml", "-q")[0] == 0  # one of the members can be carried out


@pytest.mark.measured
@pytest.mark.slow
def test_a_sweep_all_of_whose_members_fail_has_failed(shell: Shell) -> None:
    (shell.folder / "base.yaml").write_text(
        BASE.replace("plant: {type: van_der_pol, initial: {x1: 1, x2: 0.5}}", ESCAPES)
    )
    code, out, err = shell("sweep", "s.yaml")
    assert (code, out.splitlines()[1]) == (1, "  SHGO  12 failed")
    assert "12 of 12 members failed" in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("s.yaml", "--part", "3/2"), "--part: expected k/n with 1 <= k <= n, found '3/2'"),
        (("s.yaml", "--executor", "fork"), "--executor: expected one of threads, processes, dask, found 'fork'"),
        (("s.yaml", "--scheduler", "tcp://x:1"), "--scheduler goes with --executor dask"),
        (("s.yaml", "--executor", "dask", "--scheduler", "tcp://x:1", "--jobs", "2"), "--jobs does not go with"),
        (("s.yaml", "--collect", "--fresh"), "--collect carries nothing out"),
        (("s.yaml", "--collect"), "results/s.sweep: there is no such folder"),
        (("base.yaml",), "base.yaml: none of its runs has seeds or vary; a sweep file has base, axes and keep"),
        (("s.yaml", "--run", "one"), "s.yaml: --run goes with a configuration; a sweep file has the key run"),
        (("nowhere.yaml",), "nowhere.yaml: there is no such file"),
    ],
)
def test_options_that_do_not_fit_are_refused(shell: Shell, arguments: tuple[str, ...], words: str) -> None:
    code, out, err = shell("sweep", *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert not (shell.folder / "results").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SWEEP.replace("base.yaml", "other.yaml"), "s.yaml:3: base: other.yaml: there is no such file"),
        (SWEEP.replace("FHGO", "X").replace("SHGO", "XHGO"), "s.yaml:5: axes.observers.XHGO.theta: "),
        (SWEEP + "run: one\n", "s.yaml"),
        (SWEEP.replace("rmse,", "rms,"), "s.yaml:7: keep.metrics.0: no metric is called 'rms'"),
        ("base: base.yaml\naxes: {seed: {count: 2}}\ntime: {end: 1}\n", "s.yaml:3: time: unknown key 'time'"),
    ],
)
def test_what_is_wrong_in_the_file_is_named_with_its_line(shell: Shell, text: str, words: str) -> None:
    (shell.folder / "s.yaml").write_text(text)
    code, out, err = shell("sweep", "s.yaml")
    assert (code, out) == (2, "")
    assert words in err


def test_other_commands_know_a_sweep_file(shell: Shell) -> None:
    code, _, err = shell("simulate", "s.yaml")
    assert (code, err) == (2, "hgorun: s.yaml: this is a sweep file; hgorun sweep s.yaml carries it out\n")


def test_a_base_may_stand_in_the_file_and_have_runs(shell: Shell) -> None:
    inline = "base:\n  extends: base.yaml\n  runs: {slow: {}, fast: {observers: {SHGO: {theta: 9}}}}\nrun: fast\n"
    (shell.folder / "s.yaml").write_text(inline + "axes: {seed: {count: 2}}\n")
    assert shell("sweep", "s.yaml", "-q")[0] == 0
    manifest = json.loads((shell.folder / "results" / "s.sweep" / "manifest.json").read_text())
    assert manifest["made_of"]["configuration"]["observers"]["SHGO"]["theta"] == 9
    (shell.folder / "s.yaml").write_text(inline.replace("run: fast", "run: fats") + "axes: {seed: {count: 2}}\n")
    code, _, err = shell("sweep", "s.yaml", "--fresh")
    assert (code, "s.yaml:4: run: expected one of slow, fast. Did you mean `fast`?" in err) == (2, True)


STUDY = (
    BASE
    + """
runs:
  one: {}
  random: {seeds: 3, seed: 5}
  gains: {vary: {name: a, values: [1, 2], set: {observers.SHGO.theta: 2*a, observers.FHGO.delta: 3 + a/2}}}
"""
)


@pytest.mark.measured
@pytest.mark.slow
def test_ensembles_of_a_study_are_sweeps(shell: Shell) -> None:
    (shell.folder / "study.yaml").write_text(STUDY)
    code, out, err = shell("sweep", "study.yaml", "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert [(one["name"], one["file"]) for one in told] == [
        ("random", "results/study/random.sweep.h5"),
        ("gains", "results/study/gains.sweep.h5"),
    ]
    runs = hgorun.load_study(shell.folder / "study.yaml").runs
    for name, axis, values in (("random", "seed", [5, 6, 7]), ("gains", "observers.SHGO.theta", [2, 4])):
        found = hgorun.read_sweep(shell.folder / "results" / "study" / f"{name}.sweep.h5")
        assert found.axes[axis].tolist() == values
        for i, experiment in enumerate(runs[name].members()):
            alone = hgorun.simulate(experiment)
            for j, label in enumerate(found.observers):
                assert found.metrics["hf"][i, j].tolist() == alone.observers[label].metrics["hf"].tolist()
    assert shell("simulate", "study.yaml", "-q")[0] == 0  # finds them finished
    code, out, _ = shell("sweep", "study.yaml", "--run", "random", "-o", "x.h5")
    assert (code, out.splitlines()[-1]) == (0, "written: x.h5")
    code, _, err = shell("sweep", "study.yaml", "-o", "y.h5")
    assert (code, "y.h5 is one file, but there are 2 ensembles" in err) == (2, True)
    code, _, err = shell("sweep", "study.yaml", "--run", "one")
    assert (code, "no run with seeds or vary is called 'one'. Known: random, gains" in err) == (2, True)


def test_beginning_anew_names_a_folder_that_is_in_the_way(shell: Shell) -> None:
    (shell.folder / "out" / "s.sweep.h5").mkdir(parents=True)
    code, _, err = shell("sweep", "s.yaml", "-o", "out", "--fresh")
    assert (code, "s.sweep.h5 cannot be written: it is a folder" in err) == (2, True)


@pytest.mark.slow
def test_a_block_that_nobody_has_written_is_refused_by_every_command(shell: Shell) -> None:
    shell("sweep", "s.yaml", "-o", "out", "-q")
    block = next((shell.folder / "out" / "s.sweep" / "blocks").iterdir())
    name = f"{block.name.rpartition('-')[0]}-{sha256(b'no block').hexdigest()[:32]}.h5"
    block.rename(block.with_name(name)).write_bytes(b"no block")
    (shell.folder / "out" / "s.sweep.h5").unlink()
    for text in ("sweep s.yaml -o out", "compare out/s.sweep", "merge out/s.sweep -o m"):
        code, _, err = shell(*text.split())
        assert (code, name in err, "Traceback" in err) == (2, True, False)
    assert not (shell.folder / "m" / "s.sweep" / "blocks").exists()


@pytest.mark.parametrize(
    ("options", "done", "said"),
    [
        ((), 0, "s: no member is finished yet; the same command begins again"),
        ((), 5, "s: 5 of 12 members are finished; the same command continues there"),
        (("--fresh",), 5, "s: 5 of 12 members are finished; the same command without --fresh continues there"),
    ],
)
def test_an_interrupted_sweep_says_what_the_same_command_finds(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], done: int, said: str
) -> None:
    def stopped(*_: object, told: Callable[[Count], None], **__: object) -> None:
        told(Count(12, done + 2, stored=done))  # two more of a block that is not written
        raise KeyboardInterrupt

    monkeypatch.setattr("hgorun.commands.sweep.carry_out", stopped)
    code, _, err = shell("sweep", "s.yaml", *options)
    assert (code, err) == (130, f"hgorun: interrupted; no file is left half-written\nhgorun: {said}\n")


def test_an_interrupted_ensemble_of_a_run_says_it_too(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(ensemble: object, place: object, told: Callable[[Count], None]) -> None:
        told(Count(3, 2, stored=2))
        raise KeyboardInterrupt

    monkeypatch.setattr("hgorun.commands.ensembles.carried_out", stopped)
    (shell.folder / "r.yaml").write_text(f"{BASE}runs: {{many: {{seeds: 3}}}}")
    assert shell("simulate", "r.yaml")[2].endswith(
        "many: 2 of 3 members are finished; the same command continues there\n"
    )


def test_a_value_that_an_axis_replaces_is_no_further_fault(shell: Shell) -> None:
    blocks = {label: {"type": "shgo", "theta": -2, "poles": -1} for label in ("C", "D")}
    base = {"time": {"end": 2, "outputs": 1}, "plant": {"type": "van_der_pol"}, "observers": blocks}
    (shell.folder / "base.yaml").write_text(yaml.safe_dump(base))
    for axes, labels in (({"observers.C.theta": [1, 2]}, ["D"]), ({"observers.*.theta": [1, 2]}, [])):
        (shell.folder / "swept.yaml").write_text(yaml.safe_dump({"base": "base.yaml", "axes": axes}))
        code, _, err = shell("sweep", "swept.yaml")
        assert (code, "time.outputs: unknown key" in err) == (2, True)
        assert [label for label in "CD" if f"observers.{label}.theta: expected" in err] == labels
