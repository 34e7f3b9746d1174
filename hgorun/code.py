"""Which code a run, an ensemble, a figure and a claim follow from, by room, as hashes of its meaning.

Comments, docstrings and the way a line is broken have no part in them: what a run computes does not follow from these.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent

# Rooms or files of the package. How a configuration is read is left out of all of them: what is read, with its
# defaults, is hashed itself.
RUN = (
    "config/controller.py",
    "config/data.py",
    "config/evaluation.py",
    "config/expressions.py",
    "config/grammar.py",
    "config/literals.py",
    "config/models.py",
    "config/reads.py",
    "config/study.py",
    "config/tokens.py",
    "config/tuning.py",
    "config/types.py",
    "engine",
    "measurement",
    "memo.py",
    "native",
    "noise",
    "observers",
    "patterns.py",
    "pieces.py",
    "plants",
    "result",
    "simulation",
    "symbolic",
)
ENSEMBLE = ("config/sweeps.py", "ensemble")
FIGURE = (
    "ensemble/collected/collected.py",
    "ensemble/statistics",
    "figures",
    "tables/axis_names.py",
    "tables/typeset.py",
)
QUANTITY = (*ENSEMBLE, "study/ensembles.py", "study/measured.py", "study/sentences.py")
SCALING = ("study/scaling.py",)
THEORY = ("analysis", "study/theory.py")


def code(parts: Sequence[str], *, exact: bool = False) -> dict[str, str]:
    """{room: hash} of rooms and files of the package.

    Parameters
    ----------
    exact : bool
        Of their bytes and not of their meaning, which takes a hundred times as long to find.
    """
    rooms: dict[str, list[str]] = {}
    for part in parts:
        rooms.setdefault(part.split("/")[0].removesuffix(".py"), []).append(_digest(part, exact))
    return {room: _hash("".join(digests)) for room, digests in rooms.items()}


def code_of(things: Iterable[object]) -> dict[str, str]:
    """{"module NAME": hash} of the code that other packages bring.

    A class or function is followed by all of its package, or its module where it is in none, and by those modules
    of the same distribution beside it that they import. Other distributions are not looked into.

    Parameters
    ----------
    things : iterable of class or function
        What is used; hgorun's own are passed over.
    """
    tops = {str(getattr(thing, "__module__", "")).split(".")[0] for thing in things}
    theirs = sorted(tops - {"", "hgorun"} - sys.stdlib_module_names | tops & {"__main__"})
    return {f"module {top}": digest for top in theirs if (digest := _of_distribution(top))}


@cache
def _of_distribution(top: str) -> str:
    """Hash of a module or package and of what it imports of its own distribution; empty without Python sources."""
    texts: dict[str, str] = {}
    todo, seen = [top], {top}
    while todo:
        name = todo.pop()
        for path in _sources(name):
            content = path.read_bytes()
            texts[f"{name} {path}"] = f"{name} {path.name} {meaning(content)}"
            new = {other for other in _imported(content) - seen if _beside(other, top)}
            seen |= new
            todo += new
    return _hash("\n".join(texts[key] for key in sorted(texts))) if texts else ""


def _folders(name: str) -> list[Path]:
    """Of a package that has been imported."""
    return [Path(folder) for folder in getattr(sys.modules.get(name), "__path__", ())]


def _sources(name: str) -> list[Path]:
    """The files of a module or package that has been imported."""
    if folders := _folders(name):
        return sorted(path for folder in folders for path in folder.rglob("*.py"))
    file = getattr(sys.modules.get(name), "__file__", None)
    return [Path(file)] if file and file.endswith(".py") else []


def _imported(source: bytes) -> set[str]:
    """The modules and packages that a source names in its imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module)
    return {name.split(".")[0] for name in names}


def _beside(name: str, top: str) -> bool:
    """Whether a module lies in the folder of another one and is not of another distribution."""
    if name == "hgorun" or name in sys.stdlib_module_names or _place(name) != _place(top):
        return False
    return _distributions().get(name, []) == _distributions().get(top, [])


def _place(name: str) -> Path | None:
    """The folder that a module or package lies in; None where it has not been imported."""
    return next((path.parent for path in _folders(name) or _sources(name)), None)


@cache
def _distributions() -> Mapping[str, list[str]]:
    from importlib.metadata import packages_distributions  # reads about every distribution that is installed

    return packages_distributions()


@cache
def _digest(part: str, exact: bool = False) -> str:
    """Hash of a file, or of all files of a room with their names."""
    place = PACKAGE / part
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
    of = _bytes if exact else meaning
    texts = (f"{path.relative_to(PACKAGE).as_posix()} {of(path.read_bytes())}" for path in files)
    return _hash("\n".join(texts))


def _bytes(source: bytes) -> str:
    return hashlib.sha256(source).hexdigest()


def meaning(source: str | bytes) -> str:
    """Hash of a Python source without comments, docstrings and formatting."""
    words: list[str] = []
    _add_words(words, ast.parse(source))
    return _hash("\0".join(words))


def _add_words(words: list[str], node: ast.AST) -> None:
    """The syntax tree as a list of words; empty fields, which differ between versions of Python, are left out."""
    words.append(type(node).__name__)
    for name, value in ast.iter_fields(node):
        if name == "body" and isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            value = _without_docstring(value)
        if isinstance(value, ast.expr_context) or value is None or value == []:
            continue
        words.append(name)
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST):
                _add_words(words, part)
            else:
                words.append(repr(part))
        words.append("end")


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    match body:
        case [ast.Expr(value=ast.Constant(value=str())), *rest]:
            return rest
    return body


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
