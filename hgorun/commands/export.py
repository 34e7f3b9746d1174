"""``export``: observers of a configuration as C, as equations of a paper, or as units of other simulators."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote

from hgorun.commands.inputs import configuration
from hgorun.commands.kept import tell_what_runs_keep
from hgorun.commands.outputs import RESULTS, refuse_other_kinds, refuse_unwritable
from hgorun.commands.run_options import Export
from hgorun.commands.stream_ignored import in_other_units
from hgorun.config.nearest import refuse_other
from hgorun.config.reading import read_source
from hgorun.errors import ConfigError, SimulationError
from hgorun.export.c_code import Real
from hgorun.export.c_cost import costs
from hgorun.export.c_files import c_files
from hgorun.export.c_header import LARGE
from hgorun.export.c_memory import bytes_of
from hgorun.export.c_source import Source
from hgorun.export.fmu_templates import VERSIONS, Version
from hgorun.export.observer import Exported
from hgorun.export.prepared import Wanted, exported, exported_estimate, only
from hgorun.export.said import starts
from hgorun.files import remove_leftovers, written_whole
from hgorun.process import say
from hgorun.simulation.simulate import prepare
from hgorun.study.loading import load

_LANGUAGES = ("c", "latex")


def export(options: Export) -> int:
    """Write the observers of a configuration; everything is checked before anything is written."""
    refuse_other_kinds(options.output, ())
    refuse_other("--lang", options.lang, _LANGUAGES)
    options = replace(options, config=configuration(options.config, "export"))
    if options.output is None:
        refuse_unwritable(RESULTS / options.config.stem, kind="folder")
    in_c = options.lang == "c"
    _version(options)
    if options.fmu and not in_c:
        raise ConfigError("--fmu: a unit has C inside; leave out --lang")
    if not in_c and (options.single or options.late or options.inputs_given):
        raise ConfigError("--float, --late and --inputs-given are for --lang c; equations have symbols for the inputs")
    wanted = Wanted(late=options.late, inputs_given=options.inputs_given, steps=in_c)
    name, observers = _observers(options, wanted)
    tell_what_runs_keep(options.config, options)
    contents = {observer.label: _contents(observer, options) for observer in observers}
    folder = options.output or RESULTS / options.config.stem
    remove_leftovers(folder)
    for files in contents.values():
        for file, content in files.items():
            with written_whole(folder / file) as part:
                part.write_bytes(content)
    if in_c:
        _warn(name, observers, options)
    if options.json:
        told = {o.label: _told(o, [folder / name for name in contents[o.label]], options) for o in observers}
        print(json.dumps({"name": name, "observers": told}, indent=2))
    elif options.text:
        for observer in observers:
            print(f"{observer.label} ({observer.design.observer.type})")
            for line in _costs(observer, options) if in_c else ():
                print(f"  {line}")
            print("  written: " + ", ".join(str(folder / name) for name in contents[observer.label]))
    return 0


def _costs(observer: Exported, options: Export) -> Iterator[str]:
    """What the code of an observer takes."""
    source = _source(observer, options)
    if observer.flows:
        yield f"method: {observer.method.name}, no step longer than {observer.step:.6g} {observer.unit}"
    if begun := starts(observer):
        yield f"starts at {begun}"
    for name, cost in costs(source).items():
        yield f"{name}: at most {cost}"
    steps = f", of which {observer.pieces} steps of history take the most" if observer.pieces else ""
    yield f"memory: {bytes_of(source)} bytes{steps}"


def _warn(name: str, observers: Sequence[Exported], options: Export) -> None:
    """What is said on stderr of observers that are lost in this very run, or take much memory."""
    try:
        verdicts = {observer.label: observer.verdict() for observer in observers}
    except SimulationError as error:
        say(f"hgorun: {name}: what becomes of the exported observers in this run is not known: {error}")
        verdicts = {}
    sound = [f"--observer {quote(label)}" for label, verdict in verdicts.items() if not verdict.lost]
    alone = f"; to export the others, with steps of their own: {' '.join(sound)}" if sound else ""
    for observer in observers:
        verdict = verdicts.get(observer.label)
        if verdict is not None and verdict.lost:
            say(f"hgorun: {name}: the exported observer {observer.label} {verdict.sentence(observer.unit)}{alone}")
    for observer in observers:
        size = bytes_of(_source(observer, options))
        if size > LARGE and not options.fmu:
            say(
                f"hgorun: {name}: hgo_{observer.name}_observer takes {size} bytes, more than many a stack: declare it "
                "static; longer steps (solver.step) or less lateness make its history shorter"
            )


def _observers(options: Export, wanted: Wanted) -> tuple[str, list[Exported]]:
    """The observers of a simulated run, or of recorded data where the configuration has the key ``data``."""
    _, source = read_source(options.config, options.overrides, seed=options.seed)
    if not isinstance(source.data, dict) or "data" not in source.data:
        experiment = load(options.config, options.overrides, seed=options.seed, run=options.run)
        return experiment.name, exported(prepare(only(experiment, options.observers)), wanted)
    from hgorun.commands.estimate import one_run
    from hgorun.estimate.completed import completed
    from hgorun.estimate.log import log_of
    from hgorun.estimate.prepared import prepare_estimate

    source, name = one_run(source, options.config, options.run)
    log = log_of(source, options.config)
    with source.located():
        recording = log.read()
    experiment = only(completed(source, recording, name, ""), options.observers)
    if wanted.steps:
        for key, unit, of_model in in_other_units(log.block, experiment):
            say(f"hgorun: {name}: {key}: exported observers convert no values from {unit}: send them in {of_model}")
    prepared = prepare_estimate(experiment, recording)
    if prepared.gated:
        say(f"hgorun: {name}: gates are not exported: the exported observers take every sample that they are told")
    return name, exported_estimate(prepared, wanted)


def _contents(observer: Exported, options: Export) -> dict[str, bytes]:
    """The files of an observer, by their names."""
    if options.fmu:
        from hgorun.export.fmu import compilers, fmu

        made_by = compilers()
        if not made_by:
            say("hgorun: there is no C compiler (cc, gcc, clang or the package ziglang): units have their sources only")
        return {f"{observer.name}.fmu": fmu(observer, _version(options), made_by, single=options.single)}
    if options.lang == "latex":
        from hgorun.export.latex import latex

        return {f"{observer.name}.tex": latex(observer).encode()}
    return {name: text.encode() for name, text in c_files(observer, single=options.single).items()}


def _version(options: Export) -> Version:
    refuse_other("--fmi", options.fmi, VERSIONS)
    return next(version for version in VERSIONS if options.fmi == version)


def _source(observer: Exported, options: Export) -> Source:
    return Source(observer, Real(options.single))


def _told(observer: Exported, files: list[Path], options: Export) -> dict[str, object]:
    source = _source(observer, options)
    found: dict[str, object] = {
        "type": observer.design.observer.type,
        "files": [str(file) for file in files],
        "states": list(observer.states),
        "outputs": [output.name for output in observer.outputs],
        "inputs": list(observer.inputs),
    }
    if options.lang != "c":
        return found
    found |= {"bytes": bytes_of(source), "operations": {name: vars(cost) for name, cost in costs(source).items()}}
    if observer.flows:
        found |= {"method": observer.method.name, "step": observer.step}
    return found
