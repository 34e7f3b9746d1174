"""Configurations on top of each other: ``--set`` and ``extends``, and the positions they leave."""

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from examples import load
from hypothesis import given, settings
from hypothesis import strategies as st
from written import EXAMPLE

from hgorun.config.overrides import merge, replaced, set_path
from hgorun.config.paths import at, walk
from hgorun.config.reading import read_source
from hgorun.config.yaml_source import Source, parse
from hgorun.errors import ConfigError

# --set


def get(source: Source, *path: str | int) -> Any:
    return at(source.data, path)


@pytest.mark.parametrize(
    ("assignment", "path", "value"),
    [
        ("time.end=5", ("time", "end"), 5),
        ("title=a = b", ("title",), "a = b"),
        ("observers.SHGO.theta=1e1", ("observers", "SHGO", "theta"), 10.0),
        ("observers.SHGO.theta='3'", ("observers", "SHGO", "theta"), "3"),
        ("observers.FHGO r=2.theta=4", ("observers", "FHGO r=2", "theta"), 4),
        ("observers.FHGO r=2.new=4", ("observers", "FHGO r=2", "new"), 4),
        ("observers.FHGO r=2=4", ("observers", "FHGO r=2"), 4),
        ("observers.FHGO r=3.theta=4", ("observers", "FHGO r"), "3.theta=4"),
        (
            "observers.SHGO={type: shgo, theta: [1, 2]}",
            ("observers", "SHGO"),
            {"type": "shgo", "theta": [1, 2]},
        ),
        (
            "measurement.noise.0.terms.1.omega=0.95*pi",
            ("measurement", "noise", 0, "terms", 1, "omega"),
            "0.95*pi",
        ),
        ("plant.parameters.mu=1", ("plant", "parameters", "mu"), 1),
        ("disturbance.x1=sin(t)", ("disturbance", "x1"), "sin(t)"),
        ("solver.method=rk4", ("solver", "method"), "rk4"),
        ("a.b.c.d=[]", ("a", "b", "c", "d"), []),
    ],
)
def test_set_path(assignment: str, path: tuple[str | int, ...], value: object) -> None:
    before = parse(EXAMPLE, "c.yaml")
    after = set_path(before, assignment)
    assert get(after, *path) == value
    assert type(get(after, *path)) is type(value)
    assert after.where(path) == (f"--set {assignment}", 1)
    assert before == parse(EXAMPLE, "c.yaml")
    assert set(after.positions) == {p for p, _ in walk(after.data)}
    for p, place in after.positions.items():
        assert place == before.positions.get(p, (f"--set {assignment}", 1)) or p[: len(path)] == path


@pytest.mark.parametrize("nothing", ["null", "~"])
def test_set_path_removes_what_is_set_to_null(nothing: str) -> None:
    text = "a: {b: 1, c: 2}\nl:\n- 1\n- 2\n- x: 3\n"
    found = set_path(parse(text, "f"), f"a.b={nothing}")
    assert found.data == {"a": {"c": 2}, "l": [1, 2, {"x": 3}]}
    assert ("a", "b") not in found.positions
    found = set_path(parse(text, "f"), f"l.0={nothing}")
    assert get(found, "l") == [2, {"x": 3}]
    assert found.where(("l", 1, "x")) == ("f", 5)  # where it stands in the file
    assert found.where(("l", 0)) == ("f", 4)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("observers.SHG=null", "there is no 'SHG' to remove. Did you mean `SHGO`? Known here: "),
        ("observers.SHGO.gain=~", "there is no 'gain' to remove"),
        ("observers.X.theta=null", "there is no 'X' to remove"),
    ],
)
def test_what_is_not_there_cannot_be_removed(assignment: str, words: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(words)):
        set_path(parse(EXAMPLE, "c.yaml"), assignment)


def test_set_path_prefers_the_longest_path() -> None:
    source = parse("{a: {b: 1}, a=x: {b: 1}, a.b: 1, 'l': [{c: 1}]}", "f")
    assert get(set_path(source, "a=x.b=2"), "a=x", "b") == 2
    assert get(set_path(source, "a=y.b=2"), "a") == "y.b=2"
    assert get(set_path(source, "l.0.c=5"), "l", 0, "c") == 5


