"""Assignments of ``--set`` as they are typed: in quotes that a shell takes away, around those that YAML needs."""

from __future__ import annotations

import json
from shlex import quote

from hgorun.config.paths import dotted
from hgorun.errors import KeyPath


def assigned(path: KeyPath, value: str) -> str:
    """The option that sets a key to a value, which is given as YAML."""
    return f"--set {quote(f'{dotted(path)}={value}')}"


def assigned_text(path: KeyPath, text: str) -> str:
    """The option that sets a key to a text, whatever that would be without quotes."""
    return assigned(path, json.dumps(text, ensure_ascii=False))
