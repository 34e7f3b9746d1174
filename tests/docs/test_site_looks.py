"""What pages look like: formulas with their symbols, options and messages with the characters that are typed."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from site_markdown import without_errata
from site_symbols import aligned, symbols

DOCS = Path(__file__).parents[2] / "docs"


def test_options_and_messages_can_be_searched_for_and_copied() -> None:
    """Else -- becomes a dash and quotes are curly."""
    assert runpy.run_path(str(DOCS / "conf.py"))["smartquotes"] is False


def test_formulas_have_a_font_of_mathematics_on_every_system() -> None:
    style = (DOCS / "_static" / "hgorun.css").read_text(encoding="utf-8")
    (fonts,) = re.findall(r"^math \{ font-family: (.*); \}$", style, re.MULTILINE)
    assert {'"Latin Modern Math"', '"STIX Two Math"', '"Cambria Math"', "math"} <= set(fonts.split(", "))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("xhat' = f(xhat, u) - theta J^-1 Delta_n^-1(theta) K e", "x̂' = f(x̂, u) - θ J⁻¹ Δ_n⁻¹(θ) K e"),
        ("rho^' = -theta P Upsilon^T C^T e, rho^ - rho, x^2.5", "ρ̂' = -θ P ϒᵀ Cᵀ e, ρ̂ - ρ, x^2.5"),
        ("eta1 >= 2 lam_1, Q_theta <= xihat_a, mu_max", "η1 ≥ 2 λ_1, Q_θ ≤ ξ̂_a, μ_max"),
        ("sum theta^(n+1), e^(-20), x^i, x^100", "sum θ^(n+1), e^(-20), x^i, x¹⁰⁰"),
        ("that, what, numbers, multiple, must, chatter", "that, what, numbers, multiple, must, chatter"),
        ("`theta: 2` and ``J^-1 >= 1`` beside theta", "`theta: 2` and ``J^-1 >= 1`` beside θ"),
        ("theta_1: half of theta. lam: slow; mu is", "theta_1: half of θ. lam: slow; μ is"),
        ("the plant's time_theta and min_eta", "the plant's time_theta and min_eta"),
        ("", ""),
    ],
)  # fmt: skip
def test_a_formula_has_its_symbols_and_words_and_keys_stay(text: str, expected: str) -> None:
    assert symbols(text) == expected
    assert symbols(expected) == expected


def test_signs_below_each_other_stay_there() -> None:
    assert aligned("theta' = mu\n  + 1\nF_0    = 2 theta_1\nI(t)   = 0") == "θ'   = μ\n  + 1\nF_0  = 2 θ_1\nI(t) = 0"
    assert aligned("xhat' = a\nP'    = b") == "x̂' = a\nP' = b"
    assert aligned("theta = 1\nlong_word = 2") == "θ = 1\nlong_word = 2"


def test_equations_of_a_docstring_are_no_wider_than_the_page() -> None:
    """They go on in a second line, which a class of theirs asks for."""
    style = (DOCS / "_static" / "hgorun.css").read_text(encoding="utf-8")
    text, errata = without_errata("A theta.\n\n    theta = 1\n\nThe paper prints lam.")
    assert text == "A θ.\n\n```{code-block} text\n:class: formula\n\nθ = 1\n```"
    assert errata == ["The paper prints λ."]
    assert ".formula pre { white-space: pre-wrap; }" in style
