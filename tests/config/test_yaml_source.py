"""YAML text as data with positions: the rules, the limits, and that nothing but ConfigError comes out."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from written import EXAMPLE

from hgorun.config import yaml_source
from hgorun.config.paths import walk
from hgorun.config.yaml_source import Source, parse, read
from hgorun.errors import ConfigError

PARSERS = [yaml_source._PythonLoader, *([yaml.CBaseLoader] if hasattr(yaml, "CBaseLoader") else [])]


@pytest.fixture(params=PARSERS, ids=lambda loader: loader.__name__)
def parser(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(yaml_source, "_LOADER", request.param)


def data(text: str) -> Any:
    return parse(text, "f.yaml").data


def refusal(text: str) -> ConfigError:
    with pytest.raises(ConfigError) as caught:
        parse(text, "f.yaml")
    assert "\n" not in str(caught.value)
    return caught.value


def with_parser(loader: Any, text: str) -> Source | None:
    saved, yaml_source._LOADER = yaml_source._LOADER, loader
    try:
        return parse(text, "f.yaml")
    except ConfigError:
        return None
    finally:
        yaml_source._LOADER = saved


# Scalars


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[("1e-3", 1e-3), ("1.0e-3", 1e-3), (".5", 0.5), ("5.", 5.0), ("1e5", 1e5), ("-.5E+2", -50.0)],
        *[
            ("+1", 1),
            ("-0", 0),
            ("017", 17),
            ("0", 0),
            ("+1.5", 1.5),
            ("12345678901234567890", 12345678901234567890),
        ],
        *[(".inf", math.inf), ("-.INF", -math.inf), ("+.Inf", math.inf)],
        *[("true", True), ("True", True), ("FALSE", False), ("false", False)],
        *[("null", None), ("Null", None), ("NULL", None), ("~", None), ("", None)],
        *[(text, text) for text in ("yes", "no", "on", "off", "Yes", "y", "n", "tRue", "nULL", "inf", "nan", ".iNf")],
        *[(text, text) for text in ("0o17", "0x1F", "1:30", "1_000", "1:30:00", "2020-01-01", ".", "e5", "1e")],
        *[(text, text) for text in ("1 2", "1.2.3", "+-1", "1e+", "=", "-1+2j", "x1*x2/(k_c + x1)", "٣", "1e5.0")],
        *[
            ('"1"', "1"),
            ("'true'", "true"),
            ('"~"', "~"),
            ("''", ""),
            ('"a\\tb"', "a\tb"),
            ("'it''s'", "it's"),
        ],
        *[("|\n    a\n    1", "a\n1"), (">\n    1\n", "1\n"), ("a\n    b", "a b")],
    ],
)
def test_scalars_follow_the_core_schema(text: str, value: object) -> None:
    found = data(f"key: {text}")["key"]
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize("text", [".nan", ".NaN", ".NAN"])
def test_nan_is_a_float(text: str) -> None:
    assert math.isnan(data(text))


def test_a_number_too_long_for_python_is_refused() -> None:
    assert "5000 characters" in str(refusal("a: " + "1" * 5000))
    assert data("a: " + "1" * 300) == {"a": int("1" * 300)}
    assert "1e400 is larger than any number" in str(refusal("a: 1e400"))


@pytest.mark.usefixtures("parser")
def test_keys_are_their_source_text() -> None:
    text = "{1: a, 1.50: b, true: c, ~: d, 'x y': e, 0x1: f, '': g, no: h}"
    assert list(data(text)) == ["1", "1.50", "true", "~", "x y", "0x1", "", "no"]


# Structure and positions


@pytest.mark.usefixtures("parser")
def test_positions_are_the_lines_of_the_keys() -> None:
    source = parse(EXAMPLE, "c.yaml")
    assert source.where(("plant", "initial", "x2")) == ("c.yaml", 7)
    assert source.where(("plant", "initial")) == ("c.yaml", 5)
    assert source.where(("measurement", "noise", 0)) == ("c.yaml", 10)
    assert source.where(("measurement", "noise", 0, "terms", 1, "omega")) == ("c.yaml", 12)
    assert source.where(("observers", "FHGO r=2", "r")) == ("c.yaml", 15)
    assert source.where(()) == ("c.yaml", 1)
    assert source.data["disturbance"] is None
    assert source.data["measurement"]["noise"][0]["terms"][1] == {"amplitude": 0.5, "omega": 12.189}


def test_where_falls_back_to_what_is_around() -> None:
    source = parse(EXAMPLE, "c.yaml")
    assert source.where(("plant", "initial", "x3", "deeper")) == ("c.yaml", 5)
    assert source.where(("nothing",)) == ("c.yaml", 1)
    assert Source({"a": 1}, {}).where(("a",)) == ("", 0)


@pytest.mark.usefixtures("parser")
def test_every_value_has_a_position() -> None:
    source = parse(EXAMPLE, "c.yaml")
    assert set(source.positions) == {path for path, _ in walk(source.data)}


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize("text", ["a: 1\r\nb: 2\r\n", "\ufeffa: 1\nb: 2", "---\na: 1\nb: 2\n...\n", "a: 1\rb: 2"])
def test_line_ends_marks_and_document_signs(text: str) -> None:
    source = parse(text, "f")
    assert source.data == {"a": 1, "b": 2}
    assert source.where(("b",))[1] - source.where(("a",))[1] == 1


@pytest.mark.usefixtures("parser")
def test_tabs_may_separate() -> None:
    assert data("a:\t1\t# comment\nb: [1,\t2]\nc: 'x\ty'\nd: 4") == {"a": 1, "b": [1, 2], "c": "x\ty", "d": 4}


@pytest.mark.usefixtures("parser")
def test_aliases_are_written_out() -> None:
    source = parse("a: &a\n  x: [1, 2]\n  y: &y 3\nb: *a\nc: [*y, *a]\n", "f")
    assert source.data["b"] == source.data["c"][1] == source.data["a"] == {"x": [1, 2], "y": 3}
    assert source.data["b"] is not source.data["a"]
    assert source.where(("b",)) == ("f", 4)
    assert source.where(("b", "x", 1)) == ("f", 2)
    assert source.where(("c", 0)) == ("f", 5)
    assert source.where(("c", 1, "y")) == ("f", 3)
    assert data("{a: &e , b: *e}") == {"a": None, "b": None}


@pytest.mark.costly
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text("ab: #-'\"{é\n", max_size=8),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc =", max_size=4), inner, max_size=3),
        max_leaves=12,
    ),
    st.booleans(),
)
@settings(max_examples=150)
def test_what_pyyaml_writes_is_read_back_by_both_parsers(value: Any, flow: bool) -> None:
    text = yaml.safe_dump({"root": value}, default_flow_style=flow, allow_unicode=True)
    if "? " in text:  # long or odd keys
        text = yaml.safe_dump({"root": value}, default_flow_style=True, width=1e9)
    text = "\n".join(line for line in text.splitlines())
    sources = [with_parser(loader, text) for loader in PARSERS]
    assert sources[0] is not None
    assert all(source == sources[0] for source in sources)
    assert sources[0].data == {"root": value}


# What is refused


def _parse_without_words(text: str, Loader: Any, parse: Any = yaml.parse) -> Iterator[yaml.Event]:
    try:
        yield from parse(text, Loader=Loader)
    except yaml.MarkedYAMLError as error:
        raise type(error)("words", error.context_mark, "more words", error.problem_mark) from error


def test_a_tab_inside_plain_text_is_refused() -> None:
    assert all(with_parser(loader, "a: x\ty") is None for loader in PARSERS)
    assert with_parser(PARSERS[-1], "a: 'x\ty'") is not None


@pytest.mark.usefixtures("parser")
@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", None, "empty"),
        ("# only a comment\n", None, "empty"),
        ("---\n", None, "empty"),
        ("a: 1\nb:\n  c: 1\n  d: 2\n  c: 3\n", 5, "b.c: `c` is given twice, on line 3 and on line 5"),
        ("a: {std: 1, std: 2}\n", 1, "a.std: `std` is given twice on line 1"),
        ("a: {column: level [m]}\n", 1, "text with a bracket or a comma needs quotes"),
        ("a:\n  b: [x, level {m}]\n", 2, "text with a bracket or a comma needs quotes"),
        ("1: a\n'1': b\n", 2, "given twice"),
        ("a: !!python/object/apply:os.system [ls]", 1, "tag"),
        ("a: !foo 1", 1, "tag `!foo`"),
        ("\na: !!str 1", 2, "tag"),
        ("a: ! x", 1, "tag"),
        ("!!map {a: 1}", 1, "tag"),
        ("a: 1\n--- \nb: 2", 2, "second document"),
        ("a: 1\n...\n---\nb: 2", 3, "second document"),
        ("a: &x {b: 1}\nc:\n  <<: *x\n  d: 1", 3, "extends"),
        ("? [a, b]\n: 1", 1, "key is text"),
        ("{{a: 1}: 2}", 1, "key is text"),
        ("&a b: 1", 1, "anchor"),
        ("a: &x k\n*x : 1", 2, "alias"),
        ("? \n: 1", 1, "no key"),
        ("a: &x [1, *x]", 1, "inside its own anchor"),
        ("&x [*x]", 1, "inside its own anchor"),
        ("&x {a: {b: *x}}", 1, "a.b: the alias"),
        ("a: *x", 1, "no `&x`"),
        ("dynamics:\n  x1: *x2 + 1", 2, "needs quotes"),
        ("a: &x 1\nb: &x 2", 2, "given twice"),
        ("a: 1\n\tb: 2", 2, "a tab cannot indent: use spaces"),
        ("a:\n\tb: 2", 2, "use spaces"),
        ("a: 1\n\t\nb: 2", 2, "use spaces"),
        ("a: b: c", 1, "needs quotes"),
        ("a: [1, 2\nb: 3\n", 2, "opened on line 1"),
        ("a: {b: 1", 1, "opened on line 1"),
        ("a: 1\nb: 'x\n", 2, "opened on line 2"),
        ('a: "\\q"', 1, "single quotes"),
        ("a: @x", 1, "`@`"),
        ("a: `x`", 1, "quotes"),
        ("a: 1\nb\nc: 2", 2, "no `:` after its key"),
        ("a: 1\n  b: 2", 2, "indentation"),
        ("a:\n  b: 1\n c: 2", 3, "indentation"),
        ("a: - 1", 1, "line of its own"),
        ("a: {b: - 1}", 1, "write a sign without it"),
        ("a:\n  b: {c: 1, d: - +x}", 2, "write a sign without it"),
        ("a: 1\n- b", 2, "indentation"),
        ("a: | text", 1, "the line must end"),
        ("a: }", 1, "brackets"),
        ("a: 'x' y", 1, "quotes"),
        ("a: b\nc: \x07", 2, "U+0007"),
        ("a\x00b", 1, "U+0000"),
        ("a: 1\n\nb: \u2028", 3, "U+2028"),
        ("a: \ud800", 1, "U+D800"),
        ("a: 1\n\ufeffb: 2", 2, "U+FEFF"),
        ("a: ? b", 1, "cannot start with `?`"),
        ("a: 1\n'x'\nb: 2", 2, "no `:` after its key"),
        ("a: 1\n*x\nb: 2", 2, "no `:` after its key"),
        ("a: 1\n" + "k" * 2000 + ": 1", 2, "no `:` after its key"),
        ("a: *", 1, "needs quotes"),
        ("a: !a!b c", 1, "tags"),
        ("a: !<b", 1, "tags"),
        ('a: "\\q', 1, "single quotes"),
        ('a: "\\xg"', 1, "single quotes"),
        ("a: 'x\n---\nb: 1", 1, "opened on line 1"),
        ("%YAML 3.0\n---\na: 1", 1, "starts with `%` needs quotes"),
        ("%H:%M", 1, 'needs quotes, as in "%H:%M"'),
        ("%Y-%m-%d %H:%M", 1, 'needs quotes, as in "%H:%M"'),
        ("a: 1\nb: [\n\n", 2, "opened on line 2"),
        ("a: [1,\n  {b: 1 c: 2},\n]", 2, "opened on line 2"),
        ("a: [1]]", 1, "brackets"),
        ("- 1\nb: 2", 2, "indentation"),
    ],
)
@pytest.mark.parametrize("wordless", [False, True], ids=["", "wordless"])
def test_refusals_name_the_line_and_the_matter(
    text: str, line: int | None, words: str, wordless: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if wordless:  # another version of a library says the same in other words
        monkeypatch.setattr(yaml, "parse", _parse_without_words)
    error = refusal(text)
    assert words in str(error)
    assert error.line == line
    assert error.file == "f.yaml"


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="without libyaml it is a key without a value")
def test_a_key_in_braces_without_a_value_is_named() -> None:
    assert "`b:` has no value" in str(refusal("a: {c: 1, b:, d: 2}"))


def test_files_are_alike_by_their_stems(tmp_path: Path) -> None:
    """That two names end in the same suffix makes them not alike."""
    for name in ("no_time.yaml", "plant.csv", "plant.yaml"):
        (tmp_path / name).write_text("a: 1")
    for missing, words in {
        "nothere.yaml": "there is no such file",
        "no_tme.yml": "Did you mean `no_time.yaml`?",
        "plant": "Did you mean `plant.yaml`?",
    }.items():
        with pytest.raises(ConfigError) as refused:
            read(tmp_path / missing)
        assert refused.value.message.endswith(words)


@pytest.mark.usefixtures("parser")
def test_depth_is_bounded() -> None:
    assert data("[" * 50 + "]" * 50)
    assert data("[" * 50 + "1" + "]" * 50)
    for text in (
        "[" * 52 + "]" * 52,
        "[" * 100_000,
        "{a: " * 100_000,
        "- " * 100_000,
        "a:\n" + " " * 9 + "- " * 60,
    ):
        assert "50" in str(refusal(text))
    assert "50" in str(refusal("\n".join(" " * i + "a:" for i in range(2000))))
    assert refusal("# ]]]\n" + "a: 1\nb: " + "[" * 2000).line == 3
    assert data("a: '" + "[" * 400 + "'")


@pytest.mark.usefixtures("parser")
def test_depth_counts_through_aliases() -> None:
    text = "a0: &a0 1\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 60))
    assert "50" in str(refusal(text))


@pytest.mark.slow
def test_the_number_of_values_is_bounded() -> None:
    assert len(data("[" + "1," * 99_999 + "]")) == 99_999
    assert "100,000" in str(refusal("[" + "1," * 100_000 + "]"))


@pytest.mark.costly
@pytest.mark.usefixtures("parser")
def test_a_billion_laughs_is_refused_soon() -> None:
    text = "a0: &a0 [x,x,x,x,x,x,x,x,x]\n"
    text += "".join(f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 40))
    start = time.process_time()
    assert "aliases written out" in str(refusal(text))
    assert time.process_time() - start < 5


def test_messages_stay_short() -> None:
    long = "k" * 500_000
    for text in (f"a: !{long}", f"a: *{long}", f"? {long}\n: 1\n? {long}\n: 2"):
        assert len(str(refusal(text))) < 600


YAML_PIECES = [
    *["a", "b: ", "- ", "? ", ": ", "[", "]", "{", "}", ",", "\n", "\n  ", '"', "'", "1", " #", "&a "],
    *["*a", "!t ", "|", ">", "|\n  ", "---\n", "...\n", "%YAML 1.2\n", "@", "`", "\t", " ", "-", "?"],
    *[":", "é", "\r\n", "\r", "~", "a: 1\n", "  c: 2\n", "- 1\n", "\\", '"q"', "<<: ", "\ufeff", "\x00"],
    *["\x85", "\ud800", "😀", "1e5", ".inf"],
]


@pytest.mark.costly
@given(st.text(max_size=60) | st.lists(st.sampled_from(YAML_PIECES), max_size=14).map("".join))
@settings(max_examples=600)
def test_any_text_is_data_or_a_config_error_with_either_parser(text: str) -> None:
    sources = [with_parser(loader, text) for loader in PARSERS]
    accepted = [source for source in sources if source is not None]
    # The parsers differ in what they let pass (odd uses of ?, tabs and directives), not in what it means.
    assert all(source == accepted[0] or "nan" in repr(source.data) for source in accepted)
    if not any(sign in text for sign in "?\t%>|"):
        assert len(accepted) in (0, len(sources))
    for source in accepted:
        assert set(source.positions) == {path for path, _ in walk(source.data)}
        assert source.data is None or isinstance(source.data, (dict, list, str, int, float))


@pytest.mark.costly
def test_it_imports_yaml_and_no_other_library() -> None:
    code = "import sys, hgorun.config.yaml_source; print(*{m.split('.')[0] for m in sys.modules})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "yaml" in run.stdout.split()
    assert not {"numpy", "casadi", "pydantic", "scipy", "sympy"} & set(run.stdout.split())


# Files


def test_read_gives_the_text_verbatim(tmp_path: Path) -> None:
    path = tmp_path / "c.yaml"
    content = "\ufeff# é\r\na: 1\r\n"
    path.write_bytes(content.encode())
    text, source = read(path)
    assert text == content
    assert source.data == {"a": 1}
    assert source.where(("a",)) == (str(path), 2)


def test_read_refuses_what_is_no_text_file(tmp_path: Path) -> None:
    (tmp_path / "contois.yaml").write_text("a: 1")
    (tmp_path / "latin.yaml").write_bytes(b"a: 1\nb: caf\xe9\n")
    (tmp_path / "large.yaml").write_bytes("é".encode() * (2**19) + b"\n")
    (tmp_path / "limit.yaml").write_bytes(b"a: 1\n" + b"#" * (2**20 - 5))
    for name, words in [
        ("contoi.yaml", "there is no such file. Did you mean `contois.yaml`?"),
        ("none/at/all.yaml", "no such file"),
        ("contois.yaml/x", "cannot be read"),
        ("", "folder"),
        ("latin.yaml", "latin.yaml:2: byte 0xe9 is not UTF-8"),
        ("large.yaml", "1 MiB"),
        ("nul\0", "cannot be read"),
        ("long" * 100, "cannot be read"),
    ]:
        with pytest.raises(ConfigError) as caught:
            read(tmp_path / name)
        assert words in str(caught.value)
    assert read(tmp_path / "limit.yaml")[1].data == {"a": 1}


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root reads everything")
def test_read_refuses_an_unreadable_file(tmp_path: Path) -> None:
    path = tmp_path / "secret.yaml"
    path.write_text("a: 1")
    path.chmod(0)
    with pytest.raises(ConfigError, match="cannot be read: Permission denied"):
        read(path)
