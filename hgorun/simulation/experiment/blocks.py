"""The parts of a configuration checked against the classes that they name."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from hgorun.config.expressions import nearest
from hgorun.config.models import ExperimentBlocks
from hgorun.config.named import name_keys
from hgorun.config.nearest import listed, nearest_name
from hgorun.config.refusals import Refusals, block_of, of_other_blocks
from hgorun.config.types import describe
from hgorun.config.validation import validate
from hgorun.config.yaml_source import Source
from hgorun.errors import ConfigError, KeyPath
from hgorun.measurement.blocks import Measurement
from hgorun.observers.base import OBSERVERS, AnyObserver
from hgorun.observers.capabilities import ByLateness, BySampling
from hgorun.plants.base import PLANTS, Plant
from hgorun.registry import Registry
from hgorun.result.records.data import PLANT
from hgorun.simulation.experiment.unused import refuse_unused, refuse_unused_changes

T = TypeVar("T")

_LONGEST_LABEL = 100


@dataclass(frozen=True, eq=False, repr=False)
class Checked:
    """The parts of a configuration, each checked by its class."""

    blocks: ExperimentBlocks
    plant: Plant
    measurement: Measurement
    observers: dict[str, AnyObserver]

    def __post_init__(self) -> None:
        name_keys(self, observers="observer")


def check(source: Source) -> Checked:
    """The parts of a configuration; its figures and claims, which are not part of a run, are left out.

    Raises
    ------
    ConfigError
        For the first thing wrong: file, line, key, what was found and what would be right; ``others`` are those of
        other blocks.
    """
    _refuse_recorded(source)
    try:
        return _checked(source)
    except ConfigError as first:
        told = (first, *first.others)
        first.add_others(_others(source, told))
        raise


def _others(source: Source, told: Sequence[ConfigError]) -> Iterator[ConfigError]:
    """What is wrong in other blocks than what is told: each is checked by itself, so that none follows from it."""
    data: dict[str, Any] = source.data if isinstance(source.data, dict) else {}
    observers = data.get("observers")
    blocks = {key: part for key, part in data.items() if key in ExperimentBlocks.model_fields and part is not None}
    checks: list[Callable[[], object]] = [
        partial(validate, ExperimentBlocks, data, source, ()),
        partial(_of_what_is_there, blocks, source),  # a block may be called otherwise, and only seem to be missing
    ]
    if isinstance(data.get("plant"), dict):
        checks.append(partial(plant_of, source))
    if "measurement" in data:
        checks.append(partial(validate, Measurement, data["measurement"], source, ("measurement",)))
    if isinstance(observers, dict):
        checks += [partial(observer_of, k, v, source) for k, v in observers.items() if isinstance(v, dict)]
    yield from of_other_blocks(told, checks)


def _of_what_is_there(blocks: dict[str, Any], source: Source) -> None:
    """Check the blocks of a file that has other keys as well; what is missing may be one of these."""
    try:
        validate(ExperimentBlocks, blocks, source, ())
    except ConfigError as error:
        found = [one for one in (error, *error.others) if block_of(one)[0] in blocks]
        if found:
            found[0].others = tuple(found[1:])
            raise found[0] from None


def _checked(source: Source) -> Checked:
    blocks = validate(ExperimentBlocks, source.data, source, ())
    plant = plant_of(source)
    measurement = validate(Measurement, blocks.measurement, source, ("measurement",))
    observers = {label: observer_of(label, block, source) for label, block in blocks.observers.items()}
    with source.located():
        refuse_unused(source, plant, observers, blocks.controller)
    return Checked(blocks.model_copy(update=NOT_OF_A_RUN), plant, measurement, observers)


def _refuse_recorded(source: Source) -> None:
    """Where there are recordings and no horizon or initial state, say which command takes them and needs neither.

    Raises
    ------
    ConfigError
    """
    if of_a_log(source.data):
        file, line = source.where(("data",))
        given = source.where(())[0] or file  # which may extend the one with the data
        message = f"this configuration is of recorded data: hgorun estimate {given or 'FILE'}"
        raise ConfigError(message, file=file, line=line, key="data")


def of_a_log(data: object) -> bool:
    """Whether a configuration is of recorded data, and lacks what a simulation needs besides."""
    if not isinstance(data, dict) or "data" not in data:
        return False
    time, plant = data.get("time", {}), data.get("plant")
    endless = isinstance(time, dict) and "end" not in time
    return endless or (isinstance(plant, dict) and not {"initial", "type"} & plant.keys())


NOT_OF_A_RUN: dict[str, Any] = {"figures": {}, "claims": (), "tune": None}
PARTS = {"plant", "measurement", "observers"}  # each has a class of its own
_OWN_BLOCKS = {"time", "solver", "metrics", "controller"}  # what is a block already is not checked again


def check_again(source: Source, before: Checked, touched: Collection[KeyPath]) -> Checked:
    """The parts of a configuration that differs from a checked one at some paths: the others stay the same objects.

    Raises
    ------
    ConfigError
    """
    data, keys = source.data, {path[0] for path in touched}
    labels = data.get("observers")
    sound = isinstance(data.get("plant"), dict) and isinstance(labels, dict)
    if not sound or not all(isinstance(block, dict) for block in labels.values()):
        return check(source)
    if keys <= PARTS:
        blocks = before.blocks.model_copy(update={key: data.get(key, {}) for key in PARTS})
    else:
        known = NOT_OF_A_RUN.keys() - keys  # checked before, and no part of a run
        parts = {key: part for key, part in data.items() if key not in known}
        own = {key: getattr(before.blocks, key) for key in _OWN_BLOCKS - keys}
        parts |= {key: block for key, block in own.items() if block is not None}
        blocks = validate(ExperimentBlocks, parts, source, ()).model_copy(update=NOT_OF_A_RUN)
    stale = {path[1] for path in touched if path[0] == "observers" and len(path) > 1}
    if ("observers",) in touched:
        stale = set(labels)
    now = Checked(
        blocks,
        plant_of(source) if "plant" in keys else before.plant,
        validate(Measurement, data.get("measurement", {}), source, ("measurement",))
        if "measurement" in keys
        else before.measurement,
        {
            label: before.observers[label]
            if label in before.observers and label not in stale
            else observer_of(label, block, source)
            for label, block in labels.items()
        },
    )
    with source.located():
        refuse_unused_changes(touched, now.plant, now.observers, now.blocks.controller)
    return now


def plant_of(source: Source) -> Plant:
    """The plant's block, checked by its class.

    Raises
    ------
    ConfigError
    """
    block = source.data["plant"]
    if "type" not in block or block["type"] == "inline":
        if "states" not in block and "dynamics" not in block:
            file, line = source.where(("plant",))
            known = ", ".join(PLANTS.names())
            raise ConfigError(
                f"expected type (one of {known}) or a model: states, dynamics, output{_type_meant(block)}",
                file=file,
                line=line,
                key="plant",
            )
        from hgorun.plants.inline import InlinePlant  # one plant is needed, not two

        return validate(InlinePlant, block, source, ("plant",))
    cls = _find(PLANTS, block["type"], source, ("plant", "type"))
    return validate(cls, block, source, ("plant",))


def _type_meant(block: Mapping[str, Any]) -> str:
    """Of a block without ``type`` the key that stands for it."""
    near = ((key, nearest(str(key), ("type",))) for key in block)
    return next((f"; found {describe(key)}.{told}" for key, told in near if told), "")


def _types_near(label: str) -> str:
    """Types of observers that a label sounds like; two well-known ones where it sounds like none."""
    word = re.sub(r"[^a-z0-9]", "", label.lower())
    near = [name for name in OBSERVERS.names() if len(word) > 1 and name.replace("_", "").startswith(word)]
    found = list(dict.fromkeys(filter(None, [*near, nearest_name(label, OBSERVERS.names())]))) or ["shgo", "ekf"]
    return ", ".join(found[:-1]) + f" or {found[-1]}" if len(found) > 1 else found[0]


def observer_of(label: str, block: dict[str, Any], source: Source) -> AnyObserver:
    """An observer's block, checked by its class.

    Raises
    ------
    ConfigError
    """
    path = ("observers", label)
    file, line = source.where(path)
    if not label or "/" in label or "." in label or len(label) > _LONGEST_LABEL:
        raise ConfigError(
            f"an observer's label has 1 to {_LONGEST_LABEL} characters, without / and .",
            file=file,
            line=line,
            key=source.key(path),
        )
    if label == PLANT:
        message = "an observer cannot be called plant: results and tables call the plant itself that"
        raise ConfigError(message, file=file, line=line, key=source.key(path))
    if "type" not in block:
        others = [name for name in source.data["observers"] if name != label]
        near = nearest(label, others)
        other = f". Or, if another observer of the file is meant:{near}" if near else ""
        named = f"the label {label} is a name of your own, the type one from hgorun list observers, such as"
        raise ConfigError(
            f"type is missing{_type_meant(block) or f': {named} {_types_near(label)}{other}'}",
            file=file,
            line=line,
            key=source.key(path),
        )
    cls = _find(OBSERVERS, block["type"], source, (*path, "type"))
    foreign = {key: error for key in block if (error := _of_others(key, cls, source, path)) is not None}
    if foreign:
        faults = Refusals()
        faults.found += foreign.values()
        unknown = {key: part for key, part in block.items() if key not in cls.model_fields and key not in foreign}
        with faults.of_a_part():
            if unknown:  # alone: what is missing may be meant by the keys of others
                validate(cls, unknown, source, path)
        faults.refuse()
    return validate(cls, block, source, path)


def as_available(observer: AnyObserver, sampled: Callable[[], bool], late: Callable[[], bool]) -> AnyObserver:
    """An observer's block as it is where all outputs are sampled, or a continuous one is late, if that matters."""
    found: AnyObserver = observer
    if isinstance(observer, BySampling) and sampled():
        found = observer.of_samples()
    elif isinstance(observer, ByLateness) and late():
        found = observer.of_late()
    return found


