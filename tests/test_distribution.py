"""What is released: the same bytes wherever and whenever it is built, and all that is needed to build it again."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EPOCH = "1764115200"


def built(checkout: Path, into: Path, kind: str, environment: dict[str, str], mask: int) -> Path:
    """A wheel or a source distribution, built without an environment of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(into)],
        cwd=checkout,
        env=os.environ | {"SOURCE_DATE_EPOCH": EPOCH} | environment,
        umask=mask,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    (file,) = into.iterdir()
    return file


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source distribution of this checkout."""
    return built(ROOT, tmp_path_factory.mktemp("first"), "sdist", {}, 0o022)


def unpacked(file: Path, folder: Path) -> Path:
    folder.mkdir()
    with tarfile.open(file) as archive:
        if hasattr(tarfile, "data_filter"):  # since Python 3.11.4
            archive.extractall(folder, filter="data")
        else:
            archive.extractall(folder)
    (inside,) = folder.iterdir()
    return inside


@pytest.mark.slow
def test_two_builds_are_the_same_bytes(first: Path, tmp_path: Path) -> None:
    """Under other folders, umasks, times, time zones and hash seeds; from the checkout and from the archive."""
    elsewhere = unpacked(first, tmp_path / "somewhere else")
    for number, path in enumerate(sorted(elsewhere.rglob("*"))):
        os.utime(path, (10**9 + number, 10**9 + number))
    other = {"TZ": "Asia/Kathmandu", "PYTHONHASHSEED": "7", "LC_ALL": "C"}
    assert built(elsewhere, tmp_path / "sdist", "sdist", other, 0o077).read_bytes() == first.read_bytes()
    wheels = [
        built(ROOT, tmp_path / "wheel 1", "wheel", {"PYTHONHASHSEED": "1"}, 0o022),
        built(elsewhere, tmp_path / "wheel 2", "wheel", other, 0o077),
    ]
    assert wheels[0].name == wheels[1].name
    assert wheels[0].read_bytes() == wheels[1].read_bytes()
    names = set(zipfile.ZipFile(wheels[0]).namelist())
    assert {"hgorun/py.typed", "hgorun/experiments/hgorun.schema.json"} <= names
    assert not {name for name in names if name.startswith(("tests/", "docs/")) or "__pycache__" in name}


@pytest.mark.slow
def test_the_source_distribution_has_what_is_needed_to_check_and_document_it(first: Path) -> None:
    with tarfile.open(first) as archive:
        members = archive.getmembers()
    names = {member.name.partition("/")[2] for member in members}
    missing = {
        path.relative_to(ROOT).as_posix()
        for folder in ("hgorun", "tests", "docs", "experiments", "demos", "tools", "paper", ".ci")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not {"__pycache__", "generated"} & set(path.parts)
    } - names
    assert not missing
    assert {"README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md", "Makefile", "pyproject.toml"} <= names
    assert {(member.uid, member.gid, member.uname, member.gname) for member in members} == {(0, 0, "", "")}
    assert {member.mtime for member in members} == {int(EPOCH)}
