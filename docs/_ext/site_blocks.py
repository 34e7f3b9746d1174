"""The reference of the configuration: the keys of every block, from the models that check them."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import BaseModel
from site_markdown import keys_table, plain

from hgorun.commands.described import keys_of, own_doc
from hgorun.config.benchmark import BenchmarkFile
from hgorun.config.controller import Controller
from hgorun.config.data import Data
from hgorun.config.models import File, Metrics, Solver, Time
from hgorun.config.study import Claim, Ensemble, Figure
from hgorun.config.sweeps import SweepFile
from hgorun.config.tuning import TuneFile
from hgorun.measurement.blocks import Measurement
from hgorun.observers.keys import Keys
from hgorun.plants.base import Plant
from hgorun.plants.inline import InlinePlant

BLOCKS: tuple[tuple[str, type[BaseModel], str], ...] = (
    ("time", Time, ""),
    ("plant", Plant, "The keys of every plant. [The page of a built-in plant](plants.md) has its own keys."),
    ("plant, written in place", InlinePlant, ""),
    ("measurement", Measurement, "Kinds of noise are on [a page of their own](noise.md)."),
    ("observers", Keys, "The keys of every observer. [The page of an observer](observers.md) has its own keys."),
    ("controller", Controller, "Explained in [closed loops](../closed_loop.md)."),
    ("data", Data, "Explained in [recordings](../recordings.md)."),
    ("solver", Solver, "Explained in [how a run is computed](../numerics.md)."),
    ("metrics", Metrics, ""),
    ("runs: an ensemble", Ensemble, "What an entry of `runs` may hold beside the keys that it changes."),
    ("figures", Figure, ""),
    ("claims", Claim, ""),
    ("sweep files", SweepFile, "Explained in [sweeps](../sweeps.md)."),
    ("tune", TuneFile, "Explained in [tuning](../tuning.md)."),
    ("benchmark files", BenchmarkFile, "Explained in [the benchmark](../benchmark.md)."),
)
_HEAD = """# Configuration reference

Every key of every block, with its default and range, made from the models that check a configuration.
[Configuration](../configuration.md) explains the keys. Keys of mappings inside a block are written with a dot."""


def reference_page() -> str:
    """All blocks, one after the other."""
    return "\n\n".join(part for part in _parts() if part) + "\n"


def _parts() -> Iterator[str]:
    yield _HEAD
    yield "## Top level"
    yield keys_table(keys_of(File), without={title for title, _, _ in BLOCKS})
    for title, model, text in BLOCKS:
        yield f"## {title}"
        yield plain(own_doc(model).split("\n\n")[0].replace("\n", " "))
        yield text
        yield keys_table(keys_of(model))
