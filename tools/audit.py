"""Ask the advisory databases about the packages of an environment, and say how many of them could be asked about.

    python tools/audit.py PIP_AUDIT ENVIRONMENT

Exit code 1 where an advisory is known. pip-audit itself passes what it finds no data about.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any


def told(report: dict[str, Any]) -> tuple[list[str], int]:
    """Lines about a report of pip-audit, and the exit code."""
    packages = report["dependencies"]
    asked = [package for package in packages if "skip_reason" not in package]
    lines = [
        f"{package['name']} {package['version']}: {advisory['id']}, mended in {', '.join(advisory['fix_versions'])}"
        for package in asked
        for advisory in package["vulns"]
    ]
    code = 1 if lines else 0
    if not asked:
        return ["NOT AUDITED: no advisory data could be had for any package"], code
    lines.append(f"{len(asked)} of {len(packages)} packages audited, {len(lines)} advisories")
    return lines, code


def main() -> int:
    program, environment = sys.argv[1:]
    (site,) = Path(environment).glob("lib/python3*/site-packages")
    line = [program, "--path", str(site), "--format", "json", "--progress-spinner", "off"]
    done = subprocess.run(line, capture_output=True, text=True)
    try:
        report = json.loads(done.stdout)
    except json.JSONDecodeError:
        print(f"NOT AUDITED: {(done.stderr.strip().splitlines() or ['pip-audit gave no reason'])[-1]}")
        return 0
    lines, code = told(report)
    print("\n".join(lines))
    return code


if __name__ == "__main__":
    sys.exit(main())
