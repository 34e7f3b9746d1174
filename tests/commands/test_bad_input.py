"""Every wrong input gives exit code 2, one message with file, line and key, no traceback and no file."""

from __future__ import annotations

import copy
import re
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from hgorun.cli import main

BASE: dict[str, Any] = {
    "title": "base",
    "time": {"end": 1, "output_step": 0.1},
    "plant": {
        "type": "contois",
        "parameters": {"mu": 1.064, "k_c": 4.39, "s_in": 20},
        "inputs": {"D": "mu*(1 - abs(sin(t))/2)"},
        "initial": {"x1": 1.5, "x2": 15},
    },
    "measurement": {
        "sampling": {"period": 0.25},
        "noise": [{"type": "sinusoids", "terms": [{"amplitude": 0.5, "omega": 11.9}]}],
    },
    "observers": {
        "SHGO": {"type": "shgo", "theta": 1, "initial": {"x1": 1, "x2": 14}},
        "FHGO": {"type": "fhgo2", "theta": 2, "r": 2, "initial": {"x1": 1, "x2": 14}},
    },
    "solver": {"method": "rk4", "step": 0.01},
}
INLINE = {
    **copy.deepcopy(BASE),
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1 + a*u"},
        "output": "x1",
        "parameters": {"a": 2},
        "inputs": {"u": "sin(t)"},
        "initial": {"x1": 1, "x2": 0},
    },
}
MISSING = object()

WRONG_NUMBERS = [
    "text",
    "",
    None,
    True,
    [1],
    {"a": 1},
    ".nan",
    ".inf",
    "1/0",
    "0/0",
    "9**9**9",
    "2^3",
    "sqrt(-1)",
    "__import__('os').system('true')",
    "(lambda: 1)()",
    "x.__class__",
    "open('/etc/passwd')",
    "1 2",
    "1e400",
]
WRONG_POSITIVES = [0, -1, "0", "-1e-3", "1 - 1"]

# (where, value, what the message must name)
CASES: list[tuple[dict[str, Any], tuple[str | int, ...], Any, str]] = []


def case(path: str, *values: Any, base: dict[str, Any] = BASE, names: str | None = None) -> None:
    keys = tuple(int(k) if k.isdigit() else k for k in path.split("."))
    for value in values:
        CASES.append((base, keys, value, names if names is not None else str(keys[-1])))


