"""Names: built-in things by their file, others by entry point, and what is said when one is no good."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import invalidate_caches
from importlib.machinery import PathFinder
from pathlib import Path
from threading import Event
from typing import TypeGuard

import pytest

from hgorun.errors import HgorunError, PluginWarning
from hgorun.observers.base import OBSERVERS, ContinuousObserver
from hgorun.plants.base import PLANTS
from hgorun.registry import Registry


class Tool:
    pass


def is_tool(thing: object) -> TypeGuard[Tool]:
    return isinstance(thing, Tool)


@pytest.fixture
def tools(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Registry[Tool]]:
    """A package with one file that holds two tools, and a registry of them."""
    package = tmp_path / "toolbox"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "saw.py").write_text(
        "from test_registry import Tool, current\ncurrent[0].add('saw', Tool())\ncurrent[0].add('file', Tool())\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(Path(__file__).parent)
    registry = Registry("tool", package="toolbox", group="test.tools", accepts=is_tool, expected="a Tool")
    sys.modules.setdefault("test_registry", sys.modules[__name__])
    current[:] = [registry]
    yield registry
    for name in [name for name in sys.modules if name.startswith(("toolbox", "stranger"))]:
        del sys.modules[name]


current: list[Registry[Tool]] = []
asked, heard = Event(), Event()


@pytest.fixture
def entry_point(tmp_path: Path) -> Callable[[str, str, str, str], None]:
    def add(group: str, name: str, module: str, text: str) -> None:
        (tmp_path / f"{module}.py").write_text(text)
        info = tmp_path / f"{module}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}:thing\n")

    return add


def test_a_file_may_hold_several(tools: Registry[Tool]) -> None:
    assert isinstance(tools.find("file"), Tool)
    assert tools.names() == ["file", "saw"]


def test_a_thread_that_asks_while_another_imports_gets_all_names(tools: Registry[Tool], tmp_path: Path) -> None:
    (tmp_path / "toolbox" / "adze.py").write_text(
        "from test_registry import Tool, current, asked, heard\n"
        "asked.set()\n"
        "heard.wait(0.1)\n"  # the other thread would have its answer by then, if it did not wait
        "current[0].add('adze', Tool())\n"
    )
    asked.clear()
    heard.clear()
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(tools.names)
        asked.wait()
        second = pool.submit(tools.names)
        second.add_done_callback(lambda _: heard.set())
        assert first.result() == second.result() == ["adze", "file", "saw"]


def test_after_an_interruption_the_rest_is_imported(tools: Registry[Tool], tmp_path: Path) -> None:
    wrench = tmp_path / "toolbox" / "wrench.py"
    wrench.write_text("raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        tools.names()
    wrench.write_text("from test_registry import Tool, current\ncurrent[0].add('wrench', Tool())\n")
    invalidate_caches()
    assert tools.names() == ["file", "saw", "wrench"]


def test_a_file_that_asks_while_it_is_imported_gets_the_names_so_far(tools: Registry[Tool], tmp_path: Path) -> None:
    (tmp_path / "toolbox" / "vice.py").write_text(
        "from test_registry import Tool, current\ncurrent[0].add(' and '.join(current[0].names()), Tool())\n"
    )
    assert tools.names() == ["file", "file and saw", "saw"]


def test_an_unknown_name(tools: Registry[Tool]) -> None:
    with pytest.raises(KeyError):
        tools.find("hammer")
    with pytest.raises(KeyError):
        tools.find("not a name")


def test_other_packages_bring_theirs(tools: Registry[Tool], entry_point: Callable[[str, str, str, str], None]) -> None:
    entry_point("test.tools", "hammer", "stranger", "from test_registry import Tool\nthing = Tool()\n")
    assert isinstance(tools.find("hammer"), Tool)
    assert tools.names() == ["file", "hammer", "saw"]


def test_a_name_that_is_taken_is_not_used_and_said_once(
    tools: Registry[Tool], entry_point: Callable[[str, str, str, str], None], recwarn: pytest.WarningsRecorder
) -> None:
    text = "from test_registry import Tool\nthing = Tool()\n"
    for name, module in (("saw", "stranger"), ("hammer", "stranger_a"), ("hammer", "stranger_b")):
        entry_point("test.tools", name, module, text)
    built_in = tools.find("saw")
    assert tools.find("saw") is built_in
    assert [str(w.message) for w in recwarn] == [
        f"the tool 'saw' of stranger:thing is not used, since the name belongs to {built_in!r} of type Tool: its entry "
        "point needs another name"
    ]
    assert recwarn.pop(PluginWarning)
    assert tools.names() == ["file", "hammer", "saw"]
    (warning,) = recwarn
    assert "the tool 'hammer' of stranger_" in str(warning.message)


def test_what_a_decorator_has_registered_is_what_its_entry_point_names(
    tools: Registry[Tool], entry_point: Callable[[str, str, str, str], None]
) -> None:
    text = "from test_registry import Tool, current\nthing = current[0].add('hammer', Tool())\n"
    entry_point("test.tools", "hammer", "stranger", text)
    found = tools.find("hammer")  # warnings are errors
    assert tools.names() == ["file", "hammer", "saw"]
    assert tools.find("hammer") is found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import no_such_module", "the tool 'hammer' of stranger:thing cannot be loaded: ModuleNotFoundError"),
        ("1/0", "ZeroDivisionError: division by zero"),
        ("x = 1", "cannot be loaded: AttributeError"),
        # the line of the class, not that of the standard library that refuses it
        ("from abc import ABC\n\nclass A(ABC):\n    pass\n\nclass thing(ABC, A):\n    pass", " (stranger.py:6)"),
        ("import json\nthing = json.loads('{')", " (stranger.py:2)"),
        ("thing = 3", "the tool 'hammer' must be a Tool; found 3 of type int"),
    ],
)
def test_a_broken_one_is_reported_to_whoever_asks_for_it(
    text: str, said: str, tools: Registry[Tool], entry_point: Callable[[str, str, str, str], None]
) -> None:
    entry_point("test.tools", "hammer", "stranger", text)
    assert tools.names() == ["file", "saw"]
    with pytest.raises(HgorunError, match="hammer") as caught:
        tools.find("hammer")
    assert said in str(caught.value)


def test_a_name_belongs_to_one(tools: Registry[Tool]) -> None:
    class Mallet:
        pass

    classes: Registry[type] = Registry("class", package="toolbox", group="test", accepts=_is_class, expected="a class")
    classes.add("tool", Tool)
    assert classes.add("tool", Tool) is Tool
    with pytest.raises(HgorunError, match=r"the class 'tool' is the class .*Tool already; .*Mallet needs another name"):
        classes.add("tool", Mallet)
    assert classes.find("tool") is Tool


def test_a_module_that_is_loaded_again_replaces_its_own(tools: Registry[Tool]) -> None:
    classes: Registry[type] = Registry("class", package="toolbox", group="test", accepts=_is_class, expected="a class")
    first, second = (type("Same", (), {}) for _ in range(2))
    classes.add("same", first)
    assert classes.add("same", second) is second
    assert classes.find("same") is second


@pytest.mark.parametrize("registry", [OBSERVERS, PLANTS])
@pytest.mark.parametrize("thing", [3, "shgo", object, print])
def test_what_is_no_observer_or_plant_is_refused(registry: Registry[object], thing: object) -> None:
    with pytest.raises(HgorunError, match=f"the {registry.kind} 'wrong' must be a class derived from"):
        registry.register("wrong")(thing)
    assert "wrong" not in registry.names()


def test_an_observer_with_something_left_to_define_is_refused() -> None:
    class Unfinished(ContinuousObserver):
        """No equations."""

    with pytest.raises(HgorunError, match=r"found the class .*Unfinished: design, equations abstract"):
        OBSERVERS.register("unfinished")(Unfinished)


def _is_class(thing: object) -> TypeGuard[type]:
    return isinstance(thing, type)


@pytest.fixture
def only_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Packages are found in folders alone: libraries that other tests have imported may bring finders of their own."""
    others = [finder for finder in sys.meta_path if not hasattr(finder, "find_distributions") or finder is PathFinder]
    monkeypatch.setattr(sys, "meta_path", others)


