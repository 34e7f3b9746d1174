"""Texts that a program can say, read from its source: of a message as it is written, with gaps for what is put in."""

from __future__ import annotations

import ast
import re
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

GAP = "…"
_PLACE = re.compile(r"\{\w*\}")  # of str.format
_TEXT = re.compile(r"(tuple\[)?str\b")  # a type: a text, or one with something else
_DEEP = 4  # calls that are followed from where something is raised to its text
Function = ast.FunctionDef | ast.AsyncFunctionDef
_LEAVES = (ast.Name, ast.Constant, ast.expr_context, ast.operator)  # without calls inside


def template(node: ast.expr | None) -> str:
    """A text of the source, with gaps; empty where it is none."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        parts = (part.value if isinstance(part, ast.Constant) else GAP for part in node.values)
        return "".join(str(part) for part in parts)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = template(node.left), template(node.right)
        return (left or GAP) + (right or GAP) if left or right else ""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "format":
        return _PLACE.sub(GAP, template(node.func.value))
    return ""


def has_words(text: str) -> bool:
    """Whether a sentence is said, besides what is put in; the name of a key is none."""
    return bool(re.search(r"\w", text.replace(GAP, ""))) and (" " in text or GAP in text)


def name_of(function: ast.expr) -> str:
    """The last part of a dotted name."""
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


@dataclass(frozen=True)
class Source:
    """The files of a package.

    Parameters
    ----------
    package : Path
    """

    package: Path
    _trees: dict[Path, ast.Module] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        for file in sorted(self.package.rglob("*.py")):
            self._trees[file] = ast.parse(file.read_text(encoding="utf-8"))

    def calls(self) -> Iterator[tuple[str, ast.Call, Function | None, ast.Module]]:
        """Every call: its room, itself, the function and the file that it stands in."""
        for file, tree in self._trees.items():
            room = file.relative_to(self.package).parts[0].removesuffix(".py")
            yield from ((room, call, inside, tree) for call, inside in _calls(tree, None))

    def texts(self, node: ast.expr | None, inside: Function | None, tree: ast.Module, deep: int = _DEEP) -> list[str]:
        """All texts that an expression can be, as far as the source shows: through names, choices and calls."""
        if has_words(text := template(node)):
            return [text]
        if isinstance(node, ast.IfExp):
            return self.texts(node.body, inside, tree, deep) + self.texts(node.orelse, inside, tree, deep)
        if isinstance(node, ast.BoolOp):
            return [text for value in node.values for text in self.texts(value, inside, tree, deep)]
        if deep == 0:
            return []
        if isinstance(node, ast.Name):
            values = _assigned(node.id, inside) or _assigned(node.id, tree) or self._constants[node.id]
            return [text for value in values for text in self.texts(value, inside, tree, deep - 1)]
        if isinstance(node, ast.Attribute):
            own = [text for value in self._constants[node.attr] for text in self.texts(value, None, tree, deep - 1)]
            return own + self.returned(node.attr, deep - 1)
        if isinstance(node, ast.Call):
            given = node.func.value if isinstance(node.func, ast.Attribute) else None
            if isinstance(given, ast.Dict):  # {...}.get(key, otherwise)
                return [text for one in (*given.values, *node.args) for text in self.texts(one, inside, tree, deep)]
            if name_of(node.func) == "format" and given is not None:
                return [_PLACE.sub(GAP, text) for text in self.texts(given, inside, tree, deep)]
            return self.returned(name_of(node.func), deep - 1)
        if isinstance(node, ast.Tuple) and node.elts:  # the text, and where it belongs to
            return self.texts(node.elts[0], inside, tree, deep)
        return []

    def returned(self, name: str, deep: int = _DEEP) -> list[str]:
        """The texts that functions of a name return."""
        return [
            text
            for tree, function in self._functions[name]
            for returned in ast.walk(function)
            if isinstance(returned, ast.Return)
            for text in self.texts(returned.value, function, tree, deep)
        ]

    @cached_property
    def _constants(self) -> dict[str, list[ast.expr]]:
        """Values of the names at the top of files and of classes, of those that are texts."""
        found: defaultdict[str, list[ast.expr]] = defaultdict(list)
        for tree in self._trees.values():
            bodies = [tree.body, *(node.body for node in tree.body if isinstance(node, ast.ClassDef))]
            for name, value in (named for body in bodies for named in _named(body)):
                if template(value):
                    found[name].append(value)
        return found

    @cached_property
    def _functions(self) -> dict[str, list[tuple[ast.Module, Function]]]:
        """Functions whose result is a text, or begins with one, by their names; each with its file."""
        found: defaultdict[str, list[tuple[ast.Module, Function]]] = defaultdict(list)
        for tree in self._trees.values():
            for node in _statements(tree):
                if (
                    isinstance(node, Function)
                    and node.returns is not None
                    and re.match(r"(tuple\[)?str\b", ast.unparse(node.returns))
                ):
                    found[node.name].append((tree, node))
        return found


def _calls(node: ast.AST, inside: Function | None) -> Iterator[tuple[ast.Call, Function | None]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, _LEAVES):
            continue
        if isinstance(child, ast.Call):
            yield child, inside
        yield from _calls(child, child if isinstance(child, Function) else inside)


def _statements(node: ast.AST) -> Iterator[ast.stmt]:
    """All inside, in the order of :func:`ast.walk`, which looks into every expression for them."""
    waiting = deque([node])
    while waiting:
        for child in ast.iter_child_nodes(waiting.popleft()):
            if not isinstance(child, ast.expr):
                waiting.append(child)
            if isinstance(child, ast.stmt):
                yield child


def _named(body: Iterable[ast.stmt]) -> Iterator[tuple[str, ast.expr]]:
    for statement in body:
        if isinstance(statement, ast.Assign):
            for target in statement.targets:
                first = target.elts[0] if isinstance(target, ast.Tuple) else target
                if isinstance(first, ast.Name):
                    yield first.id, statement.value
        elif isinstance(statement, ast.AnnAssign) and statement.value and isinstance(statement.target, ast.Name):
            yield statement.target.id, statement.value


def _assigned(name: str, block: Function | ast.Module | None) -> list[ast.expr]:
    if block is None:
        return []
    statements = (
        [node for node in ast.walk(block) if isinstance(node, ast.stmt)] if isinstance(block, Function) else block.body
    )
    return [value for found, value in _named(statements) if found == name]