case("time", MISSING, None, 5, "soon", [], {})
case("time.end", MISSING, 0, -1, *WRONG_NUMBERS)
case("time.output_step", MISSING, 1e-12, *WRONG_POSITIVES, *WRONG_NUMBERS)
case("time.start", 1, 2, "later")
case("time.unit", 5, [])
case("time.stop", 1)
case("time.max_memory", 0, 100, "many")
case("plant", MISSING, None, "contois", [], {}, {"type": None}, {"states": []})
case("plant.type", "contoiss", "", 5, None, "hgorun.cli", "../../x", "base", "os")
case("plant.parameters", 5, [1], "mu=1")
case("plant.parameters.mu", *WRONG_NUMBERS, "mu", "k_c + mu")
case("plant.parameters.mue", 1)
case("plant.parameters.k_c", "mu", base={**BASE, "plant": {**BASE["plant"], "parameters": {"mu": "k_c", "k_c": 1}}})
case("plant.inputs", MISSING, {}, 5, {"D": 1, "E": 2})
case(
    "plant.inputs.D",
    None,
    True,
    [1],
    {},
    "",
    "mu*",
    "sin(",
    "sin()",
    "sin(t, t)",
    "x1",
    "tt",
    "D",
    "t.real",
    "t[0]",
    "lambda*t",
    "t^2",
    "mu if t else 0",
    "f'{t}'",
    "eval('1')",
    "exec('1')",
    "(" * 500 + "t" + ")" * 500,
    "t" * 5000,
    "t\n+1",
    "2t",
    "1j*t",
    "t//2",
    "min(t)",
    "1/0",
    "exp(1000)",
)
case("plant.initial", MISSING, {}, {"x1": 1}, {"x1": 1, "x2": 2, "x3": 3}, 5)
case("plant.initial.x1", *WRONG_NUMBERS)
case("plant.disturbance", 5, {"x9": "t"}, {"x1": "nope"}, {"x1": "1/0"})
case("plant.colour", "red")
case("measurement", None, 5, [])
case("measurement.sampling", None, 5, "sometimes", [], {}, {"period": 0.1, "times": [0, 1]})
case("measurement.sampling.period", 1e-13, *WRONG_POSITIVES, *WRONG_NUMBERS)
case("measurement.sampling.offset", -1, "x")
case("measurement.sampling.jitter", -0.1)
case("measurement.sampling.dropout", -0.1, 1.5)
case("measurement.sampling.rate", 4)
case(
    "measurement.sampling",
    {"times": []},
    {"times": 5},
    {"times": [1, 0]},
    {"times": [0, 0]},
    {"times": [5, 6]},
    {"times": ["x"]},
    names="times",
)
case(
    "measurement.sampling",
    {"steps": "0"},
    {"steps": "-1"},
    {"steps": "1/k"},
    {"steps": "k"},
    {"steps": "0.4*0.5**k"},
    {"steps": "t"},
    {"steps": ""},
    names="steps",
)
case("measurement.delay", -0.1, "-1", "-sin(t)", "t - 0.5", "x1", "1/0", "log(t - 2)", [], {}, True, None)
case("measurement.noise", 5, "loud", {}, [5], [{}], [{"type": "pink"}], [{"terms": []}])
case("measurement.noise.0.terms", MISSING, [], 5, [5], [{}], [{"amplitude": 1}])
case("measurement.noise.0.terms.0.omega", *WRONG_NUMBERS)
case(
    "measurement.noise.0",
    {"type": "uniform", "low": 1, "high": 0},
    {"type": "uniform", "low": 1},
    {"type": "gaussian"},
    {"type": "gaussian", "std": -1},
    {"type": "gaussian", "std": 1, "snr_db": 3},
    {"type": "gaussian", "std": 1, "hold": 0},
    {"type": "expression"},
    {"type": "expression", "value": "x1"},
    {"type": "expression", "value": "1/0"},
    names="noise",
)
case("measurement.mode", "both", 5)
case("measurement.outputs", 5, {"y9": {}}, {"x1": 5}, {"x1": {"period": 1}})
case("measurement.phases", 5, [5], [{}], [{"until": 0.5}], [{"until": 0.5}, {"until": 0.2}], [{"until": "x"}])
case(
    "observers",
    MISSING,
    None,
    5,
    [],
    {"A": 5},
    {"A": {}},
    {"a/b": {"type": "shgo", "theta": 1}},
    {"a.b": {"type": "shgo", "theta": 1}},
    {"": {"type": "shgo", "theta": 1}},
)
case("observers.SHGO.type", MISSING, "shgoo", "", 5, None, "registry", "constant_gain")
case("observers.SHGO.theta", MISSING, *WRONG_POSITIVES, *WRONG_NUMBERS)
case("observers.SHGO.tetha", 1)
case(
    "observers.SHGO.poles",
    0,
    1,
    [],
    [-1],
    [-1, -2, -3],
    ["-1+2j", -1],
    "fast",
    [-1, None],
    {},
    ["-1+2j", "-1+2j"],
    [".nan", -1],
    names="SHGO",
)
case("observers.SHGO.gains", [1], [1, 2, 3], 5, ["x", 1], names="SHGO")
case(
    "observers.SHGO.initial",
    5,
    {"x9": 1},
    {"x1": 0, "x2": 14},
    {"x1": "a"},
    {"x1": -4.39, "x2": 19.2721},
    names="initial",
)
case("observers.SHGO.internal", 5, {"eta": 0}, {"alpha": [1, 2]}, {"alpha": "x"}, names="internal")
case(
    "observers.SHGO.saturation",
    5,
    {"x9": [0, 1]},
    {"x1": 5},
    {"x1": [1, 0]},
    {"x1": [0]},
    {"x1": ["a", 1]},
    names="saturation",
)
case("observers.SHGO.coordinates", "polar", 5)
case("observers.FHGO.r", -1, 1.5, "two", None, True, 1000, [])
case("observers.FHGO.internal", {"eta": [1, 2, 3]}, {"xhat": [1, 2]}, {"zeta": 1}, names="internal")
case("solver", 5, None, [])
case("solver.method", "ode45", 5, None)
case("solver.step", 0, -1, "quick", [], None)
case("solver.rtol", 1e-6)
case(
    "solver",
    {"method": "dopri5", "rtol": 0},
    {"method": "dopri5", "rtol": 1e-6, "atol": -1},
    {"method": "rk4", "max_step": 1},
)
case("solver.divergence", 0, "x")
case("seed", -1, 1.5, "x", None, True, 2**80)
case(
    "metrics",
    5,
    {"window": [1, 0]},
    {"window": [0]},
    {"settling": 2},
    {"average": 0},
    {"record": 0.03},
    {"windw": [0, 1]},
)
case(
    "figures",
    5,
    {"a": 5},
    {"a": {"panels": []}},
    {"a": {"panels": [{}]}},
    {"a": {"panels": [{"state": "x9"}]}},
    {"a": {"panels": [{"state": "x1", "observers": ["nobody"]}]}},
    {"a": {"panels": [{"state": "x1", "error": "x2"}]}},
)
case("extends", "nowhere.yaml", 5, "config.yaml", ".", "/dev/null")
case("extra", 1)
case("tme", {"end": 1})