@pytest.mark.usefixtures("only_folders")
def test_packages_are_asked_only_where_one_names_the_group(
    tools: Registry[Tool], entry_point: Callable[[str, str, str, str], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def entry_points(*, group: str) -> tuple[()]:
        asked.append(group)
        return ()

    monkeypatch.setattr("importlib.metadata.entry_points", entry_points)
    entry_point("test.other_tools", "axe", "stranger_axe", "thing = 1")
    assert tools.names() == ["file", "saw"]
    assert not asked
    entry_point("test.tools", "hammer", "stranger_hammer", "thing = 1")
    monkeypatch.syspath_prepend(Path(__file__).parent / "simulation")  # another path is looked at again
    tools.names()
    assert asked == ["test.tools"]


@pytest.mark.usefixtures("only_folders")
@pytest.mark.parametrize("kind", ["archive", "egg"])
def test_packages_that_cannot_be_looked_into_are_asked(kind: str, tmp_path: Path) -> None:
    from hgorun.registry import _may_be_in

    assert not _may_be_in("test.tools", (str(tmp_path), str(tmp_path / "nowhere")))
    if kind == "egg":
        (tmp_path / "stranger.egg").mkdir()
        assert _may_be_in("test.tools", (str(tmp_path),))
    else:
        (tmp_path / "stranger.zip").write_bytes(b"")
        assert _may_be_in("test.tools", (str(tmp_path / "stranger.zip"),))
