"""Which code a run, a figure and a claim follow from, by room, as hashes of its meaning.

Comments, docstrings and the way a line is broken have no part in them: what a run computes does not follow from these.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1]

# Rooms or files of the package. How a configuration is read is left out of all of them: what is read, with its
# defaults, is hashed itself.
RUN = (
    "config/evaluation.py",
    "config/expressions.py",
    "config/grammar.py",
    "config/literals.py",
    "config/models.py",
    "config/reads.py",
    "config/types.py",
    "engine",
    "measurement",
    "memo.py",
    "noise",
    "observers",
    "plants",
    "result",
    "simulation",
    "symbolic",
)
FIGURE = ("figures", "tables/typeset.py")
QUANTITY = ("study/measured.py", "study/quantities.py")
SCALING = ("study/scaling.py",)
THEORY = ("analysis", "study/theory.py")


def code(parts: Sequence[str]) -> dict[str, str]:
    """{room: hash} of rooms and files of the package."""
    rooms: dict[str, list[str]] = {}
    for part in parts:
        rooms.setdefault(part.split("/")[0].removesuffix(".py"), []).append(_digest(part))
    return {room: _hash("".join(digests)) for room, digests in rooms.items()}


def code_of(classes: Iterable[type]) -> dict[str, str]:
    """{module: hash} of classes that other packages bring."""
    modules = sorted({cls.__module__ for cls in classes if cls.__module__.split(".")[0] != "hgorun"})
    files = {name: getattr(sys.modules.get(name), "__file__", None) for name in modules}
    return {name: meaning(Path(file).read_bytes()) for name, file in files.items() if file and file.endswith(".py")}


@cache
def _digest(part: str) -> str:
    """Hash of a file, or of all files of a room with their names."""
    place = PACKAGE / part
    files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
    texts = (f"{path.relative_to(PACKAGE).as_posix()} {meaning(path.read_bytes())}" for path in files)
    return _hash("\n".join(texts))


def meaning(source: str | bytes) -> str:
    """Hash of a Python source without comments, docstrings and formatting."""
    return _hash("\0".join(_words(ast.parse(source))))


def _words(node: ast.AST) -> Iterator[str]:
    """The syntax tree as a list of words; empty fields, which differ between versions of Python, are left out."""
    yield type(node).__name__
    for name, value in ast.iter_fields(node):
        if name == "body" and isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            value = _without_docstring(value)
        if isinstance(value, ast.expr_context) or value is None or value == []:
            continue
        yield name
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST):
                yield from _words(part)
            else:
                yield repr(part)
        yield "end"


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    match body:
        case [ast.Expr(value=ast.Constant(value=str())), *rest]:
            return rest
    return body


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
