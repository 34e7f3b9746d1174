"""Print the lowest versions that pyproject.toml permits, as constraints for pip.

Tools of developers are left out: nobody installs old ones.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_BOUND = re.compile(r"([A-Za-z0-9._-]+)\s*>=\s*([0-9][0-9.]*)")


def lowest(project: dict[str, Any]) -> Iterator[str]:
    """``name==version`` of every dependency and optional dependency.

    Raises
    ------
    ValueError
        When one has no lower bound.
    """
    optional = project["optional-dependencies"]
    tools = ("bench", "dev", "release", "test")
    extras = [requirement for extra, some in optional.items() if extra not in tools for requirement in some]
    for requirement in [*project["dependencies"], *extras]:
        bound = _BOUND.match(requirement)
        if bound is None:
            raise ValueError(f"{requirement} has no lower bound")
        yield f"{bound[1]}=={bound[2]}"


def main() -> None:
    file = Path(__file__).parents[1] / "pyproject.toml"
    project = tomllib.loads(file.read_text(encoding="utf-8"))["project"]
    sys.stdout.writelines(f"{line}\n" for line in lowest(project))


if __name__ == "__main__":
    main()