def _of_others(key: str, cls: type[AnyObserver], source: Source, path: tuple[str, ...]) -> ConfigError | None:
    """Where a key is not of this observer and like none of its own: whose it is."""
    if key in cls.model_fields:
        return None
    file, line = source.where((*path, key))
    if key in cls.lacks:
        message = f"there is no {key!r} here: {cls.lacks[key]}"
        return ConfigError(message, file=file, line=line, key=source.key((*path, key)))
    owners = [name for name, other in OBSERVERS.all().items() if key in other.model_fields]
    if owners and not nearest(key, cls.model_fields):
        which = listed(owners, see="hgorun list observers")
        here = listed(cls.model_fields, key, f"hgorun show {source.data[path[0]][path[1]]['type']}")
        message = f"unknown key {key!r}: it is a key of {which}. Known here: {here}"
        return ConfigError(message, file=file, line=line, key=source.key((*path, key)))
    return None


def _find(registry: Registry[T], name: Any, source: Source, path: tuple[str, ...]) -> T:
    try:
        with source.located():
            return registry.find(str(name))
    except KeyError:
        file, line = source.where(path)
        known = registry.names()
        there = listed(known, str(name), f"hgorun list {registry.kind}s")
        raise ConfigError(
            f"no {registry.kind} is called {describe(name)}.{nearest(str(name), known)} Known: {there}",
            file=file,
            line=line,
            key=source.key(path),
        ) from None
