"""Tables: the numbers are the metrics, in every format, and no label breaks them."""

import csv
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import run
from hypothesis import given
from hypothesis import strategies as st

from hgorun import Result
from hgorun.result.metrics.base import all_metrics
from hgorun.result.records.data import Integration, IntegrationError
from hgorun.result.records.status import OK, Verdict
from hgorun.tables import metrics as tables
from hgorun.tables.latex import latex
from hgorun.tables.typeset import columns, latex_words

NAMES = tuple(all_metrics())
CONFIG: dict[str, Any] = {
    "title": "Van der Pol",
    "time": {"end": 3, "output_step": 0.01, "unit": "s"},
    "plant": {
        "states": ["x1", "x2"],
        "dynamics": {"x1": "x2", "x2": "-x1 + (1 - x1**2)*x2"},
        "output": "x1",
        "initial": {"x1": 1, "x2": 0.5},
    },
    "measurement": {"noise": [{"type": "sinusoids", "terms": [{"amplitude": 0.1, "omega": 50}]}]},
    "observers": {
        "SHGO": {"type": "shgo", "theta": 3},
        "FHGO r=2": {"type": "fhgo2", "theta": 3, "r": 2},
    },
    "solver": {"method": "rk4", "step": 0.001},
}
ODD = [
    "a_b",
    "50 % & more",
    "#1 {x}",
    "~^\\",
    "[x]",
    "*",
    "$y",
    "<b>|",
    "θ = 2",
    'say "a, b"',
    "=1+1",
    "x" * 90,
]


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    made = run(tmp_path_factory.mktemp("tables"), CONFIG, check_step=True)
    return replace(made, name="vdp")


def with_metrics(result: Result, **values: dict[str, list[float]]) -> Result:
    """Observers with these metrics; infinite ones have diverged at 1.25."""
    some = next(iter(result.observers.values()))
    return replace(
        result,
        observers={
            label: replace(
                some,
                metrics={name: np.array(v) for name, v in metrics.items()},
                verdict=Verdict("diverged", 1.25) if math.inf in metrics["rmse"] else OK,
            )
            for label, metrics in values.items()
        },
    )


def labelled(result: Result, labels: list[str]) -> Result:
    some = next(iter(result.observers.values()))
    return replace(result, observers=dict.fromkeys(labels, some))


# Text


def test_text_shows_every_number_with_four_digits(result: Result) -> None:
    shown = tables.text([result])
    words = shown.split()
    for observer in result.observers.values():
        for values in observer.metrics.values():
            for value in values:
                assert any(math.isclose(float(w), value, rel_tol=5.1e-4) for w in words if is_number(w))
    for metric in NAMES:
        for state in result.states:
            assert f"{metric} {state}" in shown
    assert shown.startswith("vdp: Van der Pol\n  rmse, sup, hf, tv: 1 to 3 s; peak: 0 to 1 s;")
    assert "integration error: plant " in shown


def is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


@pytest.mark.costly
@pytest.mark.parametrize("states", [1, 2, 3, 7, 30])
def test_text_fits_a_terminal_and_is_aligned(result: Result, states: int) -> None:
    names = tuple(f"x{i}" for i in range(states))
    metrics = {name: list(np.linspace(1e-7, 1e5, states)) for name in NAMES}
    wide = replace(
        with_metrics(result, **{"SHGO": metrics, "観測器 " + "long " * 30: metrics}),
        states=names,
        x=np.zeros((len(result.time), states)),
    )
    shown = tables.text([wide, wide])
    assert max(map(columns, shown.split("\n"))) <= 100
    blocks = [block.split("\n") for block in shown.split("\n\n")[1:] if "\n" in block]
    assert sum(line.count(f" x{states - 1}") for block in blocks for line in block[:1]) == len(NAMES)
    for block in blocks:
        assert len(block) == 5
        if "status" not in block[0]:
            assert len({columns(line) for line in block}) == 1


