"""Which code a run, a figure and a claim follow from: its meaning, and only their own rooms."""

import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from test_architecture import EXCEPTIONS, MODULES, graph, room_of
from test_architecture import PACKAGE as SOURCE

from hgorun import code as subject
from hgorun.code import ENSEMBLE, FIGURE, QUANTITY, RUN, SCALING, THEORY, meaning
from hgorun.reproduce import state
from hgorun.study.loading import load_study
from hgorun.study.study import Study

FUNCTION = '''
"""A module."""
import math

def area(radius: float) -> float:
    """Of a circle."""
    return math.pi * radius**2
'''

STUDY = """
title: A study
time: {end: 1, output_step: 0.1}
plant: {type: integrator_chain, n: 2, phi: -x1, initial: {x1: 1, x2: 0}}
observers: {A: {type: shgo, theta: 2}}
solver: {step: 0.1}
runs: {one: {}, other: {seed: 1}}
figures: {first: {panels: [{state: x1, observers: [one/A]}]}}
claims:
  - {id: "1", claim: Small., value: "rmse('one/A', x1)", below: 1}
  - {id: "2", claim: Slow., value: "analysis('one/A', poles)", below: 1}
"""


@pytest.mark.parametrize(
    "other",
    [
        FUNCTION + "# a comment\n",
        FUNCTION.replace('    """Of a circle."""\n', ""),
        FUNCTION.replace("A module.", "Something else."),
        FUNCTION.replace("radius**2", "(\n        radius\n        ** 2\n    )"),
        FUNCTION.replace("    return", "    # first\n\n    return"),
    ],
)
def test_comments_docstrings_and_formatting_mean_nothing(other: str) -> None:
    assert meaning(other) == meaning(FUNCTION)


@pytest.mark.parametrize(
    "other",
    [
        FUNCTION.replace("radius**2", "radius**3"),
        FUNCTION.replace("radius**2", "radius**2.0"),
        FUNCTION.replace("radius**2", "(math.pi * radius)**2").replace("math.pi * (", "("),
        FUNCTION + "area = None\n",
        FUNCTION.replace("def area", "@staticmethod\ndef area"),
        FUNCTION.replace("def area", "async def area"),
        FUNCTION.replace("radius: float)", "radius: float, /)"),
    ],
)
def test_all_else_has_a_meaning(other: str) -> None:
    assert meaning(other) != meaning(FUNCTION)


# What is used by all and computes nothing: messages, files, names. How a configuration is read shows in what was read.
# Units convert numbers of logs alone.
WITHOUT_NUMBERS = {
    "hgorun.config.date_letters",
    "hgorun.config.date_signs",
    "hgorun.config.kinds",
    "hgorun.config.misdirected",
    "hgorun.config.named",
    "hgorun.config.nearest",
    "hgorun.config.separators",
    "hgorun.config.overrides",
    "hgorun.config.paths",
    "hgorun.config.plugin",
    "hgorun.config.reading",
    "hgorun.config.refusals",
    "hgorun.config.time_units",
    "hgorun.config.validation",
    "hgorun.config.yaml_builder",
    "hgorun.config.yaml_errors",
    "hgorun.config.yaml_source",
    "hgorun.data.units.unit_per_time",
    "hgorun.data.units.units",
    "hgorun.code",
    "hgorun.errors",
    "hgorun.files",
    "hgorun.markup",
    "hgorun.originals",
    "hgorun.process",
    "hgorun.registry",
    "hgorun.study.varied_paths",
    "hgorun.version",
}


def modules_of(parts: tuple[str, ...]) -> set[str]:
    places = [SOURCE / part for part in parts]
    return {name for name, path in MODULES.items() if any(path.is_relative_to(place) for place in places)}


