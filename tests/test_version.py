"""The source revision that results carry: what git's files say, or the version."""

from __future__ import annotations

from pathlib import Path

import pytest

from hgorun.version import __version__, source_revision

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def checkout(folder: Path, head: str, **files: str) -> Path:
    """A folder with git's files in it; ``__`` stands for a slash in their names."""
    git = folder / ".git"
    git.mkdir()
    (git / "HEAD").write_text(head + "\n")
    for name, text in files.items():
        place = git / name.replace("__", "/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)
    return folder


def test_a_branch_a_commit_and_packed_branches_are_read(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("branch", "commit", "packed")]
    for folder in folders:
        folder.mkdir()
    checkout(folders[0], "ref: refs/heads/main", refs__heads__main=COMMIT + "\n")
    checkout(folders[1], COMMIT)
    packed = f"# pack-refs with: peeled\n{'f' * 40} refs/heads/other\n{COMMIT} refs/heads/main\n"
    checkout(folders[2], "ref: refs/heads/main", **{"packed-refs": packed})
    assert [source_revision(folder) for folder in folders] == [COMMIT] * 3


def test_a_worktree_finds_the_branches_of_its_repository(tmp_path: Path) -> None:
    main, tree = tmp_path / "main", tmp_path / "tree"
    main.mkdir()
    tree.mkdir()
    checkout(main, "ref: refs/heads/main", refs__heads__topic=COMMIT)
    own = main / ".git" / "worktrees" / "tree"
    own.mkdir(parents=True)
    (own / "HEAD").write_text("ref: refs/heads/topic\n")
    (own / "commondir").write_text("../..\n")
    (tree / ".git").write_text(f"gitdir: {own}\n")
    assert source_revision(tree) == COMMIT


@pytest.mark.parametrize("head", ["", "ref: refs/heads/gone", "what is this"])
def test_elsewhere_it_is_the_version(head: str, tmp_path: Path) -> None:
    assert source_revision(tmp_path) == __version__
    checkout(tmp_path, head, **{"packed-refs": ""})
    assert source_revision(tmp_path) == __version__
