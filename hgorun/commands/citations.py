"""Publications as BibTeX: those that sources of the package name, each under a key that does not change.

``reference`` of an observer or a plant says in words what it is from, with equation numbers. What such words mean
stands once, in ``references.bib`` beside this file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

_FILE = Path(__file__).with_name("references.bib")
_ENTRY = re.compile(r"^@(\w+)\{(\w+),\n(.*?)^\}", re.MULTILINE | re.DOTALL)
_FIELD = re.compile(r"^  (\w+) = \{(.*)\},$", re.MULTILINE)
_COAUTHOR = re.compile(r"[A-Z][\w']*, $")
_AND = re.compile(r",? (?:and|&) (?=[A-Z])")
_LONGEST_KEY = 40
_NEW = re.compile(r"\W+")


@dataclass(frozen=True)
class Entry:
    """A publication.

    Attributes
    ----------
    kind, key : str
        As in ``@kind{key, ...}``.
    fields : tuple of pairs of str
    listed : str
        The publication in whose list of references its volume and pages stand so; empty where none was at hand.
    """

    kind: str
    key: str
    fields: tuple[tuple[str, str], ...]
    listed: str = ""

    @property
    def verified(self) -> bool:
        """Whether it was looked up, by its DOI or in a list of references; books, theses and web pages need not be."""
        looked_up = self.has_doi or bool(self.listed)
        return looked_up or self.kind not in ("article", "inproceedings")

    @property
    def has_doi(self) -> bool:
        """Whether it was looked up by its identifier."""
        return any(name == "doi" for name, _ in self.fields)

    @property
    def bibtex(self) -> str:
        """The entry as BibTeX, with a remark before it where it has no DOI to be looked up by."""
        remark = [] if self.verified else [f"% {self.key}: not verified, compare it with the publication"]
        remark += [f"% {self.key}: {self._as_listed}"] if self.listed else []
        lines = [f"  {name} = {{{value}}}," for name, value in self.fields]
        return "\n".join([*remark, f"@{self.kind}{{{self.key},", *lines, "}"])

    @property
    def text(self) -> str:
        """The entry in a line for people."""
        own = {name: re.sub(r"[{}\\]", "", value) for name, value in self.fields}
        names = own.get("author") or own.get("editor", "")
        people = [" ".join(reversed(name.split(", ", 1))) for name in names.split(" and ")]
        where = own.get("journal") or own.get("booktitle") or own.get("publisher") or own.get("school")
        volume = " ".join(part for part in (own.get("volume", ""), own.get("pages", "").replace("--", "-")) if part)
        doi = f"doi:{own['doi']}" if "doi" in own else own.get("url")
        listed = f"({self._as_listed})" if self.listed else ""
        parts = (", ".join(people), own.get("title"), where, volume, own.get("year"), own.get("note"), doi, listed)
        return ", ".join(part for part in parts if part)

    @property
    def _as_listed(self) -> str:
        what = "volume and pages" if "volume" in dict(self.fields) else "pages"
        return f"{what} as in the references of {self.listed}"


@cache
def known() -> Mapping[str, Entry]:
    """{what sources call it: the publication}."""
    found: dict[str, Entry] = {}
    for kind, key, body in _ENTRY.findall(_FILE.read_text(encoding="utf-8")):
        fields = dict(_FIELD.findall(body))
        words = fields.pop("cited")
        listed = fields.pop("listed", "")
        found[words] = Entry(kind, key, tuple(fields.items()), listed)
    return found


def cited_in(reference: str) -> Iterator[Entry]:
    """The publications that the words of a reference name; the words themselves where none of them is known."""
    text = _AND.sub(", ", reference)  # as authors are separated there
    named = [known()[words] for words in sorted(filter(lambda w: _names(text, w), known()), key=text.find)]
    if reference:
        yield from named or [_unknown(reference)]


def _names(reference: str, words: str) -> bool:
    """Whether words such as ``Khalil 2017`` stand there, and not as the end of ``Freidovich, Khalil 2017``."""
    return any(
        not _COAUTHOR.search(reference[: match.start()])
        for match in re.finditer(rf"(?<!\w){re.escape(words)}(?!\w| \d{{4}})", reference)
    )


def _unknown(reference: str) -> Entry:
    key = _NEW.sub("", reference.split(",")[0].split(";")[0]).lower()[:_LONGEST_KEY] or "reference"
    return Entry("misc", key, (("note", re.sub(r"[{}\\]", "", reference)),))