def test_set_path_in_turn() -> None:
    source = parse("a: 1", "f")
    for assignment in ("b.c=1", "b.d={e: 2}", "b.d.e=3", "b.d.f=4"):
        source = set_path(source, assignment)
    assert source.data == {"a": 1, "b": {"c": 1, "d": {"e": 3, "f": 4}}}
    assert source.where(("b",)) == ("--set b.c=1", 1)
    assert source.where(("b", "d")) == ("--set b.d={e: 2}", 1)
    assert source.where(("b", "d", "e")) == ("--set b.d.e=3", 1)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("time.end", "path=value"),
        ("=5", "path=value"),
        ("", "path=value"),
        ("time.=5", "path=value"),
        ("time..end=5", "path=value"),
        (".time=5", "path=value"),
        ("time.end = 5", "path=value"),
        ("title=", "no value behind `=`: write --set title=value; `--set title=null` removes it"),
        ("observers.FHGO r=2=", "; `--set 'observers.FHGO r=2=null'` removes it"),
        ("solver.step= ", "no value behind `=`: write --set solver.step=value"),
        ("title=#x", "needs quotes: it is a comment; as text: `--set 'title=\"#x\"'`"),
        ("title=[a", "a shell takes quotes away, so the whole stands in single ones, as in `--set 'title=\"a: b\"'`"),
        ("observers.*.thet=5", "no observer's block has the key 'thet'. Did you mean `theta`? Known here: type"),
        ("time.end.outputstep=5", "Did you mean `output_step`?"),
        ("time.end.x=5", "`time.end` is '40' and has no `x` in it. Beside it: end, output_step, unit."),
        ("measurement.noise.1.type=x", "an index from 0 to 0"),
        ("measurement.noise.-1=x", "index"),
        ("measurement.noise.x=1", "index"),
        ("measurement.noise.terms=1", "Did you mean `measurement.noise.0.terms`?"),
        ("time.end=[1", "bracket"),
        ("time.end=!!str 1", "tag"),
        ("time.end=@", "quotes"),
        ("a" + ".a" * 60 + "=1", "50"),
        ("a" + ".a" * 20 + "=" + "[" * 40 + "]" * 40, "50"),
    ],
)
def test_set_path_refusals(assignment: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        set_path(parse(EXAMPLE, "c.yaml"), assignment)
    assert words in str(caught.value)
    assert caught.value.file == f"--set {assignment}"
    assert caught.value.line == 1


@pytest.mark.parametrize(
    "text", ["%d.%m.%Y %H:%M", "@home", "a: b: c", "*x", "!x", "#x", 'it\'s: %d: "x"', "- a: b\\d: c"]
)
def test_what_is_advised_is_a_word_for_the_shell_and_text_for_yaml(text: str) -> None:
    """It is pasted as it stands: taken apart as a shell does, it sets the text."""
    source = parse(EXAMPLE, "c.yaml")
    with pytest.raises(ConfigError) as caught:
        set_path(source, f"observers.FHGO r=2.note={text}")
    option, assignment = shlex.split(re.findall(r"as text: `(.*)`$", str(caught.value))[0])
    assert option == "--set"
    assert get(set_path(source, assignment), "observers", "FHGO r=2", "note") == text


def test_a_column_of_which_more_is_set_is_advised_as_a_mapping() -> None:
    source = parse("data: {time: Zeit in h, outputs: {y: y}}", "c.yaml")
    for text, value in (("%d.%m.%Y", "%d.%m.%Y"), ('"%d"', "%d"), ("1", "1")):
        with pytest.raises(ConfigError) as caught:
            set_path(source, f"data.time.format={text}")
        _, assignment = shlex.split(re.findall("`(--set .*)`", str(caught.value))[0])
        assert get(set_path(source, assignment), "data", "time") == {"column": "Zeit in h", "format": value}


def test_all_observers_whose_blocks_have_a_key_are_set_at_once() -> None:
    text = "{observers: {A: {theta: 1}, 'B r=2': {theta: 2}, C: {type: ekf}}}"
    found = set_path(parse(text, "f"), "observers.*.theta=5")
    assert found.data["observers"] == {"A": {"theta": 5}, "B r=2": {"theta": 5}, "C": {"type": "ekf"}}
    assert found.where(("observers", "A", "theta")) == ("--set observers.*.theta=5", 1)
    assert "theta" not in set_path(parse(text, "f"), "observers.*.theta=null").data["observers"]["A"]
    starred = parse("{observers: {'*': {theta: 1}, A: {theta: 2}}}", "f")
    assert set_path(starred, "observers.*.theta=5").data["observers"] == {"*": {"theta": 5}, "A": {"theta": 2}}


@pytest.mark.parametrize(
    ("text", "assignment", "meant"),
    [
        ("{observers: {B: {theta: 1}}}", "theta=3", "Did you mean `observers.B.theta`?"),
        (
            "{observers: {A: {theta: 1}, B: {theta: 2}}, plant: {theta: 1}}",
            "theta=3",
            "Did you mean `observers.A.theta`, `observers.B.theta` or `plant.theta`? observers.*.theta is that of all",
        ),
        (
            str({"observers": {f"O{i}": {"theta": i} for i in range(8)}}),
            "theta=3",
            "`observers.O4.theta`, `observers.O5.theta` or another of 8? observers.*.theta",
        ),
    ],
)
def test_all_places_are_named_where_only_the_last_keys_are_given(text: str, assignment: str, meant: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(meant)):
        set_path(parse(text, "f"), assignment)


def test_set_path_into_an_empty_list_or_a_scalar() -> None:
    for text, words in (("a: []", "empty"), ("[]", "`the file` is a list"), ("5", "`the file` is '5'")):
        with pytest.raises(ConfigError) as caught:
            set_path(parse(text, "f"), "a.0=1" if text == "a: []" else "0=1")
        assert words in str(caught.value)


# replaced: as --set, with a value in place of text


@pytest.mark.parametrize(
    ("path", "value", "place"),
    [
        ("time.end", 5.0, ("time", "end")),
        ("measurement.noise.0.terms.1.omega", 2.0, ("measurement", "noise", 0, "terms", 1, "omega")),
        ("observers.FHGO r=2.r", 1, ("observers", "FHGO r=2", "r")),
        ("solver.step", 0.1, ("solver", "step")),
        ("observers.new", {"type": "shgo", "theta": [1]}, ("observers", "new")),
        ("time.end", None, ("time", "end")),
        ("measurement.noise.0.terms.0", None, ("measurement", "noise", 0, "terms", 0)),
        ("title", None, ("title",)),
        ("nothing.there", None, ("nothing", "there")),
    ],
)
def test_a_value_in_place_of_another(path: str, value: object, place: tuple[str | int, ...]) -> None:
    before = parse(EXAMPLE, "c.yaml")
    after, where = replaced(before, path, value)
    assert where == place
    if value is not None:
        assert get(after, *place) == value
        assert after.positions.keys() == {p for p, _ in walk(after.data)}
    elif place == ("measurement", "noise", 0, "terms", 0):
        assert get(after, *place[:-1]) == [{"amplitude": 0.5, "omega": 12.189}]
    else:
        assert path.split(".")[-1] not in get(after, *place[:-1]) if place[0] != "nothing" else after == before
    assert before == parse(EXAMPLE, "c.yaml")


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("time..end", "expected keys separated by dots, found 'time..end'"),
        ("", "expected keys separated by dots"),
        ("time.end.x", "`time.end` is '40'"),
        ("measurement.noise.7", "an index from 0 to 0"),
        ("plant.parts.0.mass", "there is no list `plant.parts`: set the whole list; `plant` has "),
    ],
)
def test_a_place_where_no_value_can_stand(path: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        replaced(parse(EXAMPLE, "c.yaml"), path, 1.0)
    assert words in str(caught.value)


@pytest.mark.costly
@given(
    st.lists(
        st.sampled_from(["time", "end", "observers", "FHGO r=2", ".", "=", "0", " ", "{a: 1}", "é"]),
        max_size=9,
    )
)
@settings(max_examples=200)
def test_any_assignment_is_carried_out_or_refused(pieces: list[str]) -> None:
    try:
        source = set_path(parse(EXAMPLE, "c.yaml"), "".join(pieces))
    except ConfigError:
        return
    assert set(source.positions) == {path for path, _ in walk(source.data)}


# extends


def test_merge() -> None:
    base = parse("a: 1\nb: {c: 2, d: [1, 2]}\nplant: {type: contois, k: 1}\no: {A: {type: shgo, theta: 1}}", "base")
    over = parse("\n\n\n\nb:\n  d: [3]\n  e: 4\nplant:\n  type: duffing\no: {A: {theta: 2}, B: {type: x}}", "over")
    both = merge(base, over)
    assert both.data == {
        "a": 1,
        "b": {"c": 2, "d": [3], "e": 4},
        "plant": {"type": "duffing"},
        "o": {"A": {"type": "shgo", "theta": 2}, "B": {"type": "x"}},
    }
    assert list(both.data) == ["a", "b", "plant", "o"]
    assert set(both.positions) == {path for path, _ in walk(both.data)}
    assert both.where(("a",)) == ("base", 1)
    assert both.where(("b",)) == ("over", 5)
    assert both.where(("b", "c")) == ("base", 2)
    assert both.where(("b", "d", 0)) == ("over", 6)
    assert both.where(("o", "A", "type")) == ("base", 4)


@pytest.mark.parametrize(
    ("base", "over", "result"),
    [
        ("a: {b: 1}", "a: 2", {"a": 2}),
        ("a: 1", "a: {b: 2}", {"a": {"b": 2}}),
        ("a: {b: 1}", "a:", {"a": None}),
        ("a: {type: x, b: 1}", "a: {type: x, c: 2}", {"a": {"type": "x", "b": 1, "c": 2}}),
        ("a: {b: 1}", "a: {type: x}", {"a": {"b": 1, "type": "x"}}),
        ("[1]", "[2, 3]", [2, 3]),
    ],
)
def test_merge_of_unlike_things(base: str, over: str, result: object) -> None:
    assert merge(parse(base, "base"), parse(over, "over")).data == result


def test_merge_with_itself_changes_nothing() -> None:
    source = parse(EXAMPLE, "c.yaml")
    assert merge(source, source) == source


@pytest.mark.parametrize(
    ("assignment", "key"),
    [
        ("observers.N.alpha=[1, 2, 0.5]", "observers.N.alpha"),
        ("time.end=-1", "time.end"),
        ("metrics.window=[2, 1]", "metrics.window"),
        ("solver={rtol: 1e-6, method: rk4}", "solver.method"),
    ],
)
def test_what_a_whole_block_refuses_is_told_where_the_key_was_set(tmp_path: Path, assignment: str, key: str) -> None:
    config = {
        "time": {"end": 1, "output_step": 0.1},
        "plant": {"type": "integrator_chain", "n": 2, "initial": {"x1": 1, "x2": 0}},
        "observers": {"N": {"type": "neso", "omega_o": 4, "delta": 1, "alpha": [1, 0.5, 0.25]}},
        "metrics": {"window": [0.5, 1]},
    }
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, config, assignment)
    assert caught.value.file == f"--set {assignment}"
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("assignment", "meant"),
    [
        ("SHGO.theta=3", "observers.SHGO.theta"),
        ("SHGO.new.key=3", "observers.SHGO.new.key"),
        ("theta=3", "observers.SHGO.theta"),
        ("shgo.Theta=3", "observers.SHGO.theta"),
        ("poles[1]=3", "observers.SHGO.poles.1"),
        ("observers.SHGO.poles[1]=3", "observers.SHGO.poles.1"),
        ("observers['SHGO']['theta']=3", "observers.SHGO.theta"),
        ("observers.*.poles[1]=3", "observers.SHGO.poles.1"),
    ],
)
def test_the_end_of_a_path_is_no_path(assignment: str, meant: str) -> None:
    text = "{observers: {SHGO: {type: shgo, theta: 2, poles: [-1, -2]}}, tune: {gains: {theta: {log: [1, 2]}}}}"
    source = parse(text, "c.yaml")
    with pytest.raises(ConfigError, match=re.escape(f"Did you mean `{meant}`?")) as caught:
        set_path(source, assignment)
    assert caught.value.file == f"--set {assignment}"
    if "*" not in assignment:
        with pytest.raises(ConfigError, match=re.escape(f"Did you mean `{meant}`?")) as caught:
            replaced(source, assignment.partition("=")[0], 3)
        assert caught.value.key == assignment.partition("=")[0]


