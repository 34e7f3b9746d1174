"""The experiments that come with hgorun."""

from __future__ import annotations

from pathlib import Path


def folder() -> Path:
    """Beside the package in a checkout, inside it in an installation."""
    package = Path(__file__).parents[1]
    inside = package / "experiments"
    return inside if inside.is_dir() else package.parent / "experiments"


_BENCHMARK = "benchmark"  # a folder with plants, and what hgorun benchmark takes: no figures, no claims


def experiments() -> dict[str, Path]:
    """{path without suffix, below the folder: file}, sorted; files called _... are only extended."""
    base = folder()
    files = (p for p in sorted(base.rglob("*.yaml")) if not p.name.startswith("_") and p.parent.name != _BENCHMARK)
    return {p.relative_to(base).with_suffix("").as_posix(): p for p in files}