@pytest.mark.unmeasured
@pytest.mark.parametrize(
    "groups",
    [
        (RUN,),
        (RUN, ENSEMBLE),
        (RUN, FIGURE),
        (RUN, QUANTITY),
        (RUN, QUANTITY, THEORY),
        (RUN, FIGURE, QUANTITY, SCALING, THEORY),
    ],
)
def test_what_code_imports_is_hashed_with_it(groups: tuple[tuple[str, ...], ...]) -> None:
    own = modules_of(sum(groups, ()))
    beside = {"hgorun.study.study", "hgorun.study.split", *WITHOUT_NUMBERS}  # which runs there are is hashed itself
    missing = {
        (name, target)
        for name in own
        for target in graph()[name] - own - beside
        if (MODULES[name].relative_to(SOURCE).as_posix(), room_of(target)) not in EXCEPTIONS
        and MODULES[target].read_text().count("\n") > 1
    }
    assert sorted(missing) == [], "name these files in code.py, or here if no number follows from them"


def test_every_part_named_is_there() -> None:
    parts = (*RUN, *ENSEMBLE, *FIGURE, *QUANTITY, *SCALING, *THEORY)
    assert [part for part in parts if not (SOURCE / part).exists()] == []


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A copy of the package whose files may be edited."""
    copy = tmp_path / "hgorun"
    shutil.copytree(SOURCE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(subject, "PACKAGE", copy)
    monkeypatch.setattr(subject, "meaning", cache(meaning))  # most files stay as they are
    yield copy
    forget()


def forget() -> None:
    subject._digest.cache_clear()
    state._code.cache_clear()


def changes(study: Study, package: Path, file: str, text: str) -> list[str | None]:
    """What an edit changes in a run, a figure, a claim of the run's metrics, and one of its theory."""

    def ingredients() -> list[state.Ingredients]:
        forget()
        claims = [state.of_claim(study, i) for i in range(2)]
        return [state.of_run(study.runs["one"]), state.of_figure(study, "first"), *claims]

    before, path = ingredients(), package / file
    path.write_text(path.read_text() + text)
    return [state.difference(old, new) for old, new in zip(before, ingredients(), strict=True)]


@pytest.mark.costly
def test_an_edit_makes_stale_what_follows_from_it(package: Path, tmp_path: Path) -> None:
    (tmp_path / "study.yaml").write_text(STUDY)
    study = load_study(tmp_path / "study.yaml")
    for file in ("cli.py", "commands/figures.py", "reproduce/pool.py", "config/yaml_errors.py", "tables/metrics.py"):
        assert changes(study, package, file, "\nADDED = 1\n") == [None] * 4
    for file in ("cli.py", "engine/emit.py", "figures/drawing.py", "study/sentences.py", "analysis/report.py"):
        assert changes(study, package, file, "\n# a comment\n") == [None] * 4
    assert changes(study, package, "engine/emit.py", "\nADDED = 1\n") == ["engine changed"] * 4
    assert changes(study, package, "observers/shgo.py", "\nADDED = 1\n") == ["observers changed"] * 4
    assert changes(study, package, "figures/drawing.py", "\nADDED = 1\n") == [None, "figures changed", None, None]
    assert changes(study, package, "study/sentences.py", "\nADDED = 1\n") == [None, None] + ["study changed"] * 2
    assert changes(study, package, "analysis/report.py", "\nADDED = 1\n") == [None] * 3 + ["analysis changed"]


def test_the_first_thing_that_differs_is_named() -> None:
    old = {"hgorun": "0.1.0", "engine": "a", "figures": "b", "configuration of run one": "c", "the figure's block": "d"}
    assert state.difference(old, dict(reversed(old.items()))) is None
    assert state.difference(old, old | {"the figure's block": "x"}) == "the figure's block changed"
    config = old | {"configuration of run one": "x", "the figure's block": "x"}
    assert state.difference(old, config) == "configuration of run one changed"
    assert state.difference(old, config | {"engine": "x"}) == "engine changed"
    assert state.difference(old, old | {"engine": "x", "figures": "x"}) == "engine and figures changed"
    assert state.difference(old, config | {"engine": "x", "hgorun": "0.2.0"}) == "hgorun 0.1.0 -> 0.2.0"
    assert state.difference(old, old | {"configuration of run two": "x"}) == "configuration of run two changed"
    assert state.difference({}, old) == "hgorun unknown -> 0.1.0"


def test_a_module_of_another_distribution_is_not_beside_though_it_lies_there() -> None:
    assert subject._beside("numpy", "numpy")
    assert not subject._beside("numpy", "scipy")
    assert not subject._beside("json", "scipy")
    assert not subject._beside("hgorun", "numpy")