@pytest.mark.parametrize(
    ("path", "meant"),
    [
        ('observers."[7] HGO".theta', "observers.[7] HGO.theta"),
        ("observers['[7] HGO'].theta", "observers.[7] HGO.theta"),
        ('observers["H[1]"].theta', "observers.H[1].theta"),
        ("observers[S].theta", "observers.S.theta"),
        ("observers['S'].theta", "observers.S.theta"),
        ("observers.'S'.theta", "observers.S.theta"),
        ("measurement.noise[0].std", "measurement.noise.0.std"),
        ("measurement['noise'][0]['std']", "measurement.noise.0.std"),
    ],
)
def test_a_path_with_brackets_or_quotes_is_told_without(path: str, meant: str) -> None:
    """What is proposed is there, also where a label itself has brackets."""
    text = "observers: {'[7] HGO': {theta: 2}, S: {theta: 2}, 'H[1]': {theta: 2}}\nmeasurement: {noise: [{std: 1}]}"
    with pytest.raises(ConfigError, match=re.escape(f"not in brackets or quotes. Did you mean `{meant}`?")):
        set_path(parse(text, "f.yaml"), f"{path}=3")
    assert set_path(parse(text, "f.yaml"), f"{meant}=3").data != parse(text, "f.yaml").data


@pytest.mark.parametrize("label", ["[8] HGO", "S [1]", "'S"])
def test_brackets_of_a_new_label_are_its_own(label: str) -> None:
    assert set_path(parse("observers: {S: {theta: 2}}", "f.yaml"), f"observers.{label}.theta=3").data["observers"] == {
        "S": {"theta": 2},
        label: {"theta": 3},
    }


def test_a_text_in_place_of_a_list_of_changes(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(EXAMPLE)
    with pytest.raises(ConfigError, match=r"overrides: expected a list, such as \['seed=2'\], found the text 'seed=2'"):
        read_source(tmp_path / "a.yaml", "seed=2")
