"""Symbolic expressions as formulas of LaTeX."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from hgorun.symbolic.instructions import Instruction, read
from hgorun.symbolic.interpreter import CALLS

_SUM, _PRODUCT, _POWER, _ATOM = range(4)  # what binds more tightly is larger
_SHORT = 10  # characters: what is as short is written again wherever it is needed
_SHORT_CONDITION = 20
_LINE = 70  # characters of a line
_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln"}
_KNOWN = {"sin", "cos", "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "ln", "exp"}
_RELATIONS = {ca.OP_LT: "<", ca.OP_LE: r"\leq", ca.OP_EQ: "=", ca.OP_NE: r"\neq"}
_OPPOSITE = {"<": r"\geq", r"\leq": ">", "=": r"\neq", r"\neq": "=", ">": r"\leq", r"\geq": "<"}
_FROM_THE_RIGHT = {"<": ">", r"\leq": r"\geq", "=": "=", r"\neq": r"\neq"}
_AND, _OR, _NOT = r"\wedge", r"\vee", r"\neg"
_LOGICAL = {ca.OP_AND: _AND, ca.OP_OR: _OR}
INDICATOR = r"\mathbf{1}"
"""Of what stands in brackets behind it: 1 where that holds, else 0."""


@dataclass(frozen=True)
class Formula:
    """A formula and what binds it together.

    Attributes
    ----------
    terms : tuple of str
        What is added; those behind the first begin with a sign.
    level : int
    condition : str
        Where it is 1, being 0 elsewhere; empty for what has other values.
    """

    terms: tuple[str, ...]
    level: int = _ATOM
    condition: str = ""

    @property
    def text(self) -> str:
        return " ".join(self.terms)

    @property
    def negative(self) -> bool:
        return self.terms[0].startswith("-")

    def inside(self, level: int) -> str:
        """The formula where something binds as tightly: in brackets, if that is needed."""
        needed = self.level < level or (self.negative and level > _SUM)
        return bracketed(self.text) if needed else self.text


def bracketed(text: str) -> str:
    return rf"\left({text}\right)"


@dataclass(frozen=True)
class Written:
    """Formulas, and those that they are abbreviated by.

    Attributes
    ----------
    formulas : dict of str to list of Formula
        By the names of the outputs.
    abbreviations : list of (str, Formula)
        In an order in which each needs those before it.
    """

    formulas: dict[str, list[Formula]]
    abbreviations: list[tuple[str, Formula]]


def written(function: ca.Function, names: Mapping[tuple[int, int], str], letter: str, first: int = 1) -> Written:
    """The outputs of a function as formulas.

    Parameters
    ----------
    function : casadi.Function
        On SX, with numbers in place of parameters.
    names : mapping of (int, int) to str
        What the entries of its inputs are called.
    letter : str
        What abbreviations are called: long expressions that are needed several times.
    first : int
        The number of the first of them.
    """
    instructions = read(function)
    uses = Counter(a for i in instructions for a in i.arguments)
    known: dict[int, Formula] = {}
    outputs = [function.name_out(k) for k in range(function.n_out())]
    found: dict[str, dict[int, Formula]] = {name: {} for name in outputs}
    short: list[tuple[str, Formula]] = []
    for i in instructions:
        if i.op == ca.OP_OUTPUT:
            found[outputs[i.place[0]]][i.place[1]] = known[i.arguments[0]]
            continue
        formula = _formula(i, known, names)
        short_enough = _SHORT_CONDITION if formula.condition else _SHORT
        if uses[i.value] > 1 and width(formula.text) > short_enough:
            name = rf"{letter}_{{{len(short) + first}}}"
            short.append((name, formula))
            formula = Formula((name,), condition=f"{name} = 1" if formula.condition else "")
        known[i.value] = formula
    return Written({name: [of[k] for k in range(len(of))] for name, of in found.items()}, short)


def _formula(i: Instruction, known: Mapping[int, Formula], names: Mapping[tuple[int, int], str]) -> Formula:
    if i.op == ca.OP_INPUT:
        return Formula((names[i.place],))
    if i.op == ca.OP_CONST:
        return number(i.number)
    a = [known[k] for k in i.arguments]
    if i.op in (ca.OP_ADD, ca.OP_SUB):
        return _sum(a[0], a[1], minus=i.op == ca.OP_SUB)
    if i.op == ca.OP_MUL:
        return _product(a[0], a[1])
    return _other(i.op, a)


def number(value: float) -> Formula:
    """A number with six digits; whole and half turns with all of them, since periods are counted in them."""
    for turns, text in ((2.0, r"2 \, \pi"), (1.0, r"\pi")):
        if abs(value) == turns * math.pi:
            return Formula((text if value > 0 else f"-{text}",), _PRODUCT)
    text = f"{value:.6g}"
    if "e" in text:
        digits, exponent = text.split("e")
        return Formula((rf"{digits} \cdot 10^{{{int(exponent)}}}",), _PRODUCT)
    return Formula((text.replace("inf", r"\infty").replace("nan", r"\mathrm{undefined}"),))


def _sum(a: Formula, b: Formula, *, minus: bool) -> Formula:
    terms = list(b.terms)
    signed = [f"+ {terms[0]}" if not b.negative else f"- {terms[0].lstrip('- ')}", *terms[1:]]
    if minus:
        signed = [_turned(term) for term in signed]
    return Formula((*a.terms, *signed), _SUM)


def difference(a: Formula, b: Formula) -> Formula:
    """a - b."""
    return _sum(a, b, minus=True)


def called_max(a: Formula, b: Formula) -> Formula:
    """The larger one."""
    return Formula((_called(ca.OP_FMAX, [a.text, b.text]),))


def wrapped(symbol: str, period: Formula) -> Formula:
    """A symbol without whole periods, in [-period/2, period/2)."""
    turns = _called(ca.OP_FLOOR, [rf"\frac{{{symbol}}}{{{period.text}}} + 0.5"])
    return difference(Formula((symbol,)), _product(period, Formula((turns,))))


def _turned(term: str) -> str:
    """A term with the other sign."""
    return f"{'-' if term.startswith('+') else '+'}{term[1:]}"


def _negative(a: Formula) -> Formula:
    """The formula with the other sign; sums stay together."""
    if len(a.terms) > 1:
        return Formula((f"-{bracketed(a.text)}",), _PRODUCT)
    return Formula((a.text[1:].lstrip() if a.negative else f"-{a.text}",), min(a.level, _PRODUCT))


def _product(a: Formula, b: Formula) -> Formula:
    """Two factors, a number first; a sign stands before both."""
    if a.negative and len(a.terms) == 1:
        return _negative(_product(_negative(a), b))
    if b.negative and len(b.terms) == 1:
        return _negative(_product(a, _negative(b)))
    base = _base(a)
    power = re.fullmatch(rf"{re.escape(base)}(?:\^\{{(\d+)\}})?", _base(b) if a == b else b.text)
    if power and not re.fullmatch(r"[\d.]+", base):
        return Formula((f"{base}^{{{int(power[1] or 1) + 1}}}",), _POWER)
    first, second = a.inside(_PRODUCT), b.inside(_PRODUCT)
    if second[:1].isdigit() and not first[:1].isdigit():
        first, second = second, first
    return Formula((rf"{first} \cdot {second}" if second[:1].isdigit() else rf"{first} \, {second}",), _PRODUCT)


def _other(op: int, a: Sequence[Formula]) -> Formula:
    first = a[0].text
    if op == ca.OP_ASSIGN:
        return a[0]
    if op == ca.OP_NEG:
        return _negative(a[0])
    if op == ca.OP_TWICE:
        return _product(number(2.0), a[0])
    if op == ca.OP_SQ:
        return _power(a[0], "2")
    if op in (ca.OP_POW, ca.OP_CONSTPOW):
        return _power(a[0], a[1].text)
    if op in (ca.OP_DIV, ca.OP_INV):
        above, below = (a[0], a[1]) if op == ca.OP_DIV else (number(1.0), a[0])
        if above.negative and len(above.terms) == 1:
            return _negative(Formula((rf"\frac{{{_negative(above).text}}}{{{below.text}}}",), _PRODUCT))
        return Formula((rf"\frac{{{above.text}}}{{{below.text}}}",), _PRODUCT)
    if op in _RELATIONS:
        return _where(_relation(first, _RELATIONS[op], a[1].text))
    if op == ca.OP_NOT and a[0].condition == f"{first} = 1":  # an abbreviation
        return Formula(("1", f"- {first}"), _SUM, f"{first} = 0")
    if op == ca.OP_NOT:
        return _where(_opposite(_condition(a[0])))
    if op in _LOGICAL:
        return _where(f" {_LOGICAL[op]} ".join(_apart(_condition(one)) for one in a))
    if op == ca.OP_IF_ELSE_ZERO:
        return _product(a[0], a[1])
    return Formula((_called(op, [one.text for one in a]),))


def _power(base: Formula, exponent: str) -> Formula:
    return Formula((f"{_base(base)}^{{{exponent}}}",), _POWER)


def _base(a: Formula) -> str:
    """A formula as it stands below an exponent."""
    plain = a.level == _ATOM and "^" not in a.text and not a.negative
    return a.text if plain else bracketed(a.text)


def _where(condition: str) -> Formula:
    """What is 1 where a condition holds, else 0."""
    return Formula((rf"{INDICATOR}\!{bracketed(condition)}",), condition=condition)


def _relation(left: str, sign: str, right: str) -> str:
    """A relation, a number on its right."""
    if re.fullmatch(r"-?[\d.]+", left):
        return f"{right} {_FROM_THE_RIGHT[sign]} {left}"
    return f"{left} {sign} {right}"


def _condition(a: Formula) -> str:
    """Where a formula is not 0."""
    return a.condition or rf"{a.text} \neq 0"


def _apart(condition: str) -> str:
    """A condition as it stands beside others."""
    return bracketed(condition) if any(sign in condition for sign in (_AND, _OR)) else condition


def _opposite(condition: str) -> str:
    """Where a condition does not hold."""
    parts = condition.split(" ")
    signs = [i for i, part in enumerate(parts) if part in _OPPOSITE]
    if len(signs) != 1 or INDICATOR in condition:  # several relations, or one within a value
        return rf"{_NOT}{bracketed(condition)}"
    parts[signs[0]] = _OPPOSITE[parts[signs[0]]]
    return " ".join(parts)


def _called(op: int, a: Sequence[str]) -> str:
    """A function with its arguments."""
    special = {
        ca.OP_SQRT: r"\sqrt{{{0}}}",
        ca.OP_FABS: r"\left|{0}\right|",
        ca.OP_FLOOR: r"\left\lfloor {0}\right\rfloor",
        ca.OP_CEIL: r"\left\lceil {0}\right\rceil",
        ca.OP_FMIN: r"\min\left({0}, {1}\right)",
        ca.OP_FMAX: r"\max\left({0}, {1}\right)",
        ca.OP_SIGN: r"\operatorname{{sign}}\left({0}\right)",
        ca.OP_COPYSIGN: r"\left|{0}\right| \, \operatorname{{sign}}\left({1}\right)",
    }
    if op in special:
        return special[op].format(*a)
    name = _NAMES.get(CALLS[op], CALLS[op])
    command = rf"\{name}" if name in _KNOWN else rf"\operatorname{{{name}}}"
    return command + bracketed(", ".join(a))


def width(text: str) -> int:
    """About how many characters wide a formula is: fractions count once, commands as one letter."""
    text = re.sub(r"\\(?:left|right|mathrm|hat|dot|operatorname|[,;])", "", text)
    return len(re.sub(r"[{}\s^_]", "", re.sub(r"\\[A-Za-z]+", "x", text)))


def broken(formula: Formula) -> list[str]:
    """The lines that a formula takes: sums are broken between their terms."""
    lines: list[str] = []
    for term in formula.terms:
        if lines and width(lines[-1]) + width(term) <= _LINE:
            lines[-1] += f" {term}"
        else:
            lines.append(term)
    return lines