def test_text_says_who_diverged_and_when(result: Result) -> None:
    lost = with_metrics(result, good={"rmse": [1.0, 2.0]}, bad={"rmse": [math.inf, math.inf]})
    bad = next(line for line in tables.text([lost]).split("\n") if line.startswith("bad"))
    assert bad.split() == ["bad", "inf", "inf", "diverged", "at", "t=1.25", "s"]


def test_text_of_several_results_with_different_states(result: Result) -> None:
    other = replace(with_metrics(result, O={"rmse": [1.0]}), name="b", states=("z",), integration=None)
    shown = tables.text([result, other])
    assert "vdp: SHGO" in shown
    row = next(line for line in shown.split("\n") if line.startswith("b: O"))
    assert row.split()[-1] in {"1.000", "-"}
    assert "vdp: integration error" in shown


def test_text_without_observers(result: Result) -> None:
    assert "no observers" in tables.text([replace(result, observers={})])


def test_text_has_no_control_characters(result: Result) -> None:
    evil = replace(labelled(result, ["\x1b[31mred\r"]), title="a\x1b]0;b\x07")
    assert tables.text([evil]).replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.5, "0.5000"),
        (1234.0, "1234"),
        (60.0, "60.00"),
        (1.23456e-7, "1.235e-07"),
        (0.0, "0.000"),
        (1e5, "1.000e+05"),
    ],
)
def test_four_significant_digits(result: Result, value: float, shown: str) -> None:
    assert shown in tables.text([with_metrics(result, A={"rmse": [value, 1.0]})]).split()


# JSON


def test_json_holds_the_metrics(result: Result) -> None:
    found = json.loads(json.dumps(tables.as_json(result, "results/vdp.h5"), allow_nan=False))
    assert list(found) == ["name", "file", "status", "observers", "integration_error", "units"]
    assert found["units"] == {"time": "s"}
    assert (found["name"], found["file"], found["status"]) == ("vdp", "results/vdp.h5", "ok")
    for label, metrics in result.metrics().items():
        assert {"status": "ok", **metrics}.items() <= found["observers"][label].items()
        assert found["observers"][label]["coordinates"] == {"map": "chain", "chains": {"x1": 2}}
    assert set(found["integration_error"]) == {"plant", *result.observers}
    assert "integration_error" not in tables.as_json(replace(result, integration=None))


def test_numbers_that_are_not_finite_are_text_in_json(result: Result) -> None:
    odd = with_metrics(result, A={"rmse": [math.inf, -math.inf], "hf": [math.nan, 1.0]})
    errors = {"plant": 0.0, "A": math.inf}
    odd = replace(
        odd, integration=Integration(method="rk4", step=0.1, rtol=None, evaluations=1, error=IntegrationError(errors))
    )

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    found = json.loads(json.dumps(tables.as_json(odd), allow_nan=False), parse_constant=refuse)
    assert found["observers"]["A"]["rmse"] == {"x1": "inf", "x2": "-inf"}
    assert found["observers"]["A"]["hf"] == {"x1": "nan", "x2": 1.0}
    assert found["observers"]["A"]["status"] == "diverged"
    assert found["observers"]["A"]["status_at"] == 1.25
    assert found["observers"]["A"]["reason"] is None
    assert found["integration_error"] == {"plant": 0.0, "A": "inf"}
    assert found["file"] is None


# CSV


def test_csv_round_trip(result: Result) -> None:
    odd = labelled(result, ODD)
    read = list(csv.DictReader(io.StringIO(tables.csv([result, odd]))))
    expected = [
        (name, label, "ok", state, metric, value)
        for name, r in (("vdp", result), ("vdp (2)", odd))
        for label, metrics in r.metrics().items()
        for metric, values in metrics.items()
        for state, value in values.items()
    ]
    assert [
        (r["name"], r["observer"], r["status"], r["state"], r["metric"], float(r["value"])) for r in read
    ] == expected


