"""Equations in LaTeX: read back, they have the values of the observer; every line can be typeset."""

from __future__ import annotations

import math
import re

import casadi as ca
import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline
from matplotlib.mathtext import MathTextParser
from printed_equations import Printed, equations

from hgorun.export.latex import Document, latex
from hgorun.export.observer import Exported
from hgorun.export.prepared import Wanted, exported
from hgorun.export.typeset import Formula, _product, broken, number, written
from hgorun.observers.base import OBSERVERS, SampledObserver
from hgorun.simulation.preparation.preparation import prepare
from hgorun.testing.cases import Subject

SAMPLED: Block = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}
NOT_EXPORTED = ("aekf", "bank", "kkl", "mhe", "predictor_chain", "switched")
ASIDE = {"initial": {"x1": 1, "x2": 10}}


def exported_of(plant: Block, block: Block, measurement: Block | None = None) -> Exported:
    run = prepare(experiment(plant, {"O r=1": block}, measurement=measurement or SAMPLED, step=0.01))
    return exported(run, Wanted(steps=False))[0]


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
    text = latex(observer)
    known = {"D": lambda t: u, **{output: lambda t: 0.0 for output in document.names.outputs}}
    printed = Printed(text, known, {r"\tau": lambda now, begun: 0.0} if "being the time" in text else {})
    printed.formulas["e"] = lambda scene: e
    assert printed.states == document.states
    np.testing.assert_allclose(printed.slope(0.0, z), theirs, rtol=1e-4, atol=1e-4)


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


CHAIN = {"x1": "x2", "x2": "-x1"}


def innovations(plant: Block, measurement: Block) -> tuple[str, dict[str, str]]:
    """The words before the innovations, and these, from a text that can be typeset."""
    text = latex(exported_of(plant, {"type": "shgo", "theta": 3}, measurement))
    assert_typeset(text)
    (told,) = re.findall("with the innovation(.*)\n", text)
    return told, {left: right for left, right in equations(text) if re.match(r"e|w|\\tau", left)}


def test_each_output_has_a_newest_sample() -> None:
    two = inline(CHAIN, ["x1", "x2"])
    told, found = innovations(two, SAMPLED | {"outputs": {"x2": {"sampling": {"period": 0.25}}}})
    assert told == (
        r", $\tau_i$ being the time when the newest sample of output $i$ was taken (before the first one $e_i = 0$),"
    )
    assert found["e_{2}"].startswith(r"\hat{x}_{2}(\tau_{2}) - x_{2}(\tau_{2}) + \alpha_{2}(t)")
    _, found = innovations(two, {"outputs": {"x1": {"delay": "0.1 + 0.05*sin(t)"}}})
    assert found["e_{1}"].endswith(r"+ \alpha_{1}(t) - \alpha_{1}(\tau_{1})")
    assert found["e_{2}"] == r"\hat{x}_{2} - x_{2}"
    assert found[r"\tau_{1}"] == r"\max\left(0, t - 0.1 - 0.05 \, \sin\left(t\right)\right)"


def test_the_newest_sample_may_have_been_taken_before_the_start() -> None:
    told, _ = innovations(chain(2), SAMPLED | {"delay": 0.25})
    newest = "the newest sample that has arrived was taken, or 0 if that was before the start"
    assert told == rf", $\tau$ being the time when {newest} (before the first one $e = 0$),"


def test_whole_periods_are_left_out() -> None:
    angle = inline(CHAIN, "x1") | {"output": {"phi": {"value": "x1", "period": "2*pi"}}}
    turns = r"w - 2 \, \pi \, \left\lfloor \frac{w}{2 \, \pi} + 0.5\right\rfloor"
    assert innovations(angle, {"sampling": "continuous"})[1] == {"w": r"\hat{x}_{1} - \phi", "e": turns}
    assert innovations(angle, SAMPLED)[1]["e"] == turns
    assert number(-math.pi).text == r"-\pi"


def test_a_product_is_at_one_time() -> None:
    _, found = innovations(inline(CHAIN, {"y": "x1*(2 + x1**2)"}), SAMPLED)
    at_tau = r"\left.\left(\hat{x}_{1} \, \left(2 + \hat{x}_{1}^{2}\right)\right)\right|_{\tau}"
    assert found["e"] == rf"{at_tau} - y(\tau) + \alpha(t) - \alpha(\tau)"


def test_phases_say_what_the_time_is() -> None:
    phases: Block = {"phases": [{"until": 0.5, "delay": 0.1}, {"until": 1, **SAMPLED}]}
    text = latex(exported_of(chain(2), {"type": "shgo", "theta": 3}, phases))
    assert r"Where the output is continuous, $\tau = \max\left(0, t - 0.1\right)$." in text
    phases["phases"][0].pop("delay")
    phases["outputs"] = {"x2": {"sampling": "continuous"}}
    text = latex(exported_of(inline(CHAIN, ["x1", "x2"]), {"type": "shgo", "theta": 3}, phases))
    assert r"Where output 1 is continuous, $\tau_{1} = t$." in text


def test_letters_of_the_plant_are_not_used_again() -> None:
    """An angle of attack that is called alpha, and a clipped state, which is not the state."""
    plant = inline({"alpha": "r", "r": "tau"}, "alpha", inputs={"tau": "sin(t)"})
    block = {"type": "shgo", "theta": 3, "saturation": {"r": [-1, 1]}, "clip_estimate": True}
    text = latex(exported_of(plant, block))
    taken, alpha = r"(\bar{\tau})", r"\bar{\alpha}"
    assert rf"e &= \hat{{\alpha}}{taken} - \alpha{taken} + {alpha}(t) - {alpha}{taken}" in text
    assert r"\bar{\hat{r}} &= \max\left(-1, \min\left(1, \hat{r}\right)\right)" in text
    assert_typeset(text)


def test_samples_are_compared_with_those_before_from_the_second_on() -> None:
    text = latex(exported_of(chain(2), {"type": "deadbeat"}))
    assert "When samples arrive at $t_k$ (from the second ones on), $T_{k} = t_{k} - t_{k-1}$," in text


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
