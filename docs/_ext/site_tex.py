"""Equations of docstrings as LaTeX: ``xhat' = f(xhat, u) - theta J^-1 K e`` becomes a formula of several lines.

What docstrings write: ``'`` is a derivative by time, ``xhat`` and ``rho^`` have a hat, ``z+`` is z after a jump, ``_``
and ``^`` take a name, a number or something in parentheses, a product is a space, and a clause of its own stands after
three spaces. Words stay words.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from site_letters import index as index_of
from site_letters import is_word, letter, scripted

_SIGNS = {"<=": r"\le", ">=": r"\ge", "!=": r"\ne", "->": r"\to", "+-": r"\pm", "...": r"\ldots", "..": r"\ldots"}
_WORD = re.compile(r"([A-Za-z]+)(\d*)")
_NUMBER = re.compile(r"(\d+(?:\.\d+)?)(?:e(\d+))?")
_INDEX = re.compile(r"\w+(?:,\w+)*")
_RELATION = re.compile(r"(?<!\S)(?:=|<=|>=|->)(?!\S)")
_CLAUSES = re.compile(r"\s{3,}")
_ROW = re.compile(r"\[\s*(.*?)\s*\](?=\s|$)")
_WIDE = 84  # characters of a line; its clauses stand below each other where it is longer, but for short ones
_SHORT = 16


def displayed(block: str) -> str:
    """The lines of equations of a docstring, as LaTeX with the relations below each other."""
    lines = [line.strip() for line in block.replace("``", "").splitlines() if line.strip()]
    if all(line.lstrip("= ").startswith("[ ") for line in lines):
        return _matrices(lines)
    rows = [row for line in lines for row in _rows(line)]
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"


def _rows(line: str) -> list[str]:
    """A line, or where it is long its clauses in lines of their own."""
    clauses = _CLAUSES.split(re.sub(r"\s+(?=(?:=|<=|>=|->)\s)", " ", line))
    long = len(" ".join(clauses)) > _WIDE
    rows: list[str] = []
    for clause in clauses:
        if rows and (len(clause) <= _SHORT or not long):
            rows[-1] += rf" \qquad {formula(clause)}"
        else:
            rows.append(_aligned(clause))
    return rows


def _aligned(clause: str) -> str:
    relation = _RELATION.search(clause)
    if relation is None:
        return "& " + formula(clause)
    return f"{formula(clause[: relation.start()])} & {formula(clause[relation.start() :])}"


def _matrices(lines: list[str]) -> str:
    """Rows of matrices that are drawn with brackets, an entry from the next by two spaces."""
    columns = zip(*(_ROW.findall(line) for line in lines), strict=True)
    sign = "= " if lines[0].startswith("=") else ""
    return sign + " ".join(_matrix([re.split(r"\s{2,}", row) for row in rows]) for rows in columns)


def _matrix(rows: list[list[str]]) -> str:
    inside = r" \\ ".join(" & ".join(map(formula, row)) for row in rows)
    return rf"\begin{{bmatrix}} {inside} \end{{bmatrix}}"


def formula(text: str) -> str:
    """A formula or a part of one, as LaTeX."""
    return _Reader(" ".join(text.split())).all()


@dataclass
class _Reader:
    """Reads from the left to the right.

    Attributes
    ----------
    text : str
    small : bool
        Whether it is an index or an exponent, where fractions have a slash.
    at : int
        The place of the next character.
    """

    text: str
    small: bool = False
    at: int = 0

    def all(self) -> str:
        done: list[str] = []
        factors = 0  # of the product that is being written
        while self.at < len(self.text):
            if self._takes(" "):
                continue
            if sign := next((sign for sign in _SIGNS if self._takes(sign)), ""):
                done.append(_SIGNS[sign])
                factors = 0
            elif self._next() == "/" and factors and not self.small:
                self.at += 1 + self.text.startswith(" ", self.at + 1)
                above = " ".join(done[-2 * factors + 1 :])  # the product so far, with the spaces in it
                done[-2 * factors + 1 :] = [rf"\frac{{{_bare(above)}}}{{{_bare(self._atom())}}}"]
                factors = 1
            elif is_word(self.text[self.at :]):
                done.append(rf"\text{{ {self._words()} }}")
                factors = 0
            elif self._next() in "+-=<>,;:/.)]":
                done.append(self._sign())
                factors = 0
            else:
                large = self.text.startswith(("sum_", "int_"), self.at)
                done += [r"\,"] if factors else []
                done.append(self._atom())
                factors = 0 if large else factors + 1  # a fraction is behind the sign of a sum, not below
        return " ".join(done)

    def _next(self) -> str:
        return self.text[self.at : self.at + 1]

    def _takes(self, start: str) -> bool:
        found = self.text.startswith(start, self.at)
        self.at += len(start) if found else 0
        return found

    def _sign(self) -> str:
        self.at += 1
        return self.text[self.at - 1] + (r"\ " if self.text[self.at - 1] == "," and not self.small else "")

    def _words(self) -> str:
        words = []
        while is_word(self.text[self.at :]):
            word = _WORD.match(self.text, self.at)
            assert word is not None
            words.append(word[0])
            self.at = word.end() + self.text[word.end() :].startswith(" ")
        return " ".join(words)

    def _atom(self) -> str:
        """A symbol, a number or something in brackets, with what belongs to it."""
        if number := _NUMBER.match(self.text, self.at):
            self.at = number.end()
            return self._scripts(number[1] if number[2] is None else rf"10^{{{number[2]}}}")
        if self._next() == "|":
            return self._scripts(rf"\left| {_Reader(self._inside('|', '|'), self.small).all()} \right|")
        if self.text.startswith("[[", self.at):
            rows = _split(self._inside("[", "]"))
            return _matrix([_split(row.strip()[1:-1]) for row in rows])
        for opening, closing in ("()", "[]"):
            if self._next() == opening:
                inside = _Reader(self._inside(opening, closing), self.small).all()
                if _is_fraction(inside) and self._next() not in tuple("^_'"):
                    return inside
                if r"\frac" in inside:
                    return self._scripts(rf"\left{opening} {inside} \right{closing}")
                return self._scripts(opening + inside + closing)
        word = _WORD.match(self.text, self.at)
        if word is None:
            self.at += 1
            return self.text[self.at - 1]
        self.at = word.end()
        if word[1] == "sqrt" and self._next() == "(":
            return rf"\sqrt{{{_Reader(self._inside('(', ')')).all()}}}"
        if word[1] == "binom" and self._next() == "(":
            return _binomial(self._inside("(", ")"))
        return self._scripts(letter(word[1]), word[2])

    def _inside(self, opening: str, closing: str) -> str:
        """What is between the bracket here and its counterpart."""
        start, depth = self.at + 1, 0
        for place in range(self.at, len(self.text)):
            char = self.text[place]
            depth += char == opening and (place == self.at or opening != closing)
            depth -= char == closing and place > self.at
            if depth == 0:
                self.at = place + 1
                return self.text[start:place]
        raise ValueError(f"{opening} is not closed: {self.text}")

    def _scripts(self, base: str, index: str = "") -> str:
        """What follows a base without a space: indices, powers, dots, arguments."""
        power = ""
        while self.at < len(self.text):
            rest = self.text[self.at :]
            if rest[0] == "_" and (found := self._script()):
                index += found
            elif re.match(r"\^(?=$|[\s',.;)])", rest):
                self.at += 1
                base = rf"\hat{{{base}}}"
            elif rest[0] == "^":
                power += self._script()
            elif dots := re.match("'+", rest):
                self.at += dots.end()
                base = rf"\{'d' * dots.end()}ot{{{base}}}"
            elif re.match(r"\+(?=$|[\s,;)])", rest) and base != ")":
                self.at += 1
                power += "+"
            elif rest[0] == "!":
                self.at += 1
                return scripted(base, index, power) + "!"
            elif rest[0] == "(" and not base.endswith((")", "]")):
                return self._called(scripted(base, index, power))
            else:
                break
        return scripted(base, index, power)

    def _called(self, written: str) -> str:
        """A function with its arguments, which may be a power or a derivative as a whole."""
        return self._scripts(f"{written}({_Reader(self._inside('(', ')'), self.small).all()})")

    def _script(self) -> str:
        sign = self._next()
        self.at += 1
        if self._next() == "(":
            inside = self._inside("(", ")")
            written = _Reader(inside, small=True).all()
            return f"({written})" if sign == "^" and len(inside) == 1 else written  # K^(1) is no power
        minus = "-" if self._takes("-") else ""
        if sign == "_":
            found = _INDEX.match(self.text, self.at)
            self.at = found.end() if found else self.at
            return minus + (index_of(found[0]) if found else "")
        if number := _NUMBER.match(self.text, self.at):
            self.at = number.end()
            return minus + number[0]
        word = _WORD.match(self.text, self.at)
        self.at = word.end() if word else self.at
        if word and self._next() == "_":
            return minus + scripted(letter(word[1]), self._script(), "")
        return minus + (scripted(letter(word[1]), word[2], "") if word else "")


def _is_fraction(text: str) -> bool:
    """Whether a text is one fraction, whose line tells as much as parentheses."""
    found = re.fullmatch(r"\\frac\{(.*)\}", text)
    if found is None:
        return False
    depths = [text[: i + 1].count("{") - text[: i + 1].count("}") for i in range(len(r"\frac"), len(text))]
    return depths.count(0) == 2


def _bare(text: str) -> str:
    """Without the parentheses around all of it, which a fraction makes superfluous."""
    text = re.sub(r"^\\left\( ((?:(?!\\left|\\right).)*) \\right\)$", r"(\1)", text)
    if not (text.startswith("(") and text.endswith(")")):
        return text
    depth = [text[: i + 1].count("(") - text[: i + 1].count(")") for i in range(len(text) - 1)]
    return text[1:-1] if min(depth) > 0 and ",\\ " not in text else text


def _split(text: str) -> list[str]:
    """At the commas that are in no bracket."""
    parts, depth = [""], 0
    for char in text:
        depth += (char in "([") - (char in ")]")
        if char == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += char
    return parts


def _binomial(arguments: str) -> str:
    above, below = map(formula, _split(arguments))
    return rf"\begin{{pmatrix}} {above} \\ {below} \end{{pmatrix}}"