def test_csv_of_a_diverged_observer(result: Result) -> None:
    odd = with_metrics(result, A={"rmse": [math.inf, math.nan]})
    assert tables.csv([odd]).split("\n")[1:3] == [
        "vdp,A,diverged at t=1.25 s,x1,rmse,inf,,",
        "vdp,A,diverged at t=1.25 s,x2,rmse,nan,,",
    ]


# LaTeX

COMMANDS = r"\\(?:toprule|midrule|bottomrule|text[a-z]+\{\}|times|infty|theta|mathbf|mathrm|[_%&#{}$])"


def assert_compiles(source: str) -> list[list[str]]:
    """What a compiler would check: environments, braces, cells per row, no stray special character.

    Returns
    -------
    list of list of str
        The cells of the body's rows.
    """
    begin, *lines, end, last = re.sub(r"^%.*\n", "", source).split("\n")
    assert (end, last) == (r"\end{tabular}", "")
    width = len(re.fullmatch(r"\\begin\{tabular\}\{(l r*)\}".replace(" ", ""), begin)[1])  # type: ignore[index]  # it matches
    rows = []
    for line in lines:
        bare = re.sub(r"\\[{}]", "", line)
        depth = 0
        for char in bare:
            depth += (char == "{") - (char == "}")
            assert depth >= 0
        assert depth == 0
        if re.fullmatch(r"\\(top|mid|bottom)rule|(\\cmidrule\(lr\)\{\d+-\d+\} ?)+", line):
            continue
        assert line.endswith(r" \\")
        assert not line.startswith(("[", "*"))
        cells = re.split(r"(?<!\\)&", line.removesuffix(r"\\"))
        spans = [int(m[1]) if (m := re.match(r" ?\\multicolumn\{(\d+)\}", cell)) else 1 for cell in cells]
        assert sum(spans) == width
        for cell in cells:
            outside = re.sub(r"(?<!\\)\$.*?(?<!\\)\$", "", cell)
            outside = re.sub(r" ?\\multicolumn\{\d+\}\{[lc]\}", "", outside)
            outside = re.sub(COMMANDS, "", outside)
            assert not re.search(r"[\\$&%#_^~<>|]", outside), cell
        rows.append([cell.strip() for cell in cells])
    return rows


def test_latex_of_a_run(result: Result) -> None:
    *rows, note = assert_compiles(latex([result]))
    # the second block has a settling time in s
    assert [row[0] for row in rows] == ["", "", "SHGO", "FHGO r=2", "", "", "", "SHGO", "FHGO r=2"]
    assert note == [r"\multicolumn{7}{l}{bold: smallest, of tv nearest to 1}"]
    assert "{bold: smallest of each run, of tv nearest to 1}" in latex([result, replace(result, name="other")])
    assert "{bold: smallest}" in latex([result], ["rmse"])
    assert "bold" not in latex([labelled(result, ["alone"])])
    assert rows[1][1:3] == ["$x_{1}$", "$x_{2}$"]


@pytest.mark.parametrize("label", ODD)
def test_any_label_survives_latex(result: Result, label: str) -> None:
    rows = assert_compiles(latex([labelled(result, [label, "other"])]))
    assert rows[2][0]


@pytest.mark.slow
@given(st.text(max_size=40))
def test_escaping_leaves_no_command(text: str) -> None:
    from hgorun.tables.typeset import latex_words

    assert_compiles(f"\\begin{{tabular}}{{l}}\n{latex_words(text)} \\\\\n\\end{{tabular}}\n")


def test_latex_escapes(result: Result) -> None:
    source = latex([labelled(result, [r"a_b 5 % & #1 \x [y]", r"$\theta_1 = 2$, θ"])])
    assert r"a\_b 5 \% \& \#1 \textbackslash{}x {[}y]" in source
    assert r"$\theta_1 = 2$, $\theta$ &" in source


