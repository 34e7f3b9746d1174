"""All messages that hgorun can give, read from its source, each below the explanation of its kind.

The page errors.md explains kinds. A block ``{said}`` of it holds what messages of a kind have in common, a line each: a
part of the message, or ``room| part`` where it means something else in other rooms of the program. Of the lines that
fit, one with a room decides, then the longest, so that the order of the page does not matter. On the site the block
becomes the messages themselves.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from docutils import nodes
from site_sources import GAP, Source, name_of
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import hgorun

PACKAGE = Path(hgorun.__file__).parent
# The exceptions whose message a user reads; those of Python, which a validator of a block turns into one; reasons of
# the analysis; methods that raise one of them with a place.
SAYING = frozenset(
    (
        *("ConfigError", "ExpressionError", "HgorunError", "NotObservableForm", "PlantDiverged", "PluginError"),
        *("Problem", "SimulationError", "ValueError", "TypeError", "Changed", "Damaged", "PydanticCustomError"),
        *("NoValue", "NotApplicable"),
        *("error", "_error", "_fail", "_wrong", "wrong"),
    )
)
LAW = "Broken"  # found and expected
SENTENCES = ("sentence_of", "_too_few")  # functions that word what pydantic has found, in the room config
_BLOCK = re.compile(r"^```\{said\}\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NAMED = re.compile(r"\{\w+\}")  # what pydantic puts in


@dataclass(frozen=True, order=True)
class Message:
    """A message as it stands in the source.

    Attributes
    ----------
    text : str
        With a sign in place of what is known only when it is given.
    room : str
        The package that gives it: ``config``.
    """

    text: str
    room: str


@cache
def messages(package: Path = PACKAGE) -> tuple[Message, ...]:
    """All messages of a package, in the order of the alphabet."""
    source = Source(package)
    found: set[Message] = set()
    for room, call, inside, tree in source.calls():
        name = name_of(call.func)
        if name == LAW and len(call.args) == 2:
            parts = [(source.texts(argument, inside, tree) or [GAP])[0] for argument in call.args]
            found.add(Message("found {}; expected {}".format(*parts), room))
        elif name in SAYING:
            texts = (text for argument in call.args for text in source.texts(argument, inside, tree))
            found |= {Message(_NAMED.sub(GAP, text) if name.startswith("Pydantic") else text, room) for text in texts}
    found |= {Message(text, "config") for name in SENTENCES for text in source.returned(name)}
    return tuple(sorted(found))


def marks(page: str) -> list[list[str]]:
    """The lines of every block of a page, in their order."""
    return [block.split("\n")[:-1] for block in _BLOCK.findall(page)]


def fits(mark: str, message: Message) -> bool:
    """Whether a line of a block is part of a message."""
    room, part = _parted(mark)
    return part in message.text and room in ("", message.room)


def _parted(mark: str) -> tuple[str, str]:
    room, bar, part = mark.partition("|")
    return (room, part.strip()) if bar and room.isidentifier() else ("", mark)


def by_mark(page: str, said: Iterable[Message]) -> Mapping[str, list[Message]]:
    """Messages by the line that decides about them; those without one by an empty text."""
    lines = sorted((line for block in marks(page) for line in block), key=_weight, reverse=True)
    found: dict[str, list[Message]] = {line: [] for line in (*lines, "")}
    for message in said:
        found[next((line for line in lines if fits(line, message)), "")].append(message)
    return found


def _weight(mark: str) -> tuple[bool, int]:
    room, part = _parted(mark)
    return bool(room), len(part)


class Said(SphinxDirective):
    """The messages of a kind, as a list."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        page = Path(self.env.doc2path(self.env.docname)).read_text(encoding="utf-8")
        found = by_mark(page, messages())
        texts = dict.fromkeys(message.text for line in self.content for message in found[line])
        entries = [nodes.list_item("", nodes.paragraph("", "", nodes.Text(text))) for text in sorted(texts)]
        return [nodes.bullet_list("", *entries, classes=["said"])]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("said", Said)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
