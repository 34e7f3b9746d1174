"""What ``hgorun show`` says of a figure of a publication, of a claim about it, and of a folder of experiments."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from hgorun.reproduce.shipped import below, claims_called, drawing_figure

Record: TypeAlias = dict[str, str | list[str]]


def of_name(name: str) -> list[Record]:
    """Of each figure and claim that is called so, or else of the folder; nothing of other names."""
    found = drawing_figure(name)
    several = len({path.split("/")[0] for path in found}) > 1
    figures = [_of_figure(name, path, said, several=several) for path, said in found.items()]
    inside = below(name)
    return [*figures, *_claims(name)] or ([_of_folder(name.rstrip("/"), inside)] if inside else [])


def names() -> list[str]:
    """Of all figures and claims, and of the folders of experiments."""
    said = below("")
    figures = (str(figure) for one in said.values() for figure in one.get("figures") or ())
    claims = (str(claim["id"]) for one in said.values() for claim in one.get("claims") or ())
    return [*figures, *claims, *(parent.as_posix() for path in said for parent in list(Path(path).parents)[:-1])]


def _of_figure(name: str, path: str, said: Mapping[str, Any], *, several: bool) -> Record:
    short, own = name.split("/")[-1], Path(path).name
    called = f"{path.split('/')[0]}/{short}" if several else name
    block = said["figures"][short]
    about = [str(claim["id"]) for claim in said.get("claims") or () if str(claim.get("figure")) == short]
    found: Record = {"name": called, "kind": "figure"}
    if title := block.get("title"):
        found["title"] = str(title)
    found |= {
        "experiment": f"{path}: {said.get('title', '')}".rstrip(": "),
        "draw it": f"hgorun figures {called}",
        "see its experiment": f"hgorun show {path}",  # a plant may have the short name
        "copy its experiment": f"hgorun init {own}",
    }
    if about:
        found |= {"claims about it": about, "measure them": f"hgorun claims {called}"}
    return found


def _claims(name: str) -> Iterator[Record]:
    for path, said, claim in claims_called(name):
        yield _of_claim(path, said, claim)


def _of_claim(path: str, said: Mapping[str, Any], claim: Mapping[str, Any]) -> Record:
    figure = claim.get("figure")
    keys = ("claim", "source", "value", "below", "above", "between", "undecidable", "note")
    found: Record = {"name": str(claim["id"]), "kind": "claim"}
    found |= {key: str(claim[key]).strip() for key in keys if key in claim}
    found["experiment"] = f"{path}: {said.get('title', '')}".rstrip(": ")
    if figure is not None:
        found["figure"] = str(figure)
    return found | {"measure it": f"hgorun claims {path}", "see its experiment": f"hgorun show {path}"}


def _of_folder(name: str, inside: Mapping[str, Mapping[str, Any]]) -> Record:
    return {
        "name": name,
        "kind": "folder of experiments",
        "experiments": list(inside),
        "figures": [str(figure) for said in inside.values() for figure in said.get("figures") or ()],
        "draw them": f"hgorun figures {name}",
        "measure its claims": f"hgorun claims {name}",
        "see an experiment": f"hgorun show {next(iter(inside))}",
    }


def as_lines(record: Record) -> Sequence[str]:
    """Sentences for a terminal, to be wrapped."""
    return [_plain(f"{key}: {value if isinstance(value, str) else ', '.join(value)}") for key, value in record.items()]


def _plain(text: str) -> str:
    """Without the marks of LaTeX: ``theta = 5`` of ``$\\theta = 5$``, ``xhat_1`` of ``$\\hat x_1$``."""
    return re.sub(r"\$([^$]*)\$", lambda formula: _letters(formula[1]), text)


def _letters(formula: str) -> str:
    named = re.sub(r"\\(hat|bar|tilde|dot)\s*\{?(\w)\}?", r"\2\1", formula)
    return re.sub(r"\\(?:var)?([A-Za-z]+)|[{}]", lambda word: word[1] or "", named)
