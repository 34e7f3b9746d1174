"""Pages that are made from the program say what the program says."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from site_blocks import reference_page
from site_curves import drawing, ticks
from site_formulas import mathml
from site_links import without_links
from site_markdown import plain, without_errata
from site_pages import observer_page, plant_page, read_choice, write

import hgorun
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS

MATHML = "{http://www.w3.org/1998/Math/MathML}"


def rows(page: str) -> list[list[str]]:
    """The cells of all tables."""
    lines = [line for line in page.splitlines() if line.startswith("|")]
    return [re.split(r"(?<!\\)\|", line)[1:-1] for line in lines]


@pytest.fixture(scope="module")
def fhgo2() -> str:
    return observer_page("fhgo2", OBSERVERS.find("fhgo2"), ("the noise is fast", "it is slow: `shgo`"))


def test_the_page_of_an_observer_has_its_keys_source_errata_and_choice(fhgo2: str) -> None:
    assert "| `r` | `1` | \\>= 0 and \\<= 20 |" in fhgo2
    assert "Robles Magdaleno 2023, (3.33)" in fhgo2
    assert r"- (3.74)-(3.75) of the thesis print a second $\theta$" in fhgo2
    assert fhgo2.count("second $") == 1
    assert "Take it when: the noise is fast." in fhgo2
    assert "continuous, sampled and late outputs" in fhgo2
    assert "<svg" in fhgo2
    assert r"\begin{aligned}" in fhgo2
    assert all(len(row) == 4 for row in rows(fhgo2))


def test_the_page_of_an_observer_that_refuses_late_outputs_says_so() -> None:
    page = observer_page("super_twisting", OBSERVERS.find("super_twisting"), None)
    assert "continuous and sampled outputs" in page
    assert "Late outputs are refused" in page


def test_the_example_of_a_page_is_a_configuration_that_runs(fhgo2: str) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", fhgo2, re.DOTALL)
    config = yaml.safe_load(text)
    config["time"]["end"] = 0.2
    assert hgorun.simulate(hgorun.Experiment(config)).status == "ok"


def test_the_page_of_a_plant_has_its_equations_and_parameters() -> None:
    page = plant_page("van_der_pol", PLANTS.find("van_der_pol"))
    assert r"{\dot{x}}_{1} &= x_{2}" in page
    assert "| `mu` | 0.5 |  | damping |" in page
    assert "kalman" not in page


def test_every_block_of_a_configuration_is_in_the_reference() -> None:
    page = reference_page()
    for key in ("`output_step`", "`accuracy`", "`sampling`", "`late`", "`panels.error`", "`anti_windup`", "`budget`"):
        assert key in page or key.replace("`", "") in page
    assert all(len(row) == 4 for row in rows(page))


@pytest.mark.slow
@pytest.mark.unmeasured
def test_there_is_a_page_for_everything_and_it_is_written_once(tmp_path: Path) -> None:
    """Also what is no longer there is taken away."""
    (tmp_path / "generated").mkdir()
    (tmp_path / "generated" / "gone.md").write_text("")
    (tmp_path / "choosing.md").write_text("| `shgo` | the output is clean | it is noisy |\n")
    write(tmp_path)
    found = {str(file.relative_to(tmp_path / "generated")) for file in tmp_path.rglob("generated/**/*.md")}
    assert {f"observers/{name}.md" for name in OBSERVERS.names()} <= found
    assert {f"plants/{name}.md" for name in PLANTS.names()} <= found
    assert "gone.md" not in found
    assert "the output is clean" in (tmp_path / "generated" / "observers" / "shgo.md").read_text()
    shown = [path for path in found if "/" in path and "<svg" in (tmp_path / "generated" / path).read_text()]
    assert len(shown) > 0.9 * len([path for path in found if "/" in path])


def test_choices_are_read_from_their_table() -> None:
    assert read_choice("| observer | take | other |\n|---|---|---|\n| `a_b` | one | two |\n") == {"a_b": ("one", "two")}


def test_a_docstring_is_shown_as_it_is_meant() -> None:
    text, errata = without_errata("First * line\nof two.\n\n    x' = a_1 [x]\n\nThe paper prints a. (2) holds ``x*y``.")
    equation = "$$\n\\begin{aligned}\n\\dot{x} & = a_{1} \\, [x]\n\\end{aligned}\n$$"
    assert text == f"First \\* line of two.\n\n{equation}\n\n(2) holds ``x*y``."
    assert errata == ["The paper prints a."]
    assert plain("a_1 _b_ |x| < 2") == r"a_1 \_b\_ \|x\| \< 2"


def test_links_out_of_the_folder_become_words() -> None:
    assert without_links("see [demos/qube](../demos/qube) and [it](tuning.md)") == "see demos/qube and [it](tuning.md)"


def test_the_index_of_a_letter_with_a_dot_stands_beside_it() -> None:
    root = ElementTree.fromstring(mathml(r"\dot{\hat{x}}_{1} = y", block=True))
    (index,) = root.iter(f"{MATHML}msub")
    assert [part.tag for part in index] == [f"{MATHML}mover", f"{MATHML}mn"]
    assert not list(root.iter(f"{MATHML}munderover"))
    sum_of = ElementTree.fromstring(mathml(r"\sum_{i=1}^n \bar{z}_i", block=True))
    assert len(list(sum_of.iter(f"{MATHML}munderover"))) == 1


def test_the_sign_of_a_number_is_a_function() -> None:
    """Which LaTeX is turned into a character that HTML has a name for, and XML not."""
    assert "sign" in "".join(ElementTree.fromstring(mathml(r"\operatorname{sign}\left(x\right)")).itertext())


def test_a_drawing_keeps_peaks_and_leaves_out_what_is_no_number() -> None:
    time = np.linspace(0, 10, 5001)
    peak = np.where(np.arange(5001) == 2345, 7.0, 0.0)
    root = ElementTree.fromstring(drawing(time, {"truth": peak, "<a>": peak * np.nan}, x="t", y="x", told='a "peak"'))
    nothing, truth = (path.attrib["d"] for path in root.iter("{http://www.w3.org/2000/svg}path"))
    heights = [float(point.split(",")[1]) for point in truth[1:].split()]
    assert min(heights) < 40 < 170 < max(heights)
    assert nothing == "M"


@pytest.mark.parametrize(
    ("interval", "expected"),
    [((0, 10), [0, 5, 10]), ((-0.02, 0.03), [-0.02, 0, 0.02]), ((1.5, 1.9), [1.5, 1.6, 1.7, 1.8, 1.9])],
)
def test_ticks_are_round_numbers_inside(interval: tuple[float, float], expected: list[float]) -> None:
    np.testing.assert_allclose(ticks(*interval), expected, atol=1e-12)
