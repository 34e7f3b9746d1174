"""What pages look like: formulas with their symbols, options and messages with the characters that are typed."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from xml.etree import ElementTree

import pytest
from site_formulas import mathml
from site_inline import readable
from site_markdown import paragraphs, without_errata
from site_symbols import symbols
from site_tex import displayed, formula

from hgorun.commands.described import own_doc
from hgorun.observers.base import OBSERVERS
from hgorun.plants.base import PLANTS

MATHML = "{http://www.w3.org/1998/Math/MathML}"
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


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "xhat_i' = rho^ - theta^-1 z_(n-1)''",
            r"{\dot{\hat{x}}}_{i} = \hat{\rho} - \theta^{-1} \, {\ddot{z}}_{n - 1}",
        ),
        ("z+ = a b/c + (k+1)/T", r"z^{+} = \frac{a \, b}{c} + \frac{k + 1}{T}"),
        ("(a/b + 1)/c", r"\frac{\frac{a}{b} + 1}{c}"),
        ("(T/eps) (x + 1/2)^2", r"\frac{T}{\varepsilon} \, \left( x + \frac{1}{2} \right)^{2}"),
        ("|w_1|^(i/(N+1)) sign(e)", r"\left| w_{1} \right|^{i / (N + 1)} \, \operatorname{sign}(e)"),
        ("sum_(j=3..i) 1/alpha_j", r"\sum_{j = 3 \ldots i} \frac{1}{\alpha_{j}}"),
        ("K^(1), S_1inf <= s_in", r"K^{(1)} ,\  S_{1\infty } \le s_{\mathrm{in}}"),
        ("e/d for |e| <= d, else 1", r"\frac{e}{d} \text{ for } \left| e \right| \le d ,\  \text{ else } 1"),
        ("F = [[A, b/c], [0, 1]]", r"F = \begin{bmatrix} A & \frac{b}{c} \\ 0 & 1 \end{bmatrix}"),
        ("sqrt(x1) z! 1e8 cos alpha", r"\sqrt{x_{1}} \, z! \, 10^{8} \, \cos \, \alpha"),
    ],
)
def test_a_formula_of_a_docstring_is_read_as_it_is_meant(text: str, expected: str) -> None:
    assert formula(text) == expected


def test_relations_stand_below_each_other_and_conditions_beside_their_equation() -> None:
    assert displayed("    a'   = 1,    a(0) = 0\n    long = 2") == (
        "\\begin{aligned}\n\\dot{a} & = 1 ,\\  \\qquad a(0) = 0 \\\\\n\\text{ long } & = 2\n\\end{aligned}"
    )
    wide = displayed(f"x' = {'a + ' * 20}a,    i < n,    y = {'b + ' * 5}b")
    assert wide.count(r"\\") == 1
    assert wide.index("i < n") < wide.index(r"\\")


def test_matrices_that_are_drawn_are_matrices() -> None:
    found = displayed("    [ 1 + a   2 ] [x]\n    [ 3       4 ] [y]")
    assert found == r"\begin{bmatrix} 1 + a & 2 \\ 3 & 4 \end{bmatrix} \begin{bmatrix} x \\ y \end{bmatrix}"


WORDS = (
    "above and at else explicit first for from has held if implicit it last likewise of once proper reached smoothing "
    "stiffness the time to when same start equation dwell disturbance"
)


@pytest.mark.costly
@pytest.mark.parametrize(
    ("name", "cls"), [*OBSERVERS.all().items(), *PLANTS.all().items()], ids=[*OBSERVERS.names(), *PLANTS.names()]
)
def test_equations_of_every_docstring_are_formulas(name: str, cls: type) -> None:
    """Browsers can draw them, and no symbol was taken for a word."""
    for block in paragraphs(own_doc(cls)):
        if block.startswith("    "):
            root = ElementTree.fromstring(mathml(displayed(block), block=True))
            words = {word for node in root.iter(f"{MATHML}mtext") for word in (node.text or "").split()}
            assert words <= set(WORDS.split()), name


def test_equations_of_a_docstring_are_formulas_of_the_page() -> None:
    text, errata = without_errata("A theta.\n\n    theta = 1\n\nThe paper prints lam.")
    assert text == "A $\\theta$.\n\n$$\n\\begin{aligned}\n\\theta & = 1\n\\end{aligned}\n$$"
    assert errata == [r"The paper prints $\lambda$."]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("theta_1 times x^(k), and x_i' <= rho^", r"$\theta_{1}$ times $x^{(k)}$, and ${\dot{x}}_{i}$ ≤ $\hat{\rho}$"),
        ("block k of P C^T, with the k-th", r"block $k$ of $P$ $C^{T}$, with the $k$-th"),
        ("a gain a >= 0: A gain of FHGO I, and A K", r"a gain $a$ ≥ 0: A gain of FHGO I, and $A$ $K$"),
        ("an n_k x n_1 matrix, q x 2, x x", r"an $n_{k}$ × $n_{1}$ matrix, $q$ × 2, $x$ $x$"),
        ("`theta_1` and ``x``, e.g. 2n or T^+ of the plant's", r"`theta_1` and ``x``, e.g. 2n or T^+ of the plant's"),
        ("theta: half of theta; shgo_riccati (s + 1)^n", r"theta: half of $\theta$; shgo_riccati ($s$ + 1)^n"),
        ("xbar and Pbar+, that what; [0, inf)", r"$\bar{x}$ and $\bar{P}$+, that what; \[0, inf)"),
    ],
)
def test_symbols_in_a_sentence_are_formulas_and_words_and_code_stay(text: str, expected: str) -> None:
    assert readable(text) == expected


@pytest.mark.parametrize(("name", "cls"), [*OBSERVERS.all().items(), *PLANTS.all().items()])
def test_symbols_in_every_docstring_can_be_drawn(name: str, cls: type) -> None:
    text, errata = without_errata(own_doc(cls))
    sentences = re.sub(r"\$\$.*?\$\$", "", " ".join([text, *errata]), flags=re.DOTALL)
    pieces = re.split(r"(?<!\\)\$", re.sub(r"`[^`]*`", "", sentences))
    assert len(pieces) % 2, name
    for one in set(pieces[1::2]):
        ElementTree.fromstring(mathml(one))
