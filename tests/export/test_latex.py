"""Equations in LaTeX: read back, they have the values of the observer; every line can be typeset."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import casadi as ca
import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline
from matplotlib.mathtext import MathTextParser

from hgorun.export.latex import Document, latex
from hgorun.export.observer import Exported
from hgorun.export.prepared import Wanted, exported
from hgorun.export.typeset import Formula, _product, broken, dotted, number, written
from hgorun.observers.base import OBSERVERS, SampledObserver
from hgorun.simulation.preparation.preparation import prepare
from hgorun.testing.cases import Subject

SAMPLED: Block = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}
NOT_EXPORTED = ("aekf", "bank", "kkl", "mhe", "predictor_chain", "switched")
ASIDE = {"initial": {"x1": 1, "x2": 10}}


def exported_of(plant: Block, block: Block, measurement: Block | None = None) -> Exported:
    run = prepare(experiment(plant, {"O r=1": block}, measurement=measurement or SAMPLED, step=0.01))
    return exported(run, Wanted(steps=False))[0]


def equations(text: str) -> Iterator[tuple[str, str]]:
    """Left and right sides, lines of one equation together."""
    for block in re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL):
        for line in re.sub(r"\\\\\s*&\\quad", " ", block).split(r"\\"):
            left, right = line.split("&=")
            yield left.strip(), right.strip()


def names_of(left: str) -> str:
    """A symbol as a name of Python."""
    return "s_" + re.sub(r"\W+", "_", left)


def value(formula: str, known: dict[str, float]) -> float:
    """A formula evaluated by its typography alone."""
    for symbol in sorted(known, key=len, reverse=True):
        found = rf"(?<![A-Za-z\\]){re.escape(symbol)}(?![A-Za-z])" if symbol.isalpha() else re.escape(symbol)
        formula = re.sub(found, f"({known[symbol]!r})", formula)
    while r"\frac" in formula:
        formula = re.sub(r"\\frac\{((?:[^{}]|\{[^{}]*\})*)\}\{((?:[^{}]|\{[^{}]*\})*)\}", r"((\1)/(\2))", formula)
    formula = re.sub(r"\^\{([^{}]*)\}", r"**(\1)", formula)
    formula = formula.replace(r"\left|", "abs(").replace(r"\right|", ")").replace(r"\cdot", "*").replace(r"\,", "*")
    formula = re.sub(r"\\(?:left|right)", "", formula).replace("\\", "")
    return float(eval(formula, {"sin": math.sin, "cos": math.cos, "abs": abs}))


CASES = {
    "filtered": (CONTOIS, {"type": "fhgo2", "theta": 2, "r": 1, **ASIDE}, SAMPLED),
    "matrix": (CONTOIS, {"type": "shgo_riccati", "theta": 2, **ASIDE}, {**SAMPLED, "delay": 0.1}),
    "canonical": (CONTOIS, {"type": "shgo", "theta": 2, "coordinates": "canonical", **ASIDE}, {"delay": 0.2}),
    "powers": (chain(2, "-x1**3/7 - sin(x2)*cos(x1)**2 - abs(x1)"), {"type": "shgo", "theta": 3}, SAMPLED),
}


@pytest.mark.parametrize("name", CASES)
def test_the_equations_have_the_observers_values(name: str) -> None:
    plant, block, measurement = CASES[name]
    observer = exported_of(plant, block, measurement)
    document = Document(observer)
    random = np.random.default_rng(1)
    z, e, u = random.uniform(0.5, 2, observer.size), 0.3, 0.7
    found = document.equations
    t, p, zs, w = found.arguments
    rate = ca.Function("rate", [t, p, zs, w], [found.outputs["rate"]])
    values = np.zeros(w.numel())
    m = len(observer.plant.model.inputs)
    values[:m], values[2 * m] = u, e
    theirs = np.array(rate(0.0, found.values, z, values)).ravel()
    known = dict(zip(document.states, z.tolist(), strict=True)) | {"e": e, "D": u}
    pairs = dict(equations(latex(observer)))
    for left, right in pairs.items():
        if re.fullmatch(r"[a-z]_\{\d+\}", left) and left not in known and "(0)" not in left:
            known[left] = value(right, {k: v for k, v in known.items() if k != "e" or "e" in right})
    own = [value(pairs[dotted(state)], known) for state in document.states]
    np.testing.assert_allclose(own, theirs, rtol=1e-4, atol=1e-4)


def assert_typeset(text: str) -> None:
    parser = MathTextParser("path")
    for block in re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL):
        for line in block.split(r"\\"):
            parser.parse(f"${line.replace('&', '').strip()}$")
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") > 0
    assert text.count("{") == text.count("}")


@pytest.mark.measured("deadbeat")
@pytest.mark.slow
@pytest.mark.parametrize("name", [*CASES, "ekf", "deadbeat", "two outputs"])
def test_every_line_can_be_typeset(name: str) -> None:
    driven = inline({"a": "b", "b": "-sin(a) + u"}, "a", inputs={"u": "sin(t)"})
    two = inline({"a": "b", "b": "-a + c", "c": "d", "d": "-c - a*b"}, ["a", "c"])
    more: dict[str, tuple[Block, Block, Block]] = {
        "ekf": (driven, {"type": "ekf", "Q": {"b": 0.1}}, SAMPLED),
        "deadbeat": (driven, {"type": "deadbeat"}, SAMPLED),
        "two outputs": (two, {"type": "fhgo2", "theta": 2, "r": 1}, {"delay": 0.1, "outputs": {"a": SAMPLED}}),
    }
    assert_typeset(latex(exported_of(*(CASES | more)[name])))


@pytest.mark.slow
@pytest.mark.measured("direct_dynamic", "filtering")
@pytest.mark.parametrize("name", [name for name in sorted(OBSERVERS.names()) if name not in NOT_EXPORTED])
def test_every_family_can_be_typeset(name: str) -> None:
    cls = OBSERVERS.find(name)
    case = Subject(cls, name, {}, None).cases[0]
    sampled = SAMPLED if issubclass(cls, SampledObserver) else None
    run = prepare(case.experiment({name: {"initial": case.aside}}, measurement=sampled))
    assert_typeset(latex(exported(run, Wanted(steps=False))[0]))


def test_an_abbreviation_is_defined_once() -> None:
    """Between samples and at them, long expressions have numbers of one row."""
    shared = "exp(-a*b/(1 + a**2 + b**2))"
    plant = inline({"a": f"b*{shared}", "b": f"-a + {shared}"}, f"a*{shared}")
    text = latex(exported_of(plant, {"type": "ekf", "Q": {"b": 0.1}, "R": 0.1}, SAMPLED))
    defined = [line.split("&=")[0].strip() for line in text.splitlines() if line.startswith("  c_{")]
    assert defined == [f"c_{{{i + 1}}}" for i in range(len(defined))]
    assert len(defined) > 2


def test_signs_and_brackets() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    expressions = {
        "a": x - (y - 2),
        "b": -(x + y) * 3,
        "c": (x + y) ** 3,
        "d": -x / (1 + y),
        "e": 1e-7 * x + ca.fmin(x, ca.fabs(y)),
        "f": ca.if_else(x > 0, ca.exp(-y), ca.log(x) ** 2),
        "g": ca.logic_and(x < y, ca.logic_or(y >= 2, x == 0)),
        "h": ca.logic_not(ca.logic_and(x < y, y <= 2)) + ca.logic_or(x, ca.logic_and(x < 2, y < 3)),
    }
    function = ca.Function("f", [x, y], list(expressions.values()), ["x", "y"], list(expressions))
    found = written(function, {(0, 0): "x", (1, 0): "y"}, "k").formulas
    assert {name: formula.text for name, (formula,) in found.items()} == {
        "a": "x - y + 2",
        "b": r"-3 \, \left(x + y\right)",
        "c": r"\left(x + y\right)^{3}",
        "d": r"-\frac{x}{1 + y}",
        "e": r"1 \cdot 10^{-7} \, x + \min\left(x, \left|y\right|\right)",
        "f": (
            r"\mathbf{1}\!\left(x > 0\right) \, \exp\left(-y\right)"
            r" + \mathbf{1}\!\left(x \leq 0\right) \, \ln\left(x\right)^{2}"
        ),
        "g": r"\mathbf{1}\!\left(x < y \wedge \left(y \geq 2 \vee x = 0\right)\right)",
        "h": (
            r"\mathbf{1}\!\left(\neg\left(x < y \wedge y \leq 2\right)\right)"
            r" + \mathbf{1}\!\left(x \neq 0 \vee \left(x < 2 \wedge y < 3\right)\right)"
        ),
    }


def test_a_long_condition_is_abbreviated() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    condition = ca.sin(x * y + 1) * ca.exp(x) > ca.cos(y - 2 * x) * y
    function = ca.Function("f", [x, y], [ca.if_else(condition, x, y)])
    found = written(function, {(0, 0): "x", (1, 0): "y"}, "k")
    ((name, formula),) = found.abbreviations
    assert formula.text.startswith(r"\mathbf{1}\!\left(")
    ((whole,),) = found.formulas.values()
    assert (name, whole.text) == ("k_{1}", r"k_{1} \, x + \left(1 - k_{1}\right) \, y")


def test_what_stands_before_a_condition_is_explained_where_there_is_one() -> None:
    """And one of two cases has the values of the plant's equation."""
    plant = inline({"a": "b", "b": "where(a > 0.5, a**2, 2*a)"}, "a")
    text = latex(exported_of(plant, {"type": "shgo", "theta": 3}))
    assert r"\mathbf{1}\!\left(\hat{a} > 0.5\right) \, \hat{a}^{2}" in text
    assert r"2 \, \hat{a} \, \mathbf{1}\!\left(\hat{a} \leq 0.5\right)" in text
    assert text.count(r"Here $\mathbf{1}(A)$ is 1 where $A$ holds, and 0 elsewhere.") == 1
    assert_typeset(text)
    assert "Here" not in latex(exported_of(chain(2, "-x1"), {"type": "shgo", "theta": 3}))


def test_the_sign_of_either_factor_stands_before_both() -> None:
    x, y = Formula(("x",)), Formula(("y",))
    minus_x, minus_y = Formula(("-x",)), Formula(("-y",))
    assert _product(minus_x, y).text == _product(x, minus_y).text == r"-x \, y"
    assert _product(minus_x, minus_y).text == r"x \, y"


def test_long_sums_are_broken() -> None:
    x = ca.SX.sym("x", 40)
    function = ca.Function("f", [x], [ca.sum1(x)])
    ((formula,),) = written(function, {(0, i): f"x_{{{i}}}" for i in range(40)}, "k").formulas.values()
    lines = broken(formula)
    assert len(lines) > 1
    assert all(line.startswith("+") for line in lines[1:])
    assert number(-2.5).negative
