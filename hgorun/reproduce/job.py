"""The work on one study: its stale runs, then the figures and claims that need them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from hgorun.ensemble.collected.collected import Collected
from hgorun.ensemble.collected.outcome import outcome_of
from hgorun.ensemble.collected.reading import read
from hgorun.ensemble.sweep import Place
from hgorun.errors import ConfigError
from hgorun.figures.page import Page
from hgorun.files import remove_leftovers
from hgorun.reproduce.state import Json, State, number, of_claim, of_figure, of_run
from hgorun.result.result import Result
from hgorun.study.check import check
from hgorun.study.ensembles import carried_out, ensemble_of
from hgorun.study.loading import load_study
from hgorun.study.measured import Numbers, asked_of, beside_metrics, of_members, values_of
from hgorun.study.study import Run, Study
from hgorun.study.theory import theory_of

_OWN = 2.0**34  # bytes of a run's numbers: files made here are read whatever their size
Report = Callable[[float, str], None]


@dataclass(frozen=True)
class Folders:
    """Where everything goes: figures, runs, and the report with its small pictures."""

    figures: Path
    runs: Path
    report: Path

    @classmethod
    def below(cls, output: Path | None) -> Folders:
        """Below a folder that the user names, or below ``results``."""
        if output is None:
            results = Path("results")
            return cls(results / "figures", results / "runs", results)
        return cls(output, output / "runs", output)


@dataclass(frozen=True)
class Job:
    """What is wanted of one study.

    Attributes
    ----------
    path : Path
        The file.
    place : str
        The experiment's path without suffix, or the name of your own file: a folder of the results.
    figures : tuple of str
        Names of those wanted.
    claims : tuple of str
        Ids of those wanted.
    folders : Folders
    width, style : str or None
        Of the page that figures are drawn for; None is what the file says.
    seed : int or None
        In the place of the file's.
    """

    path: Path
    place: str
    figures: tuple[str, ...]
    claims: tuple[str, ...]
    folders: Folders
    width: str | None = None
    style: str | None = None
    seed: int | None = None

    @property
    def group(self) -> str:
        """The publication."""
        return self.place.split("/")[0]


@dataclass
class Outcome:
    """What there is of a job, from this run or an earlier one.

    Attributes
    ----------
    figures : dict of str to list of str
        Files of each figure.
    small : dict of str to str
        A small picture of each, for the report.
    values : dict of str to list of list of float
        Of each claim, by its id, and of each of its inequalities: one value, or one for each member of an ensemble.
    errors : dict of str to float or None
        Integration error of each single run, None where the method's step defines the run.
    troubles : dict of str to list of str
        For each run what is not ok in it, in words.
    refused : dict of str to list of str
        For each figure the lines of theory that are missing, in words.
    """

    figures: dict[str, list[str]] = field(default_factory=dict)
    small: dict[str, str] = field(default_factory=dict)
    values: dict[str, list[list[float]]] = field(default_factory=dict)
    errors: dict[str, float | None] = field(default_factory=dict)
    troubles: dict[str, list[str]] = field(default_factory=dict)
    refused: dict[str, list[str]] = field(default_factory=dict)


class Work:
    """A job with its study and what is stale of it.

    Raises
    ------
    ConfigError
        When something in the file is wrong.
    """

    def __init__(self, job: Job, study: Study | None = None) -> None:
        self.job = job
        study = study or load_study(job.path, seed=job.seed)
        changed = Page.changed(job.width, job.style)
        self.study = replace(study, figures={name: changed(block) for name, block in study.figures.items()})
        self.state = State(job.folders.runs / job.place)

    @property
    def _numbers(self) -> list[int]:
        return [i for i, claim in enumerate(self.study.claims) if claim.id in self.job.claims]

    @cached_property
    def stale_figures(self) -> dict[str, str]:
        """The figures to be drawn, each with the reason why in one phrase."""
        reasons = {name: self.state.why("figures", name, of_figure(self.study, name)) for name in self.job.figures}
        return {name: reason for name, reason in reasons.items() if reason is not None}

    @cached_property
    def stale_claims(self) -> list[int]:
        """Numbers of the claims to be measured."""
        claims = self.study.claims
        return [i for i in self._numbers if not self.state.holds("claims", claims[i].id, of_claim(self.study, i))]

    @property
    def done(self) -> bool:
        """Whether there is nothing to do."""
        return not self.stale_figures and not self.stale_claims

    def outcome(self) -> Outcome:
        """What there is, once everything is done."""
        found = Outcome()
        for name in self.job.figures:
            files = [os.path.normpath(self.state.folder / f) for f in self.state.files("figures", name)]
            found.figures[name], found.small[name] = files[:-1], files[-1]
            found.refused[name] = _words(self.state.data["figures"][name].get("refused"))
        for i in self._numbers:
            claim = self.study.claims[i]
            found.values[claim.id] = self.state.values("claims", claim.id)
        for run in self._runs(self.job.figures, self._numbers):
            entry = self.state.data["runs"].get(run.name)
            if entry is None:
                continue
            found.troubles[run.name] = _words(entry.get("troubles"))
            if run.single:
                error = entry.get("integration_error")
                found.errors[run.name] = None if error is None else number(error)
        return found

    def _runs(self, figures: Iterable[str], claims: Iterable[int]) -> list[Run]:
        names = [run for figure in figures for run in self.study.runs_of(figure)]
        names += [run for i in claims for q in self.study.quantities(i) for run, _ in q.of]
        return [self.study.runs[name] for name in dict.fromkeys(names)]

    def run(self, report: Report = lambda part, what: None, *, threads: int | None = None) -> Outcome:
        """Do what is stale.

        Parameters
        ----------
        report : callable
            Told which part of the job is done, 0 to 1, and what is being done.
        threads : int, optional
            That carry members of ensembles out; by default one a processor.
        """
        for folder in (self.state.folder, self.state.folder / "small", self._figure_folder):
            remove_leftovers(folder)
        check(self.study)
        runs = self._runs(self.stale_figures, self.stale_claims)
        total = len(runs) + len(self.stale_figures)
        results: dict[str, Result] = {}
        ensembles: dict[str, Numbers] = {}
        members: dict[str, Collected] = {}
        for i, run in enumerate(runs):

            def inside(part: float, i: int = i, run: Run = run) -> None:
                report((i + part) / total, run.name)

            inside(0.0)
            if run.single:
                results[run.name] = self._single(run, inside)
            else:
                members[run.name], ensembles[run.name] = self._ensemble(run, inside, threads)
        for i, name in enumerate(self.stale_figures):
            report((len(runs) + i) / total, f"figure {name}")
            self._draw(name, results, ensembles, members)
        theory = theory_of(self.study, results)
        for i in self.stale_claims:
            with self.study.located():
                values = values_of(self.study, i, results, ensembles, theory)
            claim = self.study.claims[i].id
            self.state.note("claims", claim, of_claim(self.study, i), values=[list(part) for part in values])
        self.__dict__.pop("stale_figures", None)
        self.__dict__.pop("stale_claims", None)
        return self.outcome()

    def _single(self, run: Run, report: Callable[[float], None]) -> Result:
        """The run's result, from its file where that still stands."""
        from hgorun.result.reading import read as read_result
        from hgorun.simulation.simulate import prepare, simulate_prepared

        file, made_of = f"{run.name}.h5", of_run(run)
        if self.state.holds("runs", run.name, made_of):
            try:
                return read_result(self.state.folder / file, max_memory=_OWN)
            except ConfigError:  # cut short or damaged: made again
                pass
        prepared = prepare(run.experiment)
        # Euler's step belongs to the definition of a run: shorter ones would be another run
        check = run.experiment.blocks.solver.method != "euler" and not prepared.adaptive
        result = simulate_prepared(prepared, check_step=check, progress=report)
        result.save(self.state.folder / file)
        errors = result.integration_error
        self.state.note(
            "runs",
            run.name,
            made_of,
            files=[file],
            integration_error=max(errors.values()) if errors else None,
            troubles=[*result.troubles()],
        )
        return result

    def _ensemble(self, run: Run, report: Callable[[float], None], threads: int | None) -> tuple[Collected, Numbers]:
        """A run's members, carried out as far as they are missing, and their numbers.

        Whatever the file asks of them is measured, so that it does not matter what of it is made first.
        """
        study = self.study
        everything = asked_of(study, run.name, range(len(study.claims)), list(study.figures))
        drawn = any(run.name in study.followed(figure).values() for figure in study.figures)
        ensemble = ensemble_of(run, beside_metrics(everything), followed="some" if drawn else "none")
        place = Place.of(self.state.folder / f"{run.name}.sweep.h5")
        carried_out(ensemble, place, lambda count: report(count.done / count.members), workers=threads)
        found = read(place.file, max_memory=_OWN)
        numbers = of_members(run, ensemble, found, everything)
        self.state.note("runs", run.name, of_run(run), troubles=[*outcome_of(place.file).troubles()])
        return found, numbers

    @property
    def _figure_folder(self) -> Path:
        return self.job.folders.figures / self.job.group

    def _draw(
        self,
        name: str,
        results: Mapping[str, Result],
        ensembles: Mapping[str, Numbers],
        members: Mapping[str, Collected],
    ) -> None:
        from hgorun.figures.drawing import draw
        from hgorun.figures.files import save, thumbnail
        from hgorun.study.scaling import members_data, refused, scaling_data

        shown = [results[run] for run in self.study.runs_of(name) if run in results]
        scalings = scaling_data(self.study, name, ensembles)
        followed = {i: members_data(self.study.runs[run], members[run]) for i, run in self.study.followed(name).items()}
        block = self.study.figures[name]
        known = {text for r in shown for label in r.observers for text in (label, f"{r.name}/{label}")}
        theirs = [(one.run, list(one.observers)) for one in scalings.values()]
        theirs += [(one.run, list(one.observers)) for one in followed.values()]
        known |= {text for run, labels in theirs for label in labels for text in (label, f"{run}/{label}")}
        # a legend may name an observer that no panel shows
        block = block.model_copy(update={"labels": {k: v for k, v in block.labels.items() if k in known}})
        figure = draw(shown, block, name, scalings=scalings, members=followed)
        written = save(figure, self._figure_folder / name)
        written.append(thumbnail(figure, self.state.folder / "small" / f"{name}.png"))
        files = [relative(path, self.state.folder) for path in written]
        self.state.note(
            "figures", name, of_figure(self.study, name), files=list(files), refused=list(refused(scalings))
        )


def _words(found: Json) -> list[str]:
    return [str(words) for words in found] if isinstance(found, list) else []


def relative(path: Path, folder: Path) -> str:
    """A path as seen from a folder: results may be moved as a whole."""
    return Path(os.path.relpath(path, folder)).as_posix()
