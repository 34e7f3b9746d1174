"""The page of messages: each message of the source stands below an explanation, and what is explained can be said."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from typing import get_args

import pytest
import typer
from examples import chain, experiment
from site_messages import Message, by_mark, fits, marks, messages
from site_sources import Source, template

import hgorun
import hgorun.errors
from hgorun.cli import app
from hgorun.errors import HgorunError
from hgorun.result.records.status import Status

PAGE = (Path(__file__).parents[2] / "docs" / "errors.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^### (.*?)\n(.*?)(?=^##|\Z)", PAGE, re.DOTALL | re.MULTILINE))


@pytest.mark.slow
@pytest.mark.unmeasured
def test_every_message_of_the_source_stands_below_an_explanation() -> None:
    """A new one without a kind is shown here: its words go into a block of docs/errors.md, or it gets a section."""
    assert len(messages()) > 1000
    assert by_mark(PAGE, messages())[""] == []


@pytest.mark.unmeasured
def test_every_line_of_the_page_is_of_some_message_and_stands_once() -> None:
    lines = [line for block in marks(PAGE) for line in block]
    assert sorted(set(lines)) == sorted(lines)
    assert [line for line, found in by_mark(PAGE, messages()).items() if line and not found] == []


def test_every_section_explains_gives_an_example_and_has_messages() -> None:
    assert len(SECTIONS) > 70
    for title, text in SECTIONS.items():
        explained, example = text.split("```")[0].strip().split("\n\nExample: ")
        assert len(explained) > 80, title
        assert len(example) > 20, title
        assert len(marks(text)) == 1, title


def test_commands_of_examples_have_the_options_that_they_show() -> None:
    known = vars(typer.main.get_command(app))["commands"]
    found = re.findall(r"`(?:\w+=\w+ )?hgorun ([^`]*)`", PAGE)
    assert len(found) > 15
    for words in map(str.split, found):
        if words[0].isupper():
            continue  # any command
        options = {option for parameter in known[words[0]].params for option in parameter.opts}
        assert {word for word in words if word.startswith("--")} <= options | {"--help"}, words


def test_every_status_and_every_exception_is_explained() -> None:
    for status in get_args(Status):
        assert f"| `{status}` |" in PAGE
    own = {n for n, cls in inspect.getmembers(hgorun.errors, inspect.isclass) if cls.__module__ == "hgorun.errors"}
    for name in own - {HgorunError.__name__, "Problem"}:  # the base, and one that users never see
        assert f"| `{name}` |" in PAGE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "section"),
    [
        ({"observers.S.initial": {"x9": 1}}, "Names that nothing has"),
        ({"observers.S.thetta": 1}, "An unknown key, or one that is missing"),
        ({"observers.S.theta": "two"}, "A name or function that is not known"),
        ({"observers.S.poles": 1}, "Poles and stability of the gain"),
        ({"metrics.window": [3, 99]}, "Windows and grids"),
        ({"measurement.delay": -1}, "Sampling, delays and phases"),
        ({"time.output_step": [1]}, "A value of another kind"),
        ({"plant.phi": "x1 +"}, "Something missing, or a parenthesis"),
    ],
)
def test_what_a_configuration_raises_is_found_below_its_kind(wrong: dict[str, object], section: str) -> None:
    """With names and numbers in the gaps: messages are read from the source as they are given."""
    with pytest.raises(HgorunError) as caught:
        hgorun.simulate(experiment(plant=chain(2), observers={"S": {"type": "shgo", "theta": 2}}).varied(wrong))
    said = str(caught.value)
    found = by_mark(PAGE, [m for m in messages() if re.search(as_pattern(m.text), said)])
    assert any(found[line] for block in marks(SECTIONS[section]) for line in block), said


def as_pattern(text: str) -> str:
    return ".*".join(map(re.escape, re.split("…+", text)))


def test_a_line_with_a_room_comes_first_then_the_longest() -> None:
    page = "```{said}\nis wrong\n```\n\n```{said}\na| is\nis\n```\n"
    one, other = Message("it is wrong", "a"), Message("it is wrong", "b")
    assert by_mark(page, [one, other, Message("no", "a")]) == {
        "a| is": [one],
        "is wrong": [other],
        "is": [],
        "": [Message("no", "a")],
    }
    assert not fits("b| is", one)


def test_texts_of_the_source_are_read_with_gaps() -> None:
    for source, expected in (
        ('"a"', "a"),
        ('f"a {b} c"', "a … c"),
        ('"a" + b + f"{c}d"', "a……d"),
        ('"a {} {x}".format(1, x=2)', "a … …"),
        ("b", ""),
    ):
        assert template(ast.parse(source, mode="eval").body) == expected


def test_texts_are_followed_through_names_choices_and_calls(tmp_path: Path) -> None:
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "a.py").write_text(
        'TOP = "at the top"\n'
        "class A:\n    why = 'of a class'\n"
        "def made(x) -> str:\n    return 'made of it' if x else f'{x} is bad'\n"
        "def both() -> tuple[str, int]:\n    return {1: TOP}.get(2, 'or else'), 1\n"
        "def f(x):\n"
        "    said, line = both()\n"
        "    raise E(said)\n"
        "    raise E(made(x) or x.why)\n"
        "    raise E(TOP.format(x), 'key', x)\n"
    )
    source = Source(tmp_path)
    found = [
        [text for argument in call.args for text in source.texts(argument, inside, tree)]
        for room, call, inside, tree in source.calls()
        if ast.unparse(call.func) == "E" and room == "room"
    ]
    assert found == [["at the top", "or else"], ["made of it", "… is bad", "of a class"], ["at the top"]]
