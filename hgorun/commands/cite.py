"""``cite``: what a configuration is made of, and who is to be cited for it."""

from __future__ import annotations

import json as json_text
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from inspect import getmro
from pathlib import Path
from sys import modules
from typing import Any

from hgorun.commands.citations import Entry, cited_in, known
from hgorun.commands.described import reference_of
from hgorun.commands.inputs import configuration, is_result
from hgorun.commands.outputs import refuse_other_kinds, there, written
from hgorun.commands.run_options import Cite
from hgorun.config.kinds import of_another_command
from hgorun.config.reading import read_source
from hgorun.config.tuning import TuneFile
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source, parse
from hgorun.ensemble.collected.reading import base_of, is_sweep
from hgorun.ensemble.folder.manifest import Manifest
from hgorun.errors import ConfigError
from hgorun.files import write_text
from hgorun.noise.base import NOISE
from hgorun.observers.base import OBSERVERS
from hgorun.originals import note_originals
from hgorun.plants.base import PLANTS
from hgorun.registry import Registry
from hgorun.result.reading import read
from hgorun.study.loading import load_runs
from hgorun.study.split import split
from hgorun.study.sweep_file import load_sweep
from hgorun.tables.layout import wrapped
from hgorun.version import RELEASED, __version__

_BIBTEX = {".bib"}
_SELF = Entry(
    "software",  # which styles that do not know it set as misc
    "hgorun",
    (
        ("author", "{The hgorun developers}"),
        ("title", "{hgorun}: a test bench for high-gain observers"),
        ("year", RELEASED[:4]),
        ("version", __version__),
        ("note", f"Version {__version__}, BSD-3-Clause"),
    ),
)
_METHODS = ("dopri5", "rodas5p")


@dataclass(frozen=True)
class Use:
    """What something in a configuration is from.

    Attributes
    ----------
    what : str
        Such as ``observer SHGO (shgo)``.
    reference : str
        The source in words, with equation numbers.
    entries : tuple of Entry
    """

    what: str
    reference: str
    entries: tuple[Entry, ...]


def cite(options: Cite) -> int:
    """Print or write what a configuration uses, and the publications.

    Raises
    ------
    ConfigError
        For anything wrong in the configuration.
    """
    if options.output is not None and options.output.suffix.lower() not in _BIBTEX:
        raise ConfigError(f"--output: expected a file .bib, found {options.output}")
    refuse_other_kinds(options.output, _BIBTEX)
    note_originals([options.config])
    made = is_result(options.config) or is_sweep(options.config)
    found = uses(options.config if made else configuration(options.config, "cite"), options.run)
    entries = publications(found)
    if options.output is not None:
        before = there([options.output])
        write_text(options.output, _bibtex(entries))
        if options.text:
            print(written([options.output], before))
    elif options.json:
        rows = [{"what": use.what, "reference": use.reference, "keys": [e.key for e in use.entries]} for use in found]
        print(json_text.dumps({"uses": rows, "bibtex": {e.key: e.bibtex for e in entries}}, indent=2))
    elif options.bibtex:
        print(_bibtex(entries), end="")
    elif not options.quiet:
        print(_text(options.config, found, entries))
    return 0


def _bibtex(entries: Iterable[Entry]) -> str:
    return "\n\n".join(entry.bibtex for entry in entries) + "\n"


def _text(file: Path, found: list[Use], entries: list[Entry]) -> str:
    lines = [f"{file} uses"]
    for use in found:
        keys = ", ".join(entry.key for entry in use.entries)
        of = f": {use.reference}" if use.reference else ""
        lines += wrapped(f"{use.what}{of} [{keys}]", "  ", then="      ")
    lines += ["", *wrapped("to be cited (--bibtex: as BibTeX; * is not verified, compare it with the publication):")]
    for entry in entries:
        lines += wrapped(f"[{entry.key}]{'' if entry.verified else '*'} {entry.text}", "  ", then="      ")
    return "\n".join(lines)


def publications(found: Iterable[Use]) -> list[Entry]:
    """All entries, each key once."""
    keys: dict[str, Entry] = {}
    for use in found:
        for entry in use.entries:
            keys.setdefault(entry.key, entry)
    return list(keys.values())


