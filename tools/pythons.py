"""Print the newer versions of Python that pyproject.toml names and this machine has: a line VERSION PROGRAM for each.

    python tools/pythons.py [TURN]

With a turn, which is a number, one of them only: with the next number the next one. What is not there is said on
stderr.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from shutil import which

_CLASSIFIER = re.compile(r"Programming Language :: Python :: (3\.\d+)")


def named(project: dict[str, list[str]]) -> list[str]:
    """The versions of the classifiers, but for the one that this program runs with."""
    own = "{}.{}".format(*sys.version_info)
    found = (match[1] for line in project["classifiers"] if (match := _CLASSIFIER.fullmatch(line)))
    return [version for version in found if version != own]


def candidates(version: str) -> Iterator[str]:
    """Programs that may be this version: on the path, and those of pyenv, whose own on the path may be switched off."""
    if found := which(f"python{version}"):
        yield found
    yield from map(str, sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python{version}"), reverse=True))


def runs(program: str, version: str) -> bool:
    """Whether a program is there and of this version."""
    asked = "import sys; print('{}.{}'.format(*sys.version_info))"
    done = subprocess.run([program, "-c", asked], capture_output=True, text=True)
    return (done.returncode, done.stdout.strip()) == (0, version)


def main(arguments: list[str]) -> None:
    found = []
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    for version in named(tomllib.loads(text)["project"]):
        program = next((one for one in candidates(version) if runs(one, version)), None)
        if program is None:
            print(f"Python {version} is not on this machine: not tested", file=sys.stderr)
        else:
            found.append(f"{version} {program}")
    for line in [found[int(arguments[0]) % len(found)]] if arguments and found else found:
        print(line)


if __name__ == "__main__":
    main(sys.argv[1:])
