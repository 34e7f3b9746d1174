"""``init``: how to start, from a copy of what hgorun brings, from a plant's name, or from answers to questions."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from hgorun.commands.catalogue_options import Init
from hgorun.commands.first import First, first_of
from hgorun.commands.other_names import in_its_place
from hgorun.commands.outputs import refuse_no_configuration, refuse_unwritable
from hgorun.commands.questions import ask, ask_for_file, ask_for_others
from hgorun.commands.schema import SCHEMA_FILE, build_schema, schema_text, with_schema
from hgorun.commands.trial import FOLLOWS, Found, followed
from hgorun.config import yaml_source
from hgorun.config.kinds import head_of, is_recording
from hgorun.config.nearest import MEASURED, nearest
from hgorun.errors import ConfigError, HgorunError
from hgorun.files import write_text
from hgorun.plants.base import PLANTS, Plant
from hgorun.reproduce.shipped import examples, experiments
from hgorun.reproduce.shipped import folder as experiments_folder
from hgorun.simulation.simulate import prepare
from hgorun.study.loading import load

_DEFAULT = "contois_te025"
_ANOTHER = "-o FILE names another one"
_ELSEWHERE = "hgorun init NAME FOLDER copies it elsewhere"


def init(options: Init) -> int:
    """Write the files to start with.

    Raises
    ------
    ConfigError
        For a name that does not exist, options that do not go together, and where another file of that name is there
        already: then nothing is written.
    HgorunError
        Where the new configuration does not run.
    """
    for place, option in (
        (options.output or (Path() if options.ask else None), "--output"),
        (options.folder, "FOLDER"),
    ):
        if place is not None:
            refuse_unwritable(place, option)
    if options.ask or options.plant is not None:
        if options.name is not None:
            raise ConfigError(f"{options.name} is copied as it is: leave it out, or leave --plant and --ask out")
        if options.ask and options.plant is not None:
            raise ConfigError(f"--ask asks for the plant, too: leave --plant {options.plant} out, or --ask")
        if options.ask and options.observers:
            raise ConfigError("--observer goes with --plant; --ask asks for observers")
        return _first(options)
    name = options.name or _DEFAULT
    if options.observers:
        chosen = " ".join(f"--observer {one}" for one in options.observers)
        raise ConfigError(f"--observer goes with --plant: hgorun init --plant NAME {chosen}")
    if options.output is not None:
        raise ConfigError(
            f"--output goes with --plant: hgorun init --plant NAME -o {options.output}; a copy of an experiment keeps "
            f"its name and takes a folder: hgorun init {name} FOLDER"
        )
    _refuse_no_folder(name, options.folder)
    if name in examples():
        return _example(name, options)
    return _experiment(name, options)


def _first(options: Init) -> int:
    """A configuration of a plant, which is tried before the command ends."""
    target = options.output
    if target is not None:
        refuse_no_configuration(target, options.plant or "mine", "--output")
    if options.plant is not None:
        try:
            plant = PLANTS.find(options.plant)
        except KeyError:
            known = PLANTS.names()
            hint = in_its_place(options.plant) or (
                f"{nearest(options.plant, known)} There are {', '.join(known)}; "
                "hgorun init --ask asks for equations of your own"
            )
            raise ConfigError(f"--plant: no plant is called {options.plant!r}.{hint}") from None
        found = Found(0, first_of(options.plant, plant))
        if options.observers:
            found = _fitting(options.plant, plant, options.observers)
        target = target or Path(f"{options.plant}.yaml")
    else:
        if target is not None and os.path.exists(target) and not options.force:
            raise ConfigError(f"{target} exists; --force overwrites it, {_ANOTHER}")
        chosen = ask()
        target = target or Path(f"{chosen.name}.yaml")
        if os.path.exists(target) and not options.force:
            target = ask_for_file(target)
        found = _that_runs(chosen)
    schema = _schema_for(target.parent, beside=options.schema)
    _write(
        [(target, with_schema(found.first.text(str(target)), schema.address))],
        schema,
        _ANOTHER,
        force=options.force,
    )
    for change in found.changes:
        print(f"note: {change}")
    if found.error > FOLLOWS:
        advice = "try other gains, less noise or a first guess that is nearer"
        print(f"note: an estimate misses its state by {found.error:.0%} of what that moves through: {advice}")
    _try(target)
    return 0


def _fitting(name: str, plant: type[Plant], observers: Sequence[str]) -> Found:
    """A configuration with these observers, which has been tried.

    Raises
    ------
    ConfigError
        Where none is found whose estimates follow.
    """
    found = followed(first_of(name, plant, observers))
    if not found.trouble and found.error < FOLLOWS:
        return found
    why = found.trouble or (
        f"in the best, an estimate misses its state by {found.error:.0%} of what that moves through: what is measured "
        "says too little of it in this way, or gains have to be sought by hand"
    )
    usual = ", ".join(sorted({str(keys["type"]) for keys in first_of(name, plant).start.observers.values()}))
    advice = "" if "observers for this plant are" in why else f"; this plant is mostly run with {usual}"
    types = ", ".join(observers)
    raise ConfigError(f"--observer: no configuration of {name} with {types} was found that follows: {why}{advice}")


def _that_runs(chosen: First) -> Found:
    """What follows from answers, with other observers where those do not run.

    It may be written though it does not run, since a plant of your own may be the reason.
    """
    while (found := followed(chosen, answered=True)).trouble:
        other = ask_for_others(chosen, found.trouble)
        if other is None:
            return Found(0, chosen)
        chosen = other
    return found


def _try(target: Path) -> None:
    """Say what to do next, or what keeps the configuration from running."""
    try:
        prepare(load(target))
    except HgorunError as error:
        raise HgorunError(f"{target} is written, but does not run yet: {error}") from None
    print(f"try: hgorun simulate {target} && hgorun compare {target}")


def _experiment(name: str, options: Init) -> int:
    """Copy an experiment and the files that it extends."""
    shipped, folder = experiments(), options.folder or Path()
    matches = [file for path, file in shipped.items() if name in (path, Path(path).name)]
    if not matches:
        known = [*shipped, *(Path(p).name for p in shipped), *examples()]
        _refuse_files(name)
        hint = in_its_place(name) or f"{nearest(name, known)} See hgorun list experiments"
        raise ConfigError(f"no experiment is called {name!r}.{hint}")
    schema = _schema_for(folder, beside=options.schema)
    copies = [(folder / file.name, with_schema(text, schema.address)) for file, text in _with_bases(matches[0])]
    _write(copies, schema, _ELSEWHERE, force=options.force)
    print(f"try: hgorun simulate {folder / matches[0].name}")
    return 0


def _refuse_no_folder(name: str, folder: Path | None) -> None:
    """Where a copy cannot go, since the place is that of a file, or called as one."""
    if folder is not None and (
        os.path.isfile(folder) or (folder.suffix.lower() in (".yaml", ".yml") and not os.path.exists(folder))
    ):
        raise ConfigError(f"expected a folder behind {name}, found {folder}: a copy keeps its name")


def _refuse_files(name: str) -> None:
    """Say what would be right where a file is named, and not an experiment."""
    path = Path(name)
    if path.suffix.lower() in (".yaml", ".yml"):
        shipped = next((n for n in experiments() if path.stem in (n, Path(n).name)), None)
        copied = f"`hgorun init {path.stem}` copies the experiment {shipped}, and " if shipped is not None else ""
        written = f"`hgorun init --plant NAME -o {name}` writes one"
        raise ConfigError(f"{name} names a file, and init copies experiments: {copied}{written}")
    called_as_one = bool(path.suffix) and path.suffix.lower() in MEASURED and not os.path.exists(path)
    if called_as_one or is_recording(head_of(path), path):
        raise ConfigError(
            f"{name} names a log, and init copies experiments: `hgorun init fermentation` copies a configuration with "
            f"the key data and its log; `hgorun estimate CONFIG {quote(name)}` runs the observers of such a one on it"
        )
    if os.path.isfile(path):
        raise ConfigError(f"{name} is a file, and init copies experiments: see hgorun list experiments")


def _example(name: str, options: Init) -> int:
    """Copy a configuration with its recorded data."""
    folder, files = options.folder or Path(name), examples()[name]
    copies = [(folder / file.name, file.read_text(encoding="utf-8")) for file in files]
    schema = _schema_for(folder, beside=options.schema)
    made = [(path, with_schema(text, schema.address) if path.suffix == ".yaml" else text) for path, text in copies]
    _write(made, schema, _ELSEWHERE, force=options.force)
    print(f"try: hgorun estimate {folder / files[0].name}")
    return 0


@dataclass(frozen=True)
class _Schema:
    """Where editors find the schema, and what has to be written for that: its file and text, or nothing."""

    address: str
    new: tuple[Path, str] | None = None


def _write(copies: Sequence[tuple[Path, str]], schema: _Schema, another: str, *, force: bool) -> None:
    """Write the schema and texts, none of them where another text is in the way; ``another`` says how to avoid that."""
    for target, text in copies:
        if os.path.exists(target) and not force and (os.path.isdir(target) or target.read_bytes() != text.encode()):
            if os.path.isdir(target):
                raise ConfigError(f"{target} is a folder, and a file is to be written there")
            raise ConfigError(f"{target} exists and differs; --force overwrites it, {another}")
    if schema.new is not None:
        write_text(*schema.new)
        print(f"written: {schema.new[0]} (for editors)")
    for target, text in copies:
        write_text(target, text)
        print(f"written: {target}")


def _schema_for(folder: Path, *, beside: bool) -> _Schema:
    """Where editors find the schema: that of the installed package, unless one is asked for, or stands in the folder.

    Plug-ins have plants and observers that the package's schema does not know: then it is written, too.
    """
    file, installed, made = folder / SCHEMA_FILE, experiments_folder() / SCHEMA_FILE, build_schema()
    if not beside and not os.path.exists(file) and os.path.isfile(installed):
        known = json.loads(installed.read_text(encoding="utf-8"))
        if made["$defs"].keys() <= known["$defs"].keys():
            return _Schema(installed.resolve().as_uri())
    text = schema_text(made)
    stands = os.path.exists(file) and file.read_text(encoding="utf-8") == text
    return _Schema(SCHEMA_FILE, None if stands else (file, text))


def _with_bases(file: Path) -> Iterator[tuple[Path, str]]:
    """A file and those that it extends, with texts in which all of them lie in one folder."""
    text, source = yaml_source.read(file)
    base = source.data.get("extends") if isinstance(source.data, dict) else None
    if isinstance(base, str):
        yield from _with_bases(file.parent / base)
        lines = text.splitlines(keepends=True)
        place = source.positions["extends",][1] - 1
        lines[place] = lines[place].replace(base, Path(base).name)
        text = "".join(lines)
    yield file, text