def uses(path: Path, run: str | None = None) -> list[Use]:
    """What a configuration uses, in the order of its blocks; hgorun itself first.

    Parameters
    ----------
    path : Path
    run : str, optional
        Only this run of the file.
    """
    sources = _runs(path, run)
    found = dict.fromkeys([Use("hgorun", "", (_SELF,))])
    for source in sources:
        found |= dict.fromkeys(_of_blocks(source.data))
    for name in ("casadi", "llvmlite", "numpy"):
        found |= {Use(f"library {name}", "", (known()[f"library {name}"],)): None}
    if any(_with_scipy(source.data) for source in sources):
        found |= {Use("library scipy", "", (known()["library scipy"],)): None}
    if any("figures" in source.data for source in sources):
        found |= {Use("library matplotlib", "", (known()["library matplotlib"],)): None}
    return list(found)


def _runs(path: Path, run: str | None) -> list[Source]:
    """The configurations of a file, checked unless they are about recorded data, which need not be at hand.

    Of a file with ``axes`` or ``tune`` it is its base, of a result the configuration that it was made from.
    """
    if is_result(path) or is_sweep(path):
        if run is not None:
            raise ConfigError("--run is for configurations; this is a result", file=str(path))
        return [_of_result(path)]
    _, source = read_source(path)
    data = source.data if isinstance(source.data, dict) else {}
    command, *_ = of_another_command(data) or ("",)
    if command == "sweep":
        if run is not None:
            raise ConfigError("--run goes with a configuration; a sweep file has the key run", file=str(path))
        return [load_sweep(path).base.source]
    if command == "tune":
        blocks = validate(TuneFile, data, source, ())
        sought = {"tune": data["tune"]}
        return [replace(one, data=one.data | sought) for one in _runs(path.parent / blocks.base, run or blocks.run)]
    if "data" not in data:
        return [one.source for one in load_runs(path, run)]
    parts = split(source) if "runs" in data else {path.stem: (source, {})}
    if run is not None and run not in parts:
        raise ConfigError(f"--run: the file has no run {run!r}; its runs: {', '.join(parts)}", file=str(path))
    return [one for name, (one, _) in parts.items() if run in (None, name)]


def _of_result(path: Path) -> Source:
    """What a result file, that of an ensemble, or the folder in which one is made says of its configuration.

    The resolved configuration lacks ``reference``, which the file's own text may have.
    """
    where = f"{path}: config_resolved"
    if os.path.isdir(path):
        return Manifest.read(path).ensemble(path).base.source
    if is_sweep(path):
        return parse(base_of(path), where)
    result = read(path)
    source, written = parse(result.config_resolved, where), parse(result.config, f"{path}: config").data
    words = written.get("reference") if isinstance(written, dict) else None
    return source if words is None else replace(source, data=source.data | {"reference": words})


def _of_blocks(data: dict[str, Any]) -> Iterator[Use]:
    """What the blocks of a run name."""
    if words := str(data.get("reference", "") or ""):
        yield Use("the configuration", words, tuple(cited_in(words)))
    plant = data.get("plant")
    yield from _named("plant", PLANTS, plant, "")
    observers = data.get("observers")
    for label, block in observers.items() if isinstance(observers, dict) else ():
        yield from _named("observer", OBSERVERS, block, str(label))
    measurement = data.get("measurement")
    noise = measurement.get("noise") if isinstance(measurement, dict) else None
    for block in noise if isinstance(noise, list) else [noise]:
        yield from _named("noise", NOISE, block, "")
    solver = data.get("solver")
    method = solver.get("method") if isinstance(solver, dict) else None
    if method in _METHODS:
        yield Use(f"method {method}", "", (known()[f"method {method}"],))


def _named(kind: str, registry: Registry[Any], block: object, label: str) -> Iterator[Use]:
    """A class that a block names, where it has a source."""
    name = block.get("type") if isinstance(block, dict) else None
    if not isinstance(name, str) or name == "inline":
        return
    try:
        cls = registry.find(name)
    except KeyError:
        return
    used = [key for key, value in block.items() if value is not None] if isinstance(block, dict) else []
    if reference := reference_of(cls, used):
        what = f"{kind} {label} ({name})" if label else f"{kind} {name}"
        yield Use(what, reference, tuple(cited_in(reference)))


def _with_scipy(data: dict[str, Any]) -> bool:
    """Whether gains, statistics or a search are computed with SciPy."""
    if {"tune", "claims"} & data.keys():
        return True
    observers = data.get("observers")
    names = [block.get("type") for block in observers.values()] if isinstance(observers, dict) else []
    return any(_imports_scipy(OBSERVERS.find(str(name))) for name in names)


def _imports_scipy(cls: type) -> bool:
    """Whether the file of a class, or of one that it derives from, names SciPy in its code."""
    files = {getattr(modules.get(base.__module__), "__file__", None) for base in getmro(cls)}
    ours = (Path(file) for file in files if file is not None and "observers" in file)
    return any("from scipy" in file.read_text(encoding="utf-8") for file in ours)
