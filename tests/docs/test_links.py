"""Links of a built site are followed, to the place in the page; what a browser would fetch from elsewhere is told."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

TOOL = Path(__file__).parents[2] / "tools" / "follow_links.py"


def followed(site: Path) -> tuple[int, str]:
    done = subprocess.run([sys.executable, str(TOOL), str(site)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.returncode, done.stdout


def test_what_leads_nowhere_and_what_is_fetched_is_told(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "c.html").write_text('<p id="here">')
    (tmp_path / "a.html").write_text(
        '<link rel="canonical" href="https://example.org/a.html"><script src="https://example.org/x.js"></script>'
        '<a href="b/c.html#here">1</a><a href="b/c.html#there">2</a><a href="d.html">3</a><a href="#e">4</a>'
        '<a href="https://example.org">5</a><img src="data:image/png;base64,AA=="><img src="f.png">'
    )
    code, out = followed(tmp_path)
    assert code == 1
    assert out.splitlines() == [
        "a.html: fetches https://example.org/x.js",
        "a.html: b/c.html#there has no such place",
        "a.html: d.html is not there",
        "a.html: #e has no such place",
        "a.html: f.png is not there",
    ]
    (tmp_path / "a.html").write_text('<a href="b/c.html#here">1</a>')
    assert followed(tmp_path) == (0, "all links of 2 pages lead somewhere\n")
