"""Which figures and claims are meant by the names on the command line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hgorun.config.expressions import nearest
from hgorun.errors import ConfigError
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.reproduce.job import Folders, Job, Work
from hgorun.reproduce.shipped import below, experiments
from hgorun.study.check import check
from hgorun.study.loading import load_study, refuse_twins
from hgorun.study.study import Study


def choose(
    names: Sequence[str],
    folders: Folders,
    *,
    figures: bool,
    claims: bool,
    width: str | None = None,
    style: str | None = None,
    seed: int | None = None,
) -> list[Work]:
    """The jobs that the names ask for.

    Parameters
    ----------
    names : sequence of str
        Figures (``3.10``, ``lee2016/1``), experiments, folders of them, or your own YAML files; none means
        all experiments that come with hgorun.
    folders : Folders
        Of the results.
    figures, claims : bool
        What is wanted of them. A name of a figure asks for that figure and for the claims about it.
    width, style : str, optional
        Of the page that figures are drawn for; by default what their files say.
    seed : int, optional
        In the place of those in the files.

    Raises
    ------
    ConfigError
        When a name means nothing, or something in a file is wrong.
    """
    own = [Path(n) for n in names if Path(n).suffix in {".yaml", ".yml"}]
    refuse_twins(own)
    patterns = [n.strip("/") for n in names if Path(n).suffix not in {".yaml", ".yml"}]
    chosen: list[Work] = []
    used: set[str] = set()
    known: set[str] = set()
    groups: dict[str, list[str]] = {}
    for path, file in ({} if own and not patterns else experiments()).items():
        study, group = load_study(file, seed=seed), path.split("/")[0]
        known |= {path, study.name, group, *study.figures, *(f"{group}/{name}" for name in study.figures)}
        groups.setdefault(group, []).extend(study.figures)
        whole = {p for p in patterns if path == p or path.startswith(f"{p}/") or study.name == p}
        named = {p for p in patterns if any(p in (f, f"{group}/{f}") for f in study.figures)}
        used |= whole | named
        drawn = [f for f in study.figures if whole or not patterns or {f, f"{group}/{f}"} & named]
        told = [c.id for c in study.claims if whole or not patterns or (c.figure in drawn and named)]
        _add(chosen, Job(file, path, tuple(drawn) * figures, tuple(told) * claims, folders, width, style, seed), study)
    for pattern in patterns:
        if pattern not in used:
            there = "; ".join(f"{group}: {', '.join(names)}" for group, names in groups.items())
            meant = _in_its_place(pattern) or nearest(pattern, known)
            raise ConfigError(f"no figure or experiment is called {pattern!r}.{meant} Known: {there}")
    for file in own:
        study = load_study(file, seed=seed)
        if not (study.figures if figures else study.claims):
            key = "figures" if figures else "claims"
            raise ConfigError(f"the file has no {key}: block", file=str(file), key=key)
        check(study)
        ids = tuple(c.id for c in study.claims)
        _add(
            chosen,
            Job(file, study.name, tuple(study.figures) * figures, ids * claims, folders, width, style, seed),
            study,
        )
    return chosen


def _in_its_place(name: str) -> str:
    """Of an observer or a plant in the place of a figure: what it is, and the experiments that name it."""
    if name in OBSERVERS.names():
        kind = "an observer"
    elif name in PLANTS.names():
        kind = "a plant"
    else:
        return ""
    found = [path for path, said in below("").items() if name in _types(said)]
    use = f"; it is in {', '.join(found)}" if found else ""
    return f" It is {kind}: claims and figures have names of their own, or those of their experiments{use}."


def _types(said: Mapping[str, Any]) -> set[object]:
    """The types of the plant and the observers in the text of an experiment."""
    blocks = [said.get("plant"), *(said.get("observers") or {}).values()]
    return {block.get("type") for block in blocks if isinstance(block, Mapping)}


def _add(chosen: list[Work], job: Job, study: Study) -> None:
    if job.figures or job.claims:
        chosen.append(Work(job, study))