case(
    "plant.states",
    MISSING,
    [],
    5,
    ["x1"],
    ["x1", "x1"],
    ["x1", "x2", "x3"],
    ["x1", "lambda"],
    ["x1", "2x"],
    ["x1", "sin"],
    ["x1", "a"],
    ["x1", "t"],
    base=INLINE,
    names="plant",
)
case(
    "plant.dynamics",
    MISSING,
    {},
    5,
    {"x1": "x2"},
    {"x1": "x2", "x2": "x9"},
    {"x1": "x2", "x2": "1/0"},
    {"x1": "x2", "x2": "sqrt(-1 - x1**2)"},
    {"x1": "x2", "x2": "import os"},
    base=INLINE,
    names="plant",
)
# not in the class of the observers: a state that never reaches the output, a singular map, an input that hides x2
case(
    "plant.dynamics",
    {"x1": "-x1", "x2": "-x2"},
    {"x1": "-x1 + u*x2", "x2": "-x2"},
    {"x1": "x1*x2*0", "x2": "x1"},
    {"x1": "x2*(1 + u)", "x2": "-x1"},
    {"x1": "x2 + t*x2", "x2": "-x1"},
    base=INLINE,
    names="plant",
)
case("plant.output", MISSING, [], {}, 5.5, "x9", "", ["x1", "x1"], base=INLINE, names="plant")
case("plant.parameters", {}, {"x1": 1}, {"a": "b", "b": "a"}, {"a": "a"}, base=INLINE, names="plant")
case("plant.inputs", {"u": "v", "v": "u"}, {"x2": "t"}, {}, base=INLINE, names="plant")

TEXTS = {
    "empty": "",
    "comment": "# nothing\n",
    "scalar": "hello\n",
    "list": "- 1\n- 2\n",
    "unclosed": "time: {end: 1\n",
    "tab": "time:\n\tend: 1\n",
    "duplicate": "time: {end: 1, output_step: 1}\ntime: {end: 2, output_step: 1}\n",
    "python_tag": "time: !!python/object/apply:os.system ['true']\n",
    "tag": "time: !thing {end: 1}\n",
    "merge_key": "a: &a {end: 1}\ntime:\n  <<: *a\n",
    "self_reference": "a: &a [*a]\n",
    "unknown_anchor": "time: *nothing\n",
    "two_documents": "a: 1\n---\nb: 2\n",
    "deep": "[" * 5000 + "]" * 5000 + "\n",
    "control": "title: \x01\n",
    "bomb": "a0: &a0 [1,1,1,1,1,1,1,1,1]\n"
    + "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12)),
    "large": "title: " + "x" * (2**20 + 1) + "\n",
    "binary": "\x7fELF\n",
}


