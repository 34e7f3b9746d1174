"""Write the JSON schemas that come with the experiments, and the line of each experiment by which editors find them.

python tools/schemas.py           write what has changed
python tools/schemas.py --check   exit code 1 where something is not as it would be written
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

from hgorun.commands.schema import SCHEMA_FILE, benchmark_schema, build_schema, schema_text, with_schema

ROOT = Path(__file__).resolve().parents[1]
EXPERIMENTS = ROOT / "experiments"
BENCHMARK = EXPERIMENTS / "benchmark" / "benchmark.yaml"
CONFIGURATIONS_SCHEMA = EXPERIMENTS / SCHEMA_FILE
BENCHMARK_SCHEMA = EXPERIMENTS / "benchmark" / "benchmark.schema.json"


def schema_of(file: Path) -> Path:
    """Which schema an experiment, a demo or the file of a benchmark is written by."""
    return BENCHMARK_SCHEMA if file == BENCHMARK else CONFIGURATIONS_SCHEMA


def configurations() -> list[Path]:
    """Every YAML file of the experiments and the demos, but those that say what is known of a publication."""
    files = (file for folder in ("experiments", "demos") for file in (ROOT / folder).rglob("*.yaml"))
    return sorted(file for file in files if file.name != "_publication.yaml")


def wanted() -> Iterator[tuple[Path, str]]:
    """Each file with the text that it should have."""
    yield CONFIGURATIONS_SCHEMA, schema_text(build_schema())
    yield BENCHMARK_SCHEMA, schema_text(benchmark_schema())
    for file in configurations():
        address = Path(os.path.relpath(schema_of(file), file.parent)).as_posix()
        yield file, with_schema(file.read_text(encoding="utf-8"), address)


def main() -> int:
    changed = [(file, text) for file, text in wanted() if not file.exists() or file.read_text(encoding="utf-8") != text]
    for file, text in changed:
        print(f"{'differs' if '--check' in sys.argv else 'written'}: {file.relative_to(ROOT)}")
        if "--check" not in sys.argv:
            file.write_text(text, encoding="utf-8")
    return 1 if changed and "--check" in sys.argv else 0


if __name__ == "__main__":
    sys.exit(main())
