"""What to tell somebody whose text is not YAML.

The sentences of the parsers differ between libyaml, PyYAML and their versions, so none of them is read here. What is
wrong follows from the class of the error, from the characters at its two marks (where the problem is, and where that
which was being read began) and from the bracket that is open there.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass

import yaml

from hgorun.config.separators import misread, without_space

LINE_BREAK = re.compile(r"\r\n?|\n")
_QUOTED = {"'": re.compile(r"'(?:[^']|'')*'"), '"': re.compile(r'"(?:[^"\\]|\\.)*"', re.DOTALL)}
_TAB_INDENT = re.compile(" *\t")
_NEW_DOCUMENT = re.compile(r"(?:---|\.\.\.)(?:\s|$)")

_TAB = "a tab cannot indent: use spaces"
_BLOCK_TEXT = "after `|` or `>` the line must end; text that starts with one needs quotes"
_ALIAS = "text that starts with `*` or `&` needs quotes"
_TAG = "text that starts with `!` needs quotes; values carry no tags here"
_START = "a value cannot start with `{}`: put it in quotes"
_COLON = "one `:` too many on this line, or wrong indentation; text with `: ` in it needs quotes"
_KEY = "this line has no `:` after its key (write `key: value`, with a space behind the colon; a comment begins with #)"
_BRACKET = "the bracket opened on line {} is not closed, or a comma or a value is missing"
_INSIDE = "text with a bracket or a comma needs quotes inside { } and [ ]; between entries there is a comma"
_NO_VALUE = "`{0}:` has no value: write `{0}: value`"
_SIGN = "`- ` with a space begins a list entry, which cannot stand inside brackets: write a sign without it, as in -1"
_DIRECTIVE = 'text that starts with `%` needs quotes, as in "%H:%M"; a comment begins with #'
_ESCAPE = "an unknown escape `\\` in double quotes: use single quotes"
_QUOTE = "the quote opened on line {} is not closed"
_ENTRY = "a list entry `- ` cannot start here: put it on a line of its own"
_MISFIT = "this does not fit the lines above: check indentation, brackets and quotes"
_LIST_ENTRY = re.compile(r"-[^\S\n]")


@dataclass(frozen=True, eq=False, repr=False)
class _Place:
    """A character of the text; lines and columns count from 0."""

    text: str
    starts: tuple[int, ...]  # of the lines
    index: int

    @property
    def line(self) -> int:
        # a mark behind the last line break speaks of the last line that has something in it
        return min(bisect_right(self.starts, self.index), len(self.starts)) - 1

    @property
    def column(self) -> int:
        return self.index - self.starts[self.line]

    @property
    def char(self) -> str:
        return self.text[self.index : self.index + 1]

    @property
    def after_tab(self) -> bool:
        return self.char == "\t" or _TAB_INDENT.match(self.text, self.starts[self.line]) is not None


def explain(error: yaml.YAMLError, text: str, bracket: int | None) -> tuple[str, int]:
    """Say what is wrong with a text that a parser has refused.

    Parameters
    ----------
    error : yaml.YAMLError
    text : str
    bracket : int or None
        The line, from 1, of the innermost bracket that is open when the parser gives up.

    Returns
    -------
    str
        The sentence.
    int
        The line that it is about, from 1.
    """
    if not isinstance(error, yaml.MarkedYAMLError) or error.problem_mark is None:
        return "this is not YAML", 1
    starts = (0, *(match.end() for match in LINE_BREAK.finditer(text)))

    def place(mark: yaml.Mark) -> _Place:
        line = min(mark.line, len(starts) - 1)
        return _Place(text, starts, min(starts[line] + mark.column, len(text)))

    problem = place(error.problem_mark)
    # libyaml gives every error a second mark; one that stands at the problem says nothing
    began = place(error.context_mark) if error.context_mark is not None else problem
    if problem.after_tab:
        return _TAB, problem.line + 1
    if isinstance(error, yaml.scanner.ScannerError):
        if problem.char == ":" and problem.text[problem.index + 1 : problem.index + 2] in (",", "]", "}"):
            return _NO_VALUE.format(problem.text[began.index : problem.index].strip()[-40:]), problem.line + 1
        if began.index == problem.index:
            wanting = _without_colon(problem)
            return (_misplaced(problem), problem.line + 1) if wanting is None else (_KEY, wanting)
        return _unfinished(began, problem)
    if bracket is not None and _LIST_ENTRY.match(problem.text, problem.index):
        return _SIGN, problem.line + 1
    if bracket is not None and _after_text(problem):
        return _INSIDE, problem.line + 1
    if bracket is not None:  # at the end of the text its own line tells more
        return _BRACKET.format(bracket), problem.line + 1 if problem.char else bracket
    return _unfitting(problem), problem.line + 1


def separated(sentence: str, line: int, text: str) -> tuple[str, int]:
    """Of what :func:`explain` says, what may be said of what stands between a key and its value there or just above."""
    if sentence not in (_KEY, _COLON):
        return sentence, line
    lines = LINE_BREAK.split(text)
    for number in (line, line - 1):
        if number and (remedy := without_space(lines[number - 1])):
            return remedy, number
    remedy = misread(lines[line - 1]) if sentence == _KEY else ""
    return (f"this line has no `:` after its key: {remedy}", line) if remedy else (sentence, line)


def _after_text(problem: _Place) -> bool:
    """Whether a bracket opens behind text without quotes, as in ``{column: level [m]}``."""
    line = problem.text[problem.starts[problem.line] : problem.index]
    before = line.rstrip()[-1:]
    return problem.char in ("[", "{") and before != "" and before not in ",:[]{}\"'"


def _without_colon(problem: _Place) -> int | None:
    """The line, from 1, that should have a `:` where a later one is refused; None where that is not why."""
    if problem.char != ":":
        return None
    own = problem.text[problem.starts[problem.line] : problem.index]
    if re.fullmatch(r"[^\S\n]*[^\s:,{}\[\]\"'#]+[^\S\n]+\{.*", own):  # label {key: value}
        return problem.line + 1
    if problem.line < 1:
        return None
    line = problem.text[problem.starts[problem.line - 1] : problem.starts[problem.line]]
    before = line.partition(" #")[0].rstrip()
    plain = before.strip() and not re.search(r":(?:\s|$)|^\s*[#-]|[\[\]{}\"']", before)
    return problem.line if plain else None


def _misplaced(problem: _Place) -> str:
    """A sign that means something in YAML, where it can mean nothing."""
    return {":": _COLON, "-": _ENTRY}.get(problem.char, _START.format(problem.char))


def _unfinished(began: _Place, problem: _Place) -> tuple[str, int]:
    """Something that began well and did not end well."""
    same_line = began.line == problem.line
    if began.char in _QUOTED:
        quoted = _QUOTED[began.char].match(began.text, began.index)
        if quoted is None and (not problem.char or _NEW_DOCUMENT.match(problem.text, problem.index)):
            return _QUOTE.format(began.line + 1), began.line + 1
        if quoted is None or problem.index < quoted.end():
            return _ESCAPE, problem.line + 1
    elif began.char in ("|", ">"):
        return _BLOCK_TEXT, problem.line + 1
    elif began.char in ("*", "&") and same_line:
        return _ALIAS, problem.line + 1
    elif began.char == "!" and same_line:
        return _TAG, problem.line + 1
    elif began.char == "%" and began.column == 0:
        return _DIRECTIVE, problem.line + 1
    return _KEY, began.line + 1


def _unfitting(problem: _Place) -> str:
    """Something well-formed, in the wrong place."""
    if problem.char == "%" and problem.column == 0:
        return _DIRECTIVE
    return _TAG if problem.char == "!" else _MISFIT
