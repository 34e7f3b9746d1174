"""The rooms of the package and who may import whom: rooms import rooms of lower floors, and no files go in a circle.

Imports inside functions and for type checkers count: whoever reads a file has to know what they name.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

pytestmark = pytest.mark.unmeasured  # sources are read, nothing of the package runs

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "hgorun"
PAGE = ROOT / "docs" / "architecture.md"

# From the ground up. A room may import the rooms of lower floors; rooms of one floor do not know each other.
FLOORS: list[set[str]] = [
    {"errors", "originals", "patterns", "process", "version"},
    {"ahead", "code", "files", "markup", "memo", "native", "pieces", "progress", "registry"},
    {"config"},
    {"symbolic"},
    {"plants", "observers", "noise", "engine"},
    {"measurement"},
    {"result"},
    {"data"},
    {"simulation"},
    {"analysis", "ensemble", "estimate", "testing"},
    {"tables"},
    {"export", "figures"},
    {"explore", "interop", "study"},
    {"benchmark", "reproduce", "tuning"},
    {"hgorun"},  # __init__.py, what `import hgorun` offers
    {"commands"},
    {"cli"},
    {"__main__"},
]
ANALYSIS_FLOORS: list[set[str]] = [
    {"chains", "reasons"},
    {"subject"},
    {"finding"},
    {"linear"},
    {"excitation"},
    {"convergence", "noise", "papers", "search", "stability"},
    {"findings"},
    {"report"},
]
DATA_FLOORS: list[set[str]] = [
    {"number_signs", "samples", "times"},
    {"cells", "recording"},
    {"table", "told_once", "units"},
    {"clocks", "column_meant", "in_turn", "lengths", "tags"},
    {"odd_clocks"},
    {"faults"},
    {"csv", "input_ends"},
    {"arrays"},
    {"files"},
    {"sources"},
    {"far_dates", "parts"},
    {"clock_texts", "model_units"},
    {"one_clock"},
    {"reading"},
]
ESTIMATE_FLOORS: list[set[str]] = [
    {"holdout", "intervals", "samples", "stated_of_data", "steps"},
    {"covariance", "refused", "twins"},
    {"prepared"},
    {"sessions", "start"},
    {"completed", "gate"},
    {"carrying", "log", "stream"},
    {"scores"},
    {"estimate", "gains"},
    {"long"},
]
SIMULATION_FLOORS: list[set[str]] = [
    {"design"},
    {"system", "timeline"},
    {"experiment", "plant_alone"},
    {"prepared", "remarks"},
    {"checks", "error_dynamics"},
    {"passes", "preparation"},
    {"divergence", "known", "outcome"},
    {"error_control"},
    {"long_run"},
    {"simulate"},
]
RESULT_FLOORS: list[set[str]] = [
    {"hdf5", "records", "windows"},
    {"labelled", "metrics", "run_names"},
    {"evaluation", "file", "notebook"},
    {"result"},
    {"quantities", "reading"},
]
ENSEMBLE_FLOORS: list[set[str]] = [
    {"found", "members"},
    {"collected", "preparation"},
    {"side_by_side", "statistics"},
    {"blocks", "notebook"},
    {"executors", "folder"},
    {"cluster", "collecting", "growing"},
    {"sweep"},
    {"call"},
]
# (importing file, imported room): why it points upwards. At most three.
EXCEPTIONS = {
    ("result/result.py", "figures"): "Result.plot() draws the default figure; imported when it is called",
}


def floor_of(floors: list[set[str]]) -> dict[str, int]:
    return {room: floor for floor, rooms in enumerate(floors) for room in rooms}


def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imports(path: Path) -> Iterator[str]:
    """The package's modules that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "hgorun":
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield inner if inner in MODULES else node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "hgorun")


@cache
def graph() -> dict[str, set[str]]:
    """What each module imports; not made by those that only collect tests."""
    return {name: {m for m in imports(path) if m != name} for name, path in MODULES.items()}


