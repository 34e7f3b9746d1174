"""Type checking of what a newcomer writes, as mypy does it in a package of their own."""

from __future__ import annotations

from pathlib import Path

from mypy import api

ROOT = Path(__file__).parents[1]


def assert_strictly_typed(*files: Path) -> str:
    """mypy --strict on files outside of the package; returns what it reports besides errors.

    The cache stays in the checkout, so that only the first run reads numpy, pydantic and casadi.
    """
    (files[0].parent / "mypy.ini").write_text(f"[mypy]\nstrict = true\nmypy_path = {ROOT}\n")
    options = [f"--config-file={files[0].parent / 'mypy.ini'}", "--follow-imports=silent"]
    out, err, code = api.run([*options, f"--cache-dir={ROOT / '.mypy_cache' / 'outside'}", *map(str, files)])
    assert code == 0, out + err
    return out
