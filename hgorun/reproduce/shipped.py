"""The experiments that come with hgorun."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hgorun.config.reading import read_source


def folder(name: str = "experiments") -> Path:
    """Beside the package in a checkout, inside it in an installation."""
    package = Path(__file__).parents[1]
    inside = package / name
    return inside if inside.is_dir() else package.parent / name


_EXAMPLES = ("fermentation",)  # folders of demos/ that are in an installation, too: those whose data are small
_BENCHMARK = "benchmark"  # a folder with plants, and what hgorun benchmark takes: no figures, no claims


def experiments() -> dict[str, Path]:
    """{path without suffix, below the folder: file}, sorted; files called _... are only extended."""
    base = folder()
    files = (p for p in sorted(base.rglob("*.yaml")) if not p.name.startswith("_") and p.parent.name != _BENCHMARK)
    return {p.relative_to(base).with_suffix("").as_posix(): p for p in files}


def is_shipped(path: Path) -> bool:
    """Whether a file is one of the experiments that come with hgorun, and not a copy."""
    return path.resolve().is_relative_to(folder().resolve())


def drawing_figure(name: str) -> dict[str, Mapping[str, Any]]:
    """The experiments that draw a figure, called as ``hgorun figures`` calls it, with what they say: ``lee2016/1``."""
    *group, figure = name.split("/")
    return {
        path: said
        for path, said in _said().items()
        if (not group or group == [path.split("/")[0]]) and figure in (said.get("figures") or ())
    }


def claims_called(name: str) -> list[tuple[str, Mapping[str, Any], Mapping[str, Any]]]:
    """The claims with this id, such as ``23a`` or ``lee2016/23a``: their experiments, what these say, and the claim."""
    *group, own = name.split("/")
    return [
        (path, said, claim)
        for path, said in _said().items()
        if not group or group == [path.split("/")[0]]
        for claim in said.get("claims") or ()
        if str(claim["id"]) == own
    ]


def below(name: str) -> dict[str, Mapping[str, Any]]:
    """The experiments in a folder, such as ``robles2023``, or in all without a name, with what they say."""
    folder_of = f"{name.rstrip('/')}/" if name else ""
    return {path: said for path, said in _said().items() if path.startswith(folder_of)}


def _said() -> dict[str, Mapping[str, Any]]:
    return {path: read_source(file)[1].data for path, file in experiments().items()}


def examples() -> dict[str, tuple[Path, ...]]:
    """{name: its files}: configurations with recorded data, the one to begin with first."""
    base = folder("demos")
    return {
        name: (base / name / f"{name}.yaml", *sorted(p for p in (base / name).iterdir() if p.stem != name))
        for name in _EXAMPLES
    }


def found(path: Path) -> Path:
    """A file, or the experiment that a name without suffix stands for where there is no file of that name."""
    if os.path.exists(path) or path.suffix:
        return path
    return next((file for name, file in experiments().items() if str(path) in (name, Path(name).name)), path)