def changed(base: dict[str, Any], keys: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    config = copy.deepcopy(base)
    place: Any = config
    for key in keys[:-1]:
        place = place.setdefault(key, {}) if isinstance(place, dict) else place[key]
    if value is MISSING:
        del place[keys[-1]]
    else:
        place[keys[-1]] = value
    return config


def run(arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    monkeypatch.setattr(sys, "argv", ["hgorun", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    out, err = capsys.readouterr()
    assert out == ""
    return int(stop.value.code or 0), err


def refused(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    monkeypatch.chdir(folder)
    before = set(folder.iterdir())
    code, err = run(["simulate", "config.yaml"], monkeypatch, capsys)
    assert code == 2, err
    assert "Traceback" not in err
    assert err.startswith("hgorun: ")
    assert err.count("\n") == 1, err
    assert set(folder.iterdir()) == before
    return err


def number_of(i: int) -> str:
    _, keys, value, _ = CASES[i]
    text = "MISSING" if value is MISSING else repr(value)
    return f"{'.'.join(map(str, keys))}={text[:30]}"


# One in five runs with the fast tests: each is a whole command.
@pytest.mark.measured_once
@pytest.mark.parametrize(
    "i",
    [pytest.param(i, id=number_of(i), marks=[pytest.mark.slow] if i % 5 else []) for i in range(len(CASES))],
)
def test_a_wrong_key_is_refused(
    i: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    base, keys, value, names = CASES[i]
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(changed(base, keys, value), sort_keys=False))
    err = refused(tmp_path, monkeypatch, capsys)
    assert re.match(r"hgorun: config\.yaml:\d+: ", err), err
    assert names in err, err


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
def test_a_wrong_text_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "config.yaml").write_text(TEXTS[name])
    assert "config.yaml" in refused(tmp_path, monkeypatch, capsys)


def test_there_are_enough_cases() -> None:
    assert len(CASES) + len(TEXTS) >= 300


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"not hdf5", b"\x89HDF\r\n\x1a\n" + bytes(100)])
@pytest.mark.measured
def test_a_wrong_result_file_is_refused(
    content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.h5").write_bytes(content)
    code, err = run(["compare", "a.h5"], monkeypatch, capsys)
    assert code == 2
    assert "a.h5" in err
    assert err.count("\n") == 1


@pytest.mark.measured("arguments6")
@pytest.mark.costly
@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "nowhere.yaml"],
        ["simulate", "."],
        ["compare", "nowhere.h5"],
        ["simulate", "a/config.yaml", "b/config.yaml"],
        ["compare", "nowhere.yaml", "--format", "html"],
        ["show", "shgoo"],
        ["list", "plant"],
        ["figures", "9.99"],
        ["init", "nothing"],
    ],
)
def test_a_wrong_argument_is_refused(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    code, err = run(arguments, monkeypatch, capsys)
    assert code == 2
    assert "Traceback" not in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    "assignment",
    [
        "theta",
        "observers.SHGO.theta=-1",
        "observers.SHGO.tetha=1",
        "nothing.x=1",
        "time.end.x=1",
        "seed=x",
        "=1",
        "plant.type=nothing",
    ],
)
def test_a_wrong_override_is_refused(
    assignment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(BASE, sort_keys=False))
    code, err = run(["simulate", "config.yaml", "--set", assignment], monkeypatch, capsys)
    assert code == 2, err
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "config.yaml"]
