"""A file as a whole: its runs, alone or as ensembles, the figures drawn from them and the claims they decide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from hgorun.config.expressions import ExpressionError, parse
from hgorun.config.named import name_keys
from hgorun.config.refusals import Refusals
from hgorun.config.study import Claim, Ensemble, Figure, StudyBlocks
from hgorun.config.validation import validate
from hgorun.config.yaml_builder import Place
from hgorun.config.yaml_source import Source
from hgorun.ensemble.members.members import written_out
from hgorun.errors import ConfigError
from hgorun.noise.base import RandomNoise
from hgorun.result.quantities.quantity import Quantity
from hgorun.simulation.experiment.experiment import Experiment
from hgorun.simulation.preparation.other_faults import check_parts
from hgorun.study.claimed import check_values, sentences_of
from hgorun.study.sentences import Sentence
from hgorun.study.split import OF_THE_FILE, check_ensemble, parts


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """One run of a study, or an ensemble of them.

    Attributes
    ----------
    name : str
    source : Source
        Its configuration, of the first member of an ensemble.
    text : str
        The file as it was written.
    ensemble : Ensemble
        Neither seeds nor vary: a single run.
    places : mapping of str to (file, line)
        Where each path of ``vary.set`` was written.
    """

    name: str
    source: Source
    text: str
    ensemble: Ensemble = field(default_factory=Ensemble)
    places: Mapping[str, Place] = field(default_factory=dict)

    @property
    def single(self) -> bool:
        """Whether it is one run, whose trajectories are kept."""
        return not self.ensemble.kind

    @property
    def labels(self) -> tuple[str, ...]:
        """Of its observers, as far as these are a mapping; what is wrong with them is said elsewhere."""
        observers = self.source.data.get("observers") if isinstance(self.source.data, dict) else None
        return tuple(map(str, observers)) if isinstance(observers, dict) else ()

    @cached_property
    def drawn(self) -> bool:
        """Whether its numbers change with the seed: of noise, or of when samples are taken."""
        stretches = (s for output in self.experiment.stretches for s in output)
        return any(s.sampled_by_chance or any(isinstance(n, RandomNoise) for n in s.noise) for s in stretches)

    @cached_property
    def base(self) -> Experiment:
        """The run, or what all members of the ensemble are variations of."""
        return Experiment(self.source, name=self.name, text=self.text)

    @cached_property
    def experiment(self) -> Experiment:
        """The run, or the first member of the ensemble."""
        return next(self.of_values())

    @property
    def values(self) -> tuple[float, ...]:
        """What ``vary`` varies; nothing without it."""
        return () if self.ensemble.vary is None else self.ensemble.vary.values

    @property
    def seeds(self) -> range:
        """The seeds of the members; that of the base alone without ``seeds``."""
        first = self.base.blocks.seed
        return range(first, first + (self.ensemble.seeds or 1))

    @property
    def one_grid(self) -> bool:
        """Whether all members have the same output grid."""
        vary = self.ensemble.vary
        return vary is None or not any(path.partition(".")[0] == "time" for path in vary.set)

    @property
    def shape(self) -> tuple[int, int]:
        """How many values and how many seeds there are, one at least; every seed is carried out with every value."""
        return len(self.values) or 1, len(self.seeds)

    def members(self) -> Iterator[Experiment]:
        """All members, value after value; a single run is the only member of itself."""
        for experiment in self.of_values():
            if self.ensemble.seeds is None:
                yield experiment
            else:
                yield from (experiment.varied({"seed": seed}) for seed in self.seeds)

    def of_values(self) -> Iterator[Experiment]:
        """A member for every value, with the first seed."""
        if not self.values:
            yield self.base
        for value in self.values:
            changes = self.changes(value)
            try:
                yield self.base.varied(
                    {place: number for path, number in changes.items() for place in written_out(self.base, path)}
                )
            except ConfigError as error:
                path = next((p for p in changes if p in self.places and _begins_with(error.key or p, p)), None)
                if path is None:
                    raise
                raise self.wrong(path, f"{error.message} (for the value {value:g})") from error

    def changes(self, value: float) -> dict[str, float]:
        """What members with a value of ``vary`` change of the base, by path."""
        vary = self.ensemble.vary
        assert vary is not None
        found: dict[str, float] = {}
        for path, expression in vary.set.items():
            try:
                found[path] = parse(expression, names=[vary.name]).number({vary.name: value})
            except ExpressionError as error:
                raise self.wrong(path, str(error)) from error
        return found

    def wrong(self, path: str, message: str) -> ConfigError:
        """A fault of a path of ``vary``, with its place in the file."""
        file, line = self.places[path]
        return ConfigError(message, file=file, line=line, key=f"runs.{self.name}.vary.set.{path}")


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """A configuration file.

    Attributes
    ----------
    name : str
        The stem of the file.
    title, reference : str
    runs : mapping of str to Run
        A file without ``runs:`` is one run called by its stem.
    figures : mapping of str to Figure
    claims : tuple of Claim
    sentences : tuple of tuple of Sentence
        What decides each claim: its own value, if it has one, and those of the alternatives.
    """

    name: str
    source: Source
    title: str
    reference: str
    runs: Mapping[str, Run]
    figures: Mapping[str, Figure]
    claims: tuple[Claim, ...]
    sentences: tuple[tuple[Sentence, ...], ...]

    def __post_init__(self) -> None:
        name_keys(self, runs="run", figures="figure")

    def quantities(self, claim: int) -> tuple[Quantity, ...]:
        """All that has to be measured for a claim, without doubles."""
        return tuple(dict.fromkeys(q for sentence in self.sentences[claim] for q in sentence.quantities))

    def drawn(self, claim: int) -> tuple[bool, ...]:
        """Of each of its values, whether a run that it is measured on is random; the analysis is not."""
        measured = [[q for q in sentence.quantities if q.function != "analysis"] for sentence in self.sentences[claim]]
        return tuple(any(self.runs[run].drawn for q in own for run, _ in q.of) for own in measured)

    def runs_of(self, figure: str) -> list[str]:
        """Names of the runs that a figure shows."""
        names: dict[str, None] = {}
        for panel in self.figures[figure].panels:
            scaled = None if panel.scaling is None else panel.scaling.run or self._only_ensemble()
            if panel.run or scaled:
                names[str(panel.run or scaled)] = None
            elif panel.observers is None:
                names |= dict.fromkeys(n for n, run in self.runs.items() if run.single)
            else:
                for label in panel.observers:
                    run, _, _ = label.rpartition("/")
                    names |= dict.fromkeys([run] if run else [n for n, r in self.runs.items() if r.single])
        return list(names)

    def _only_ensemble(self) -> str:
        return next(name for name, run in self.runs.items() if run.ensemble.vary is not None)

    def scaled(self, figure: str) -> dict[int, tuple[str, list[Quantity]]]:
        """For each scaling panel of a figure: its run, and the quantity of each observer shown."""
        found = {}
        for i, panel in enumerate(self.figures[figure].panels):
            if panel.scaling is None:
                continue
            run = panel.scaling.run or self._only_ensemble()
            labels = [label.rpartition("/")[2] for label in panel.observers or self.runs[run].source.data["observers"]]
            found[i] = run, [Quantity(panel.scaling.of, ((run, label),), panel.scaling.state) for label in labels]
        return found

    def followed(self, figure: str) -> dict[int, str]:
        """For each panel of a figure that shows trajectories of an ensemble: its run."""
        panels = enumerate(self.figures[figure].panels)
        return {i: p.run for i, p in panels if p.scaling is None and p.run and not self.runs[p.run].single}

    def located(self) -> AbstractContextManager[None]:
        """Turn a problem at a key into an error that names file, line and key."""
        return self.source.located()


def study_of(source: Source, name: str, text: str) -> Study:
    """The study of a configuration; names in it are checked by :func:`hgorun.study.check.check`."""
    data: dict[str, Any] = source.data if isinstance(source.data, dict) else {}
    of_file = ("title", "reference", *OF_THE_FILE)
    given = {key: data[key] for key in of_file if key in data}
    faults = Refusals()
    blocks = StudyBlocks.model_construct()
    with faults.of_a_part():
        if given:  # a schema of figures and claims takes longer to build than anything else here: a run asks for none
            blocks = validate(StudyBlocks, given, source, ())
    runs = _runs(source, name, text, faults)
    labels = dict.fromkeys(label for run in runs.values() for label in run.labels)
    if faults.found:  # what else is wrong is said with it
        check_values(data.get("claims"), tuple(runs), labels, source, faults)
    sentences = () if faults.found else sentences_of(blocks.claims, tuple(runs), labels, source, faults)
    for run in runs.values() if faults.found else ():
        with faults.of_a_part():
            check_parts(run.base)
    faults.refuse()
    return Study(name, source, blocks.title, blocks.reference, runs, blocks.figures, blocks.claims, sentences)


def _runs(source: Source, name: str, text: str, faults: Refusals) -> dict[str, Run]:
    """The runs of a file, those without faults."""
    if not isinstance(source.data, dict) or "runs" not in source.data:
        return {name: Run(name, source, text)}
    runs: dict[str, Run] = {}
    for run, (own, ensemble) in parts(source, faults).items():
        with faults.of_a_part():
            block = validate(Ensemble, ensemble, source, ("runs", run))
            check_ensemble(block, own, source, run)
            assigned = block.vary.set if block.vary is not None else {}
            places = {path: source.where(("runs", run, "vary", "set", path)) for path in assigned}
            runs[run] = Run(run, own, text, block, places)
    return runs


def _begins_with(key: str, path: str) -> bool:
    """Whether a key is that of a path of ``vary``, or below it; ``observers.*`` is any observer."""
    parts = key.split(".")
    return all(wanted in (own, "*") for own, wanted in zip(parts, path.split("."), strict=False))
