"""All messages that hgorun can give, read from its source, so that none is forgotten."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from site_markdown import plain

import hgorun

PACKAGE = Path(hgorun.__file__).parent
GAP = "…"
# The exceptions whose message a user reads; those of Python, which a validator of a block turns into one.
TOLD = frozenset(
    (
        *("ConfigError", "ExpressionError", "HgorunError", "NotObservableForm", "PlantDiverged", "PluginError"),
        *("Problem", "SimulationError", "ValueError", "Changed", "Damaged"),
    )
)
REASONS = frozenset(["NoValue", "NotApplicable"])


@dataclass(frozen=True)
class Message:
    """A message as it stands in the source.

    Attributes
    ----------
    room : str
        The package that gives it: ``config``.
    kind : str
        The exception.
    text : str
        With a sign in place of what is known only when it is given.
    """

    room: str
    kind: str
    text: str


def messages(package: Path = PACKAGE) -> Iterator[Message]:
    """All messages of a package, in the order of its files and lines."""
    for file in sorted(package.rglob("*.py")):
        parts = file.relative_to(package).parts
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
                text, kind = _text(node.exc), _name(node.exc.func)
                if text and kind in TOLD | REASONS:
                    yield Message(parts[0].removesuffix(".py"), kind, text)


def _name(function: ast.expr) -> str:
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _text(call: ast.Call) -> str:
    """The first argument that is a text with words in it."""
    found = (template(argument) for argument in call.args)
    return next((text for text in found if re.search(r"\w", text.replace(GAP, ""))), "")


def template(node: ast.expr) -> str:
    """A text of the source, with gaps; empty where it is none."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    if isinstance(node, ast.JoinedStr):
        parts = (part.value if isinstance(part, ast.Constant) else GAP for part in node.values)
        return "".join(str(part) for part in parts)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = template(node.left), template(node.right)
        return (left or GAP) + (right or GAP) if left or right else ""
    return ""


def messages_page() -> str:
    """Every message, by the part of the program that gives it."""
    found = list(messages())
    parts = [_HEAD]
    for kinds, title, text in ((TOLD, "Messages", ""), (REASONS, "Why the analysis gives no number", _WHY)):
        parts += [f"## {title}", text]
        for room in dict.fromkeys(m.room for m in found if m.kind in kinds):
            parts.append(f"### {room}")
            parts.append(plain(_subject(room)))
            own = dict.fromkeys(m.text for m in found if m.room == room and m.kind in kinds)
            parts.append("\n".join(f"- {plain(text)}" for text in own))
    return "\n\n".join(part for part in parts if part) + "\n"


def _subject(room: str) -> str:
    """What the package says that it is about."""
    file = PACKAGE / room / "__init__.py"
    doc = ast.get_docstring(ast.parse((file if file.is_file() else PACKAGE / f"{room}.py").read_text(encoding="utf-8")))
    return (doc or "").split("\n\n")[0].replace("\n", " ")


_HEAD = f"""# All messages

The messages that stand in the source, `{GAP}` in place of names and numbers: for searching. A message says what is
wrong, what was found and what would be right; before it stand the file, the line and the key. [What to
do](../errors.md) explains common ones."""
_WHY = "These are `reasons` in the JSON of `hgorun analyze`, and lines below its table."
