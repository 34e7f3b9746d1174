"""Compare a coverage report with its floors: branches of the whole package, lines and branches of each file.

    python tools/coverage_floor.py coverage.json [--report-only]

Exit code 1 when something is below its floor. Slow tests are measured only if they are marked so.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

ADVICE = (
    "`coverage report -m --include=FILE` lists what is not covered. Add a test of it that takes less than a second. "
    "If a slow test covers it and no fast one can, mark that one with @pytest.mark.measured."
)
PACKAGE_BRANCHES = 95.0
FILE = 85.0


def below(report: dict[str, Any]) -> list[str]:
    """A line for everything that is below its floor, the lowest first."""
    totals = report["totals"]
    branches = 100 * totals["covered_branches"] / max(totals["num_branches"], 1)
    lines = [f"{branches:5.1f} % of all branches; {PACKAGE_BRANCHES:g} % are wanted"] * (branches < PACKAGE_BRANCHES)
    files = sorted((entry["summary"]["percent_covered"], name) for name, entry in report["files"].items())
    return lines + [f"{percent:5.1f} % {name}; {FILE:g} % are wanted" for percent, name in files if percent < FILE]


def main(arguments: list[str]) -> int:
    report = json.loads(Path(arguments[0]).read_text(encoding="utf-8"))
    totals = report["totals"]
    print(f"{totals['percent_covered']:.1f} % of lines and branches, {totals['covered_branches']} of "
          f"{totals['num_branches']} branches")  # fmt: skip
    missing = below(report)
    print("\n".join([*missing, ADVICE]) if missing else "no file is below its floor")
    return 1 if missing and "--report-only" not in arguments else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
