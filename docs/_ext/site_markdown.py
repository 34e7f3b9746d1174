"""Docstrings and keys as Markdown."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

from site_inline import escaped, readable
from site_tex import displayed

from hgorun.commands.described import Key

_CODE = re.compile(r"(``.+?``|`[^`]+`)")
_PRINTED = re.compile(r"\b(prints?|printed|misprint)\b")


def plain(text: str) -> str:
    """A text in which nothing is an instruction to Markdown, but what stands between backquotes."""
    return "".join(part if i % 2 else escaped(part) for i, part in enumerate(_CODE.split(text)))


def paragraphs(docstring: str) -> list[str]:
    """The paragraphs of a docstring; those that are indented are equations, and stay as they are."""
    blocks = re.split(r"\n[ \t]*\n", docstring.strip("\n"))
    return [block if block.startswith("    ") else " ".join(block.split()) for block in blocks]


def without_errata(docstring: str) -> tuple[str, list[str]]:
    """A docstring as Markdown, and of its sentences those about errors of the source, which are left out."""
    shown, errata = [], []
    for block in paragraphs(docstring):
        if block.startswith("    "):
            shown.append(f"$$\n{displayed(block)}\n$$")
            continue
        sentences = re.split(r"(?<=[.:]) (?=[A-Z(])", block)
        wrong = [one for one in sentences if _PRINTED.search(one)]
        right = [one for one in sentences if not _PRINTED.search(one)]
        errata += [readable(one) for one in wrong]
        shown += [readable(" ".join(right))] if right else []
    return "\n\n".join(shown), errata


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells that are Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("\n", " ") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def keys_table(keys: Sequence[Key], *, without: Collection[str] = (), words: Callable[[str], str] = plain) -> str:
    """Keys with default, range and meaning; those of mappings in them with a dot.

    Parameters
    ----------
    keys : sequence of Key
    without : collection of str
        Keys whose own keys are left out.
    words : function of str
        Makes Markdown of what a key means: ``plain`` or ``readable``.
    """
    return table(("key", "default", "range", "meaning"), _rows(keys, "", without, words))


def _rows(
    keys: Sequence[Key], above: str, without: Collection[str], words: Callable[[str], str]
) -> Iterator[tuple[str, str, str, str]]:
    for key in keys:
        name = f"`{above}{key['key']}`"
        default = "required" if key["required"] else "" if key["default"] in (None, "", ()) else f"`{key['default']}`"
        yield name, default, plain(key["range"]), words(key["description"])
        if key["key"] not in without:
            yield from _rows(key["keys"], f"{above}{key['key']}.", (), words)
