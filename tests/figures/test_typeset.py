"""Names, units, labels and titles as they are set in figures and tables."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgorun.tables.typeset import both, error_of, estimate_of, latex_words, paragraph, shortened, symbol, unit, words


@pytest.mark.parametrize(
    ("name", "plain", "hat"),
    [
        ("x1", "x_{1}", r"\hat{x}_{1}"),
        ("x", "x", r"\hat{x}"),
        ("x_1", "x_{1}", r"\hat{x}_{1}"),
        ("x1_2", "x_{1,2}", r"\hat{x}_{1,2}"),
        ("theta", r"\theta", r"\hat{\theta}"),
        ("s_in", r"s_{\mathrm{in}}", r"\hat{s}_{\mathrm{in}}"),
        ("al2", r"\mathrm{al}_{2}", r"\hat{\mathrm{a}}\mathrm{l}_{2}"),  # over the first letter: seen as a hat
        ("speed", r"\mathrm{speed}", r"\hat{\mathrm{s}}\mathrm{peed}"),
        ("x1a", r"\mathrm{x1a}", r"\hat{\mathrm{x}}\mathrm{1a}"),
        ("_x", r"\mathrm{\_x}", r"\mathrm{\_}\hat{\mathrm{x}}"),
        ("a\\b$", r"\mathrm{a?b?}", r"\hat{\mathrm{a}}\mathrm{?b?}"),
    ],
)
def test_names_as_mathematics(name: str, plain: str, hat: str) -> None:
    assert symbol(name) == plain
    assert symbol(name, hat=True) == hat


def test_units_in_brackets() -> None:
    assert unit("") == ""
    assert unit("g/L") == " [g/L]"
    assert unit("rad s^-2") == " [rad s$^{-2}$]"
    assert unit("$m^2$") == " [$m^2$]"


@pytest.mark.slow
@given(st.text(max_size=100))
def test_any_label_can_be_drawn_and_is_short(text: str) -> None:
    from matplotlib.mathtext import MathTextParser

    shown = words(text)
    if len(re.findall(r"(?<!\\)\$", shown)) > 1:
        MathTextParser("path").parse(shown)
    assert "\n" not in shown
    assert len(shortened(text, 20)) <= max(20, min(len(text), 40))


def test_mathematics_in_labels_is_kept_and_money_is_not() -> None:
    assert words(r"$\theta = 2$") == r"$\theta = 2$"
    assert words("5 $ and 6 $") != ""
    assert words("costs 5 $") == r"costs 5 \$"
    assert words(r"$\nosuchcommand{$") == r"\$\nosuchcommand{\$"
    assert latex_words(r"5 % of $\theta$ & $\input{x}$") == (r"5 \% of $\theta$ \& \$\textbackslash{}input\{x\}\$")


def test_titles_are_broken_between_formulas() -> None:
    title = r"Estimates of $x_1$ where $\theta = 2 + 3 + 4$, " * 4
    broken = paragraph(title.strip(), 6.0)
    assert "\n" in broken
    for line in broken.split("\n"):
        assert line.count("$") % 2 == 0


def test_titles_have_lines_about_equally_long_and_keep_numbers_with_their_units() -> None:
    title = "points: tried with all seeds; star: the minimum, on held-out seeds with its 95 % interval"
    lines = paragraph(title, 6.0).split("\n")
    assert [line.split(" ")[-1] for line in lines] == ["minimum,", "interval"]  # and no `95` beside a `%` of its own
    assert all("0.05 s" in broken or "0.05" not in broken for k in range(20, 60) for broken in
               paragraph(f"{'a' * 9} largest error in a window of 0.05 s; dotted", k / 13).split("\n"))  # fmt: skip


def test_a_formula_is_as_long_in_a_title_as_it_is_seen() -> None:
    assert "\n" not in paragraph(r"rms of $\hat{\mathrm{s}}\mathrm{peed} - \mathrm{speed}$ [rad/s]", 2.4)


def test_words_have_no_hats_on_axes() -> None:
    """One on a word is mistaken for an accent; one on a letter is mathematics."""
    assert (both("x1"), estimate_of("x1")) == (r"x_{1},\ \hat{x}_{1}", r"\hat{x}_{1}")
    assert error_of("x1") == r"\hat{x}_{1} - x_{1}"
    assert error_of("theta") == r"\hat{\theta} - \theta"
    assert error_of("T_in").startswith(r"\hat{T}")
    for one in (both("speed"), estimate_of("speed"), error_of("speed")):
        assert "hat" not in one
        assert words(f"${one}$") == f"${one}$"  # matplotlib can set it
