"""Links to files of the checkout that are no pages: on the site they are text."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(\.\./[^)]*\)")


def without_links(text: str) -> str:
    """A page whose links out of its folder are the words that they were made of."""
    return _LINK.sub(r"\1", text)


def _read(app: Sphinx, docname: str, source: list[str]) -> None:
    source[0] = without_links(source[0])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", _read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