def test_the_best_number_is_bold(result: Result) -> None:
    made = with_metrics(
        result,
        A={"rmse": [1.0, 1e-7], "tv": [0.5, 3.0]},
        B={"rmse": [2.0, 2e-7], "tv": [1.5, 3.0]},
        C={"rmse": [math.inf, math.inf], "tv": [math.inf, math.nan]},
    )
    rows = {row[0]: row[1:] for row in assert_compiles(latex([made]))}
    assert rows["A"] == [
        r"$\mathbf{1.000}$",
        r"$\mathbf{1.000 \times 10^{-7}}$",
        "$0.5000$",
        r"$\mathbf{3.000}$",
    ]
    assert rows["B"] == ["$2.000$", r"$2.000 \times 10^{-7}$", r"$\mathbf{1.500}$", r"$\mathbf{3.000}$"]
    assert rows["C"] == [r"$\infty$", r"$\infty$", r"$\infty$", "--"]
    assert r"\multicolumn{5}{l}{C diverged at t=1.25 s; bold: smallest, of tv nearest to 1}" in latex([made])
    assert "mathbf" not in latex([with_metrics(result, A={"rmse": [1.0, 2.0]})])


def test_runs_are_not_compared_by_bold_numbers(result: Result) -> None:
    """Another delay or noise may be why one run's numbers are smaller."""
    one = replace(with_metrics(result, A={"rmse": [1.0, 5.0]}, B={"rmse": [2.0, 4.0]}), name="one")
    two = replace(with_metrics(result, A={"rmse": [7.0, 8.0]}, B={"rmse": [6.0, 9.0]}), name="two")
    rows = {row[0]: ["mathbf" in cell for cell in row[1:]] for row in assert_compiles(latex([one, two]))}
    assert rows["one: A"] == rows["two: B"] == [True, False]
    assert rows["one: B"] == rows["two: A"] == [False, True]


def test_units_stand_in_the_head_also_the_time_alone_and_never_one_that_a_run_contradicts(result: Result) -> None:
    metrics = {"rmse": [1.0, 2.0], "settling": [1.0, 2.0]}
    one = replace(with_metrics(result, A=metrics), name="one", units={"time": "s"})
    assert r" &  &  & {[}s] & {[}s] \\" in latex([one])
    both = [
        replace(one, units={"time": "h", "x1": unit}, name=name) for unit, name in (("g/L", "one"), ("mg/L", "two"))
    ]
    source = latex(both)
    assert r" &  &  & {[}h] & {[}h] \\" in source
    assert "x1 in g/L (one), mg/L (two)" in source
    assert_compiles(source)


def test_latex_of_chosen_metrics_and_of_many_states(result: Result) -> None:
    rows = assert_compiles(latex([result], metrics=("tv", "rmse")))
    assert rows[0][1:] == [r"\multicolumn{2}{c}{tv}", r"\multicolumn{2}{c}{rmse}"]
    states = 9
    wide = replace(
        with_metrics(result, A={name: [1.0] * states for name in NAMES}),
        states=tuple(f"x{i}" for i in range(states)),
    )
    assert len(assert_compiles(latex([wide]))) == 3 * len(NAMES) + 1  # the unit of settling times
    assert_compiles(latex([replace(result, observers={})]))


def test_a_stored_result_gives_the_same_tables(result: Result, tmp_path: Path) -> None:
    import hgorun

    again = replace(hgorun.read(result.save(tmp_path / "vdp.h5")), name="vdp")
    assert tables.text([again]) == tables.text([result])
    assert tables.csv([again]) == tables.csv([result])
    assert tables.as_json(again) == tables.as_json(result)


def test_latex_names_who_diverged_and_shows_what_is_no_number(result: Result) -> None:
    lost = with_metrics(result, good={"rmse": [1.0, math.nan]}, bad={"rmse": [math.inf, -math.inf]})
    shown = latex([lost])
    assert r"bad & $\infty$ & $-\infty$ \\" in shown
    assert " & -- " in shown
    assert "\\midrule\n\\multicolumn{3}{l}{bad diverged at t=1.25 s; bold: smallest} \\" in shown


