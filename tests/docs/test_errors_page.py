"""The page of messages: what it explains can be said, and nothing that can be said is missing in the list."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import get_args

import pytest
from examples import chain, experiment
from site_messages import GAP, messages, messages_page, template

import hgorun
import hgorun.errors
from hgorun.errors import HgorunError
from hgorun.result.status import Status

PAGE = (Path(__file__).parents[2] / "docs" / "errors.md").read_text(encoding="utf-8")
EXPLAINED = re.findall(r"^\| `(.*?)` \| .* \| .* \|$", PAGE.split("## Texts and numbers")[1], re.MULTILINE)
FROM_OTHERS = "observer '…': design raised …"  # assembled where a method is called


def words(text: str) -> list[str]:
    """What is between the gaps; Markdown has no backquotes inside backquotes."""
    return [part.strip() for part in re.split(rf"{GAP}+", text.replace("`", "")) if part.strip(" .:")]


KNOWN = [words(message.text) for message in messages()]


@pytest.mark.parametrize("text", [text for text in EXPLAINED if text != FROM_OTHERS])
def test_what_is_explained_can_be_said(text: str) -> None:
    """As a message of the source, whole or its beginning."""
    own = words(text)
    assert any(all(any(part in other for other in known) for part in own) for known in KNOWN)


def test_every_status_and_every_exception_is_explained() -> None:
    for status in get_args(Status):
        assert f"| `{status}` |" in PAGE
    own = {n for n, cls in inspect.getmembers(hgorun.errors, inspect.isclass) if cls.__module__ == "hgorun.errors"}
    for name in own - {HgorunError.__name__, "Problem"}:  # the base, and one that users never see
        assert f"| `{name}` |" in PAGE


def test_the_list_has_what_a_configuration_raises() -> None:
    """Messages of configurations that are wrong in some way are among those of the source."""
    listed = messages_page()
    for wrong, expected in (
        ({"observers.S.initial": {"x9": 1}}, "unknown state"),
        ({"metrics.window": [3, 99]}, "reaches outside the run, which lasts from"),
        ({"measurement.delay": -1}, "the delay must be a number"),
    ):
        with pytest.raises(HgorunError, match=expected):
            hgorun.simulate(experiment(plant=chain(2), observers={"S": {"type": "shgo", "theta": 2}}).varied(wrong))
        assert expected in listed


def test_texts_of_the_source_are_read_with_gaps() -> None:
    import ast

    for source, expected in (('"a"', "a"), ('f"a {b} c"', "a … c"), ('"a" + b + f"{c}d"', "a……d"), ("b", "")):
        assert template(ast.parse(source, mode="eval").body) == expected
