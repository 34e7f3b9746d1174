"""Write docs/licences.md: the licence of everything that an installation of hgorun brings, from the packages' metadata.

python tools/licences.py
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.metadata import Distribution, distribution
from pathlib import Path

from hgorun.commands.doctor import extras

PAGE = Path(__file__).resolve().parents[1] / "docs" / "licences.md"
HEAD = """# Licences

What an installation on Linux brings along, with the licence that each package states in its metadata, or the main one
where parts of a package have others. hgorun itself is under the BSD 3-Clause licence (`LICENSE`). Extras are installed
on request, as in `pip install 'hgorun[dask]'`; `fmu` (ziglang, MIT) is a C compiler, called as a program. The page is
written by `python tools/licences.py`.

"""

# How metadata name a licence, as SPDX does it; the first that is found counts.
_NAMES: Mapping[str, str] = {
    r"\bLGPL.*3|LGPLv3|Lesser General Public License v3": "LGPL-3.0-or-later",
    r"\bMPL[- ]2|Mozilla Public License 2": "MPL-2.0",
    r"\bEPL[- ]2|Eclipse Public License v? ?2": "EPL-2.0 OR BSD-3-Clause",
    r"\bMIT-CMU|HPND": "MIT-CMU",
    r"BSD[- ]2-Clause|2-Clause BSD|Simplified BSD": "BSD-2-Clause",
    r"\bBSD": "BSD-3-Clause",
    r"Apache": "Apache-2.0",
    r"Python Software Foundation|\bPSF": "PSF-2.0",
    r"\bMIT\b": "MIT",
    r"\bISC\b": "ISC",
}


def licence(package: Distribution) -> str:
    """The licence that a package states: as an expression, in a classifier, or in words.

    Raises
    ------
    ValueError
        When it states none that is known here.
    """
    head = package.metadata
    stated = [
        head.get("License-Expression"),
        *_classifiers(package),
        (head.get("License") or "").split("\n\n")[0][:200],
    ]
    for text in filter(None, stated):
        for pattern, name in _NAMES.items():
            if re.search(pattern, text):
                return name
    raise ValueError(f"{head['Name']}: no known licence in {[text for text in stated if text]}")


def _classifiers(package: Distribution) -> list[str]:
    return [line for line in package.metadata.get_all("Classifier") or [] if line.startswith("License ::")]


def needed(name: str, extras: frozenset[str] = frozenset()) -> dict[str, Distribution]:
    """A package and all that it needs here, directly or not, by name."""
    from packaging.requirements import Requirement
    from packaging.utils import canonicalize_name

    found: dict[str, Distribution] = {}
    seen: set[tuple[str, frozenset[str]]] = set()
    todo = [(name, extras)]
    while todo:
        name, extras = todo.pop()
        if (name, extras) in seen:
            continue
        seen.add((name, extras))
        found[name] = distribution(name)
        for text in found[name].requires or []:
            wanted = Requirement(text)
            if wanted.marker is None or any(wanted.marker.evaluate({"extra": extra}) for extra in extras or {""}):
                todo.append((canonicalize_name(wanted.name), frozenset(wanted.extras)))
    return found


def rows() -> Iterator[tuple[str, str, str]]:
    """Name, licence, and the extras that bring it; none for what is always there."""
    always = needed("hgorun")
    brought: dict[str, list[str]] = {name: [] for name in always}
    packages = dict(always)
    for extra in sorted(extras()):  # what users install; not tools of developers
        try:
            found = needed("hgorun", frozenset({extra}))
        except ModuleNotFoundError:  # PackageNotFoundError: it is not installed here
            continue
        packages |= found
        for name in found.keys() - always.keys():
            brought.setdefault(name, []).append(extra)
    for name in sorted(packages.keys() - {"hgorun"}):
        yield name, licence(packages[name]), ", ".join(brought[name])


def page() -> str:
    """The page as text."""
    lines = [f"| {name} | {licence} | {extras} |" for name, licence, extras in rows()]
    return HEAD + "\n".join(["| package | licence | extra |", "|---|---|---|", *lines]) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
