"""A page as the steps that its reader takes: files to write, commands to give, Python to run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

_FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$\n?", re.DOTALL | re.MULTILINE)
_NAME = re.compile(r"# ([\w./-]+\.(?:yaml|py|toml))\n")
_COMMANDS = re.compile(r"(?:^ {4}\S.*\n)(?:^ {4}.*\n|^\n(?= {4}))*", re.MULTILINE)
_PROGRAMS = ("hgorun ", "python ", "pip ", "pytest")


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes
    ----------
    kind : {"text", "file", "command", "python", "other"}
        What a reader reads, writes, types into a terminal, runs in Python, or only looks at.
    text : str
    name : str
        Of the file.
    shown : str
        What the page says that it prints; empty where it says nothing.
    """

    kind: Literal["text", "file", "command", "python", "other"]
    text: str
    name: str = ""
    shown: str = ""


def steps(page: str) -> list[Step]:
    """The steps of a page of Markdown, in their order.

    A block whose first line is a comment with a name is a file. A block of Python may be followed by a block
    ``text``, with what it prints. Indented lines are commands; lines below one that begins with ``$`` are its output.
    """
    found: list[Step] = []
    place = 0
    for fence in _FENCE.finditer(page):
        found += _without_fences(page[place : fence.start()])
        place = fence.end()
        step = _of_block(fence[1], fence[2], fence[0])
        last = found[-1] if found else None
        if fence[1] == "text" and last is not None and last.kind == "python":
            found[-1] = Step("python", last.text, shown=fence[2])
        else:
            found.append(step)
    return found + list(_without_fences(page[place:]))


def _of_block(language: str, text: str, whole: str) -> Step:
    named = _NAME.match(text)
    if named:
        return Step("file", text, named[1])
    return Step("python", text) if language == "python" else Step("other", whole)


def _without_fences(text: str) -> Iterator[Step]:
    place = 0
    for block in _COMMANDS.finditer(text):
        before = text[: block.start()]
        lines = [line[4:] for line in block[0].rstrip("\n").split("\n")]
        if (before.strip("\n") and not before.endswith("\n\n")) or not lines[0].removeprefix("$ ").startswith(
            _PROGRAMS
        ):
            continue  # the continuation of a list, or something that is only shown
        if text[place : block.start()].strip():
            yield Step("text", text[place : block.start()].strip("\n"))
        place = block.end()
        yield from _commands(lines)
    if text[place:].strip():
        yield Step("text", text[place:].strip("\n"))


def _commands(lines: list[str]) -> Iterator[Step]:
    if not lines[0].startswith("$ "):
        yield from (Step("command", line) for line in lines if line.strip())
        return
    for part in re.split(r"^\$ ", "\n".join(lines), flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        yield Step("command", command, shown=shown.strip("\n"))
