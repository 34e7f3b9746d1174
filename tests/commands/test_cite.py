"""``hgorun cite``: exactly what a configuration uses, as BibTeX that others can read."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bibtexparser.entrypoint import parse_string
from shell import Shell

from hgorun.commands.citations import cited_in, known
from hgorun.commands.cite import publications, uses
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS
from hgorun.reproduce.shipped import experiments
from hgorun.version import RELEASED, __version__

TWO = """
time: {end: 1, output_step: 0.1}
plant: {type: van_der_pol, initial: {x1: 1, x2: 0}}
measurement: {sampling: {period: 0.1}}
observers: {A: {type: ekf, Q: {x1: 1, x2: 1}}, B: {type: savgol, window: 5}}
"""


def parsed(text: str) -> dict[str, dict[str, str]]:
    """Fields by key, read by a parser that is not ours."""
    library = parse_string(text)
    assert not library.failed_blocks
    return {e.key: {f.key: f.value for f in e.fields} | {"kind": e.entry_type} for e in library.entries}


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    (tmp_path / "two.yaml").write_text(TWO)
    return Shell(tmp_path, monkeypatch, capsys)


def test_what_two_observers_use_and_nothing_else(shell: Shell) -> None:
    code, out, _ = shell("cite", "two.yaml", "--bibtex")
    assert code == 0
    found = parsed(out)
    publications = {"katayama", "jazwinski1970", "gelb1974", "savitzky1964"}
    assert set(found) == {"hgorun", *publications, "casadi", "llvm", "numpy"}
    kinds = {key: found[key]["kind"] for key in ("hgorun", "casadi", "llvm", "numpy")}
    assert kinds == {"hgorun": "software", "casadi": "article", "llvm": "inproceedings", "numpy": "article"}
    assert found["numpy"]["doi"] == "10.1038/s41586-020-2649-2"
    assert found["savitzky1964"]["doi"] == "10.1021/ac60214a047"
    assert found["jazwinski1970"]["kind"] == "book"
    assert "cited" not in found["gelb1974"]
    assert (found["hgorun"]["version"], found["hgorun"]["year"]) == (__version__, RELEASED[:4])


@pytest.mark.measured
@pytest.mark.slow
def test_a_base_is_cited_for_what_is_made_of_it(shell: Shell) -> None:
    """Files of a sweep and of tuning, a result, and the collected file of a sweep."""
    noisy = TWO.replace("period: 0.1}}", "period: 0.1}, noise: [{type: gaussian, std: 0.1}]}")
    (shell.folder / "two.yaml").write_text(noisy)
    (shell.folder / "cited.yaml").write_text('reference: "Gauthier et al. (1992)"' + noisy)
    found = parsed(shell("cite", "cited.yaml", "--bibtex")[1])
    (shell.folder / "sweep.yaml").write_text("base: cited.yaml\naxes: {seed: {count: 2}}\n")
    (shell.folder / "gains.yaml").write_text(
        "base: cited.yaml\ntune: {gains: {observers.A.Q.x1: {log: [0.1, 10]}}, minimise: 'rmse(A, x1)'}\n"
    )
    assert shell("simulate", "cited.yaml", "-q", "-o", "cited.h5")[0] == 0
    assert shell("sweep", "sweep.yaml", "-q")[0] == 0
    (collected,) = (shell.folder / "results").glob("*.h5")
    assert parsed(shell("cite", "sweep.yaml", "--bibtex")[1]) == found
    assert parsed(shell("cite", "cited.h5", "--bibtex")[1]) == found
    assert parsed(shell("cite", "gains.yaml", "--bibtex")[1]).keys() == found.keys() | {"scipy"}
    of_ensemble = parsed(shell("cite", str(collected), "--bibtex")[1])
    assert of_ensemble.keys() == parsed(shell("cite", "two.yaml", "--bibtex")[1]).keys()
    code, _, err = shell("cite", "cited.h5", "--run", "a")
    assert (code, "--run is for configurations" in err) == (2, True)


def test_what_was_not_looked_up_is_marked(shell: Shell) -> None:
    """An article without DOI, and not a book, which has none."""
    (shell.folder / "m.yaml").write_text(TWO.replace("ekf, Q: {x1: 1, x2: 1}", "stubborn, theta: 2"))
    out = shell("cite", "m.yaml", "--bibtex")[1]
    assert "% alessandri2018: not verified, compare it with the publication\n@article{alessandri2018," in out
    assert "% savitzky1964" not in out
    assert {"alessandri2018", "savitzky1964"} <= set(parsed(out))
    shown = shell("cite", "m.yaml")[1]
    assert "[alessandri2018]* " in shown
    assert "[savitzky1964] " in shown
    assert all(entry.verified for entry in known().values() if entry.kind == "book")


def test_a_method_and_scipy_are_cited_where_they_are_used(shell: Shell) -> None:
    (shell.folder / "m.yaml").write_text(TWO + "solver: {method: dopri5, rtol: 1e-8}\nseed: 1\n")
    assert "dormand1980" in parsed(shell("cite", "m.yaml", "--bibtex")[1])
    linear = TWO.replace("savgol, window: 5", "luenberger_exact, poles: [-1, -2]")
    (shell.folder / "l.yaml").write_text(linear.replace("van_der_pol", "integrator_chain"))
    found = parsed(shell("cite", "l.yaml", "--bibtex")[1])
    assert {"scipy", "luenberger1971", "astolfi2016"} <= set(found)


@pytest.mark.parametrize(
    ("observer", "optional", "source"),
    [
        ("{type: shgo, theta: 2}", "nested: {M: [4]}", "nested: in the spirit of Farza et al. 2021"),
        ("{type: fhgo2, theta: 2}", "nested: {M: [4]}", "nested: in the spirit of Farza et al. 2021"),
        ("{type: low_power, theta: 2}", "saturate: [4]", "saturate: Astolfi, Marconi, Praly, Teel 2018"),
    ],
)
def test_the_source_of_an_optional_key_is_cited_where_the_key_is_used(
    shell: Shell, observer: str, optional: str, source: str
) -> None:
    """``show`` names it in any case, since it names the key."""
    found = []
    for name, block in (("without", observer), ("with", observer.replace("}", f", {optional}}}"))):
        (shell.folder / f"{name}.yaml").write_text(TWO.split("observers:")[0] + f"observers: {{A: {block}}}\n")
        found.append(" ".join(shell("cite", f"{name}.yaml")[1].split()))
    assert source not in found[0]
    assert source in found[1]
    shown = shell("show", observer.split(",")[0].removeprefix("{type: "))[1]
    assert source in " ".join(shown.split())


def test_text_json_and_a_file_say_the_same(shell: Shell) -> None:
    text = shell("cite", "two.yaml")[1]
    assert "observer A (ekf): Jazwinski 1970, 8.3; Gelb 1974, 6.1 [jazwinski1970, gelb1974]" in text
    assert "[savitzky1964] Abraham Savitzky, Marcel J. E. Golay" in " ".join(text.split())
    data = json.loads(shell("cite", "two.yaml", "--json")[1])
    bibtex = shell("cite", "two.yaml", "--bibtex")[1]
    assert "\n\n".join(data["bibtex"].values()) + "\n" == bibtex
    assert shell("cite", "two.yaml", "-o", "two.bib")[1] == "written: two.bib\n"
    assert (shell.folder / "two.bib").read_text() == bibtex
    assert shell("cite", "two.yaml", "-o", "two.bib")[1] == "written: two.bib (replaced)\n"
    assert shell("cite", "two.yaml", "-q")[1] == ""


def test_what_is_wrong_is_refused(shell: Shell) -> None:
    assert "expected a file .bib, found two.txt" in shell("cite", "two.yaml", "-o", "two.txt")[2]
    (shell.folder / "bad.yaml").write_text(TWO.replace("savgol", "savgoll"))
    code, _, err = shell("cite", "bad.yaml")
    assert (code, "savgol" in err) == (2, True)
    assert shell("cite", "two.yaml", "--run", "none")[0] == 2


@pytest.mark.measured
@pytest.mark.slow
def test_a_configuration_of_recorded_data_needs_no_data(shell: Shell) -> None:
    assert shell("init", "fermentation", "f")[0] == 0
    (shell.folder / "f" / "online.csv").unlink()
    assert {"bastin1990", "kalman1961"} <= set(parsed(shell("cite", "f/fermentation.yaml", "--bibtex")[1]))
    assert shell("cite", "f/fermentation.yaml", "--run", "none")[0] == 2


def test_every_shipped_experiment_names_its_publication() -> None:
    for name, path in experiments().items():
        found = publications(uses(path))
        assert name.split("/")[0] in {entry.key for entry in found}, name
        assert set(parsed("\n".join(e.bibtex for e in found))) == {e.key for e in found}


def test_sources_of_observers_and_plants_are_known() -> None:
    """All but a few, which are then cited by their own words."""
    words = [cls.reference for registry in (OBSERVERS, PLANTS) for cls in registry.all().values()]
    words += [source for cls in OBSERVERS.all().values() for source in cls.key_references.values()]
    unknown = [w for w in filter(None, words) if not set(cited_in(w)) <= set(known().values())]
    assert len(unknown) <= 3, unknown
    for reference in unknown:
        assert parsed("\n".join(entry.bibtex for entry in cited_in(reference)))


def test_keys_are_unique_and_stay() -> None:
    keys = [entry.key for entry in known().values()]
    assert len(set(keys)) == len(keys)
    assert {"robles2023", "lee2016", "meiners2025", "katayama", "astolfi2016", "casadi", "scipy"} <= set(keys)
    assert len(parsed("\n".join(entry.bibtex for entry in known().values()))) == len(keys)


@pytest.mark.parametrize(
    ("words", "keys"),
    [
        ("Freidovich, Khalil 2017", ["freidovich"]),  # not Khalil 2017: its own words, under a name made of them
        ("after Khalil 2017, our own", ["khalil2017"]),
        ("gain: fading-memory polynomials, Morrison 1969", ["morrison1969"]),
        ("A paper {of} mine", ["apaperofmine"]),
        ("plant and law of the separation results of Atassi and Khalil 1999; observers besides", ["atassi1999"]),
        ("Bastin & Dochain 1990", ["bastin1990"]),
        ("Freidovich and Khalil 2017", ["freidovichandkhalil2017"]),
        ("a bench of ours with a very long description of it", ["abenchofourswithaverylongdescriptionofit"]),
        ("", []),
    ],
)
def test_words_and_the_publications_that_they_name(words: str, keys: list[str]) -> None:
    assert [entry.key for entry in cited_in(words)] == keys


def test_the_page_of_gaps_counts_what_was_looked_up() -> None:
    articles = [entry for entry in known().values() if entry.kind in ("article", "inproceedings")]
    gaps = (Path(__file__).parents[2] / "docs" / "gaps.md").read_text()
    assert f"Of the {len(articles)} articles" in gaps
    assert f"{sum(entry.has_doi for entry in articles)} have a DOI" in gaps
    assert f"{sum(bool(entry.listed) for entry in articles)} have the volume and the pages that stand" in gaps
    assert not any(entry.has_doi and entry.listed for entry in articles)


def test_where_volume_and_pages_stand_is_said() -> None:
    """Of an article without DOI that a list of references has; the list is of a publication that is known, too."""
    (entry,) = cited_in("Praly 2003")
    told = "volume and pages as in the references of Meiners, Adamy 2025, [10]"
    assert entry.bibtex.startswith(f"% praly2003: {told}\n@article{{praly2003,\n")
    assert entry.text.endswith(f"48 1103-1108, 2003, ({told})")
    assert "listed" not in dict(entry.fields)
    (proceedings,) = cited_in("Astolfi, Marconi, Praly, Teel 2016")
    assert proceedings.text.endswith("2016, (pages as in the references of Robles Magdaleno 2023, [65])")
    lists = {one.listed for one in known().values() if one.listed}
    assert all(any(of in words for of in known()) for words in lists)


def test_claims_are_not_needed(shell: Shell) -> None:
    """Neither of a file with one run nor of one with several, of which one may be chosen."""
    claims = 'claims: [{id: "1", claim: Small., value: "rmse(nothing", below: 1}]\n'
    (shell.folder / "one.yaml").write_text(TWO + claims)
    (shell.folder / "several.yaml").write_text(TWO + claims + "runs: {a: {}, b: {observers: {B: {window: 7}}}}\n")
    assert shell("cite", "one.yaml", "--bibtex")[0] == 0
    assert "savitzky1964" in parsed(shell("cite", "several.yaml", "--bibtex")[1])
    assert "savitzky1964" in parsed(shell("cite", "several.yaml", "--run", "b", "--bibtex")[1])
    assert "no run is called 'c'" in shell("cite", "several.yaml", "--run", "c")[2]
    assert "the file has no runs" in shell("cite", "one.yaml", "--run", "c")[2]