def room_of(module: str, package: str = "hgorun") -> str:
    """The part of a module's name behind the package's; the package itself for its ``__init__``."""
    return module.removeprefix(package).strip(".").split(".")[0] or package


def arrows(package: str) -> dict[tuple[str, str], set[str]]:
    """(room, room) and the files whose imports go from the one to the other, inside a package."""
    found: dict[tuple[str, str], set[str]] = {}
    for name, targets in graph().items():
        for target in targets:
            if not (f"{name}.".startswith(f"{package}.") and f"{target}.".startswith(f"{package}.")):
                continue
            pair = room_of(name, package), room_of(target, package)
            if pair[0] != pair[1]:
                file = MODULES[name].relative_to(PACKAGE).as_posix()
                found.setdefault(pair, set()).add(file)
    return found


def upward(package: str, floors: list[set[str]]) -> set[tuple[str, str]]:
    floor = floor_of(floors)
    return {
        (file, there)
        for (here, there), files in arrows(package).items()
        if floor[there] >= floor[here]
        for file in files
    }


def circles() -> list[set[str]]:
    """Sets of files that import each other, directly or by way of others."""

    def reach(start: str) -> set[str]:
        seen: set[str] = set()
        waiting = list(graph()[start])
        while waiting:
            name = waiting.pop()
            if name not in seen and name in graph():
                seen.add(name)
                waiting += graph()[name]
        return seen

    reached = {name: reach(name) for name in graph()}
    found: list[set[str]] = []
    for name, beyond in reached.items():
        if name in beyond and not any(name in circle for circle in found):
            found.append({other for other in beyond if name in reached[other]})
    return found


def test_every_room_has_a_floor() -> None:
    rooms = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert rooms - {"__init__"} == set(floor_of(FLOORS)) - {"hgorun"}


def test_imports_run_downwards() -> None:
    assert sorted(upward("hgorun", FLOORS) - set(EXCEPTIONS)) == []


@pytest.mark.parametrize(
    ("room", "floors"),
    [
        ("analysis", ANALYSIS_FLOORS),
        ("data", DATA_FLOORS),
        ("ensemble", ENSEMBLE_FLOORS),
        ("estimate", ESTIMATE_FLOORS),
        ("result", RESULT_FLOORS),
        ("simulation", SIMULATION_FLOORS),
    ],
)
def test_rooms_inside_of_a_room_import_downwards(room: str, floors: list[set[str]]) -> None:
    inner = [{f"hgorun.{room}"}, *floors]
    assert sorted(upward(f"hgorun.{room}", inner)) == []


def test_exceptions_are_few_and_up_to_date() -> None:
    assert sorted(set(EXCEPTIONS) - upward("hgorun", FLOORS)) == []
    assert len(EXCEPTIONS) <= 3


def test_no_circle_of_files() -> None:
    assert [sorted(circle) for circle in circles()] == []


@pytest.mark.parametrize("package", [p.name for p in PACKAGE.iterdir() if (p / "__init__.py").exists()])
def test_a_room_says_what_it_is(package: str) -> None:
    assert ast.get_docstring(ast.parse((PACKAGE / package / "__init__.py").read_text(encoding="utf-8")))


def test_the_page_shows_the_floors() -> None:
    """docs/architecture.md has a table of floors from the top down, equal to the one here."""
    rows = re.findall(r"^\| (\d+) \| (.+?) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    shown = {int(floor): set(re.findall(r"`(\w+)`", rooms)) for floor, rooms in rows}
    assert shown == dict(enumerate(FLOORS))


def test_the_page_names_what_exists() -> None:
    text = PAGE.read_text(encoding="utf-8")
    paths = re.findall(r"`((?:hgorun|tests|docs|tools|experiments)/[\w./]*)`", text)
    assert paths
    assert [p for p in paths if not (ROOT / p).exists()] == []


def test_files_of_tests_have_names_of_their_own() -> None:
    """Tests are in no package: of two files that are called alike only one is checked by mypy, or imported."""
    names = Counter(path.name for path in Path(__file__).parent.rglob("*.py"))
    assert [name for name, count in names.items() if count > 1] == []