def test_latex_of_no_metrics_has_the_labels_alone(result: Result) -> None:
    assert latex([result], metrics=[]).splitlines() == [
        r"% needs \usepackage{booktabs}",
        r"\begin{tabular}{l}", r"\toprule", r"\midrule", r"SHGO \\", r"FHGO r=2 \\", r"\bottomrule", r"\end{tabular}",
    ]  # fmt: skip


def test_a_metric_that_a_file_does_not_have_is_a_dash(result: Result) -> None:
    """An older file, beside one of today."""
    older = replace(with_metrics(result, A={"rmse": [1.0, 2.0]}), name="older", integration=None)
    assert " -- " in latex([result, older])
    row = next(line for line in tables.text([result, older]).split("\n") if line.startswith("older: A"))
    assert row.split()[2:] == ["1.000", "2.000", *["-"] * (len(row.split()) - 4)]


def test_remarks_stand_in_json(result: Result) -> None:
    assert tables.as_json(replace(result, remarks=("one", "two")))["remarks"] == ["one", "two"]
    assert "remarks" not in tables.as_json(result)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\u03b8 = 2", r"$\theta$ = 2"),
        ("\u039b", r"$\Lambda$"),
        ("\u03bb", r"$\lambda$"),
        ("\u03c2", "\u03c2"),
        ("50 %", r"50 \%"),
    ],
)
def test_greek_letters_are_commands_where_latex_has_them(text: str, shown: str) -> None:
    assert latex_words(text) == shown


@pytest.mark.parametrize(
    ("sup", "hf", "word"),
    [
        (0.1, 0.03, "never"),  # noise as large as 5 % of the peak
        (0.1, 1e-4, "2.900"),  # slow, and smooth
        (0.04, 0.01, "2.900"),  # noise below it
    ],
)
def test_a_settling_time_that_noise_decides_is_none(result: Result, sup: float, hf: float, word: str) -> None:
    """The last time above 5 % of the peak is then a chance of the last samples: no number, no bold one, a reason."""
    numbers = {"rmse": [1e-3, 1e-3], "sup": [sup, 0.0], "peak": [1.0, 1.0], "hf": [hf, 0.0], "settling": [2.9, 1.0]}
    one = with_metrics(result, good=numbers | {"sup": [0.0, 0.0], "settling": [2.95, 1.0]}, noisy=numbers)
    row = next(line for line in tables.text([one]).split("\n") if line.startswith("noisy") and "1.000" in line)
    assert word in row.split()
    assert ("settling: never, where noise lifts the error" in tables.text([one])) == (word == "never")
    shown = next(line for line in latex([one], ["settling"]).split("\n") if line.startswith("noisy"))
    assert ("never" in shown, r"\mathbf{2.900}" in shown) == (word == "never", word != "never")
    assert tables.as_json(one)["observers"]["noisy"]["settling"]["x1"] == 2.9


def test_an_estimate_that_is_lost_is_not_said_to_rest(result: Result) -> None:
    """Of a state that does not move a ratio is infinite, and so it is of an estimate that a step has lost."""
    sizes = {"rmse": [1.0, 1.0], "tv": [math.inf, 1.2]}
    still = with_metrics(result, A=sizes)
    assert "no tv x1: what does not move in the window has no such ratio" in tables.text([still])
    observer = still.observers["A"]
    lost = np.where(np.arange(len(result.time))[:, None] < 9, observer.xhat, np.nan)
    shown = tables.text([replace(still, observers={"A": replace(observer, xhat=lost, verdict=Verdict("inaccurate"))})])
    assert "inaccurate" in shown
    assert "inf" in shown
    assert "no tv" not in shown
