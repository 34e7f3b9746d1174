"""What ``hgorun show`` says of a figure of a publication, and of a folder of experiments."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from hgorun.reproduce.shipped import below, drawing_figure

Record: TypeAlias = dict[str, str | list[str]]


def of_name(name: str) -> list[Record]:
    """Of each figure that is called so, as by ``hgorun figures``, or else of the folder; nothing of other names."""
    found = drawing_figure(name)
    several = len({path.split("/")[0] for path in found}) > 1
    figures = [_of_figure(name, path, said, several=several) for path, said in found.items()]
    inside = below(name)
    return figures or ([_of_folder(name.rstrip("/"), inside)] if inside else [])


def names() -> list[str]:
    """Of all figures and of the folders of experiments."""
    said = below("")
    figures = (str(figure) for one in said.values() for figure in one.get("figures") or ())
    return [*figures, *(parent.as_posix() for path in said for parent in list(Path(path).parents)[:-1])]


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
        "see its experiment": f"hgorun show {own}",
        "copy its experiment": f"hgorun init {own}",
    }
    if about:
        found |= {"claims about it": about, "measure them": f"hgorun claims {called}"}
    return found


def _of_folder(name: str, inside: Mapping[str, Mapping[str, Any]]) -> Record:
    return {
        "name": name,
        "kind": "folder of experiments",
        "experiments": list(inside),
        "figures": [str(figure) for said in inside.values() for figure in said.get("figures") or ()],
        "draw them": f"hgorun figures {name}",
        "measure its claims": f"hgorun claims {name}",
        "see an experiment": f"hgorun show {Path(next(iter(inside))).name}",
    }


def as_lines(record: Record) -> Sequence[str]:
    """Sentences for a terminal, to be wrapped."""
    return [f"{key}: {value if isinstance(value, str) else ', '.join(value)}" for key, value in record.items()]
