"""What an exported observer does when it is told something unusual, and what its header says."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from examples import CONTOIS, Block, chain, experiment, inline
from exported_c import COMPILERS, Compiled, compile_c, driven, follow, load_all

from hgorun.errors import ConfigError
from hgorun.export.c_code import Real
from hgorun.export.c_cost import costs
from hgorun.export.c_files import c_files
from hgorun.export.c_header import header, max_steps
from hgorun.export.c_memory import bytes_of
from hgorun.export.c_source import Source
from hgorun.export.names import identifier
from hgorun.export.prepared import Wanted, exported, only
from hgorun.simulation.preparation.preparation import prepare
from hgorun.simulation.prepared import PreparedRun

OK, OLD, NOT_FINITE, BAD_TIME, TOO_FAR, INCOMPLETE = range(6)
ANGLE = inline({"a": "b", "b": "-sin(a) - 0.1*b"}, "a", 3.0) | {"output": {"phi": {"value": "a", "period": "2*pi"}}}
DRIVEN = inline({"a": "b", "b": "-sin(a) - 0.1*b + u"}, "a", inputs={"u": "where(t < 2.05, 0.3, -0.2)"})
CHAIN = chain(2, "-x1", 1.0)
TWO = inline({"a": "b", "b": "-a + c", "c": "d", "d": "-c - a*b"}, ["a", "c"])
NOISE = [{"type": "gaussian", "std": 0.02}]


def run_of(plant: Block, block: Block, measurement: Block, **more: Any) -> PreparedRun:
    return prepare(experiment(plant, {"O": block}, measurement=measurement, **{"step": 0.01, "end": 3.0, **more}))


RUNS = {
    "late": run_of(CHAIN, {"type": "fhgo2", "theta": 2, "r": 1}, {"sampling": {"period": 0.1}, "delay": 0.25}),
    "jumps": run_of(CHAIN, {"type": "deadbeat"}, {"sampling": {"period": 0.1}}),
    "angle": run_of(ANGLE, {"type": "shgo", "theta": 2}, {"sampling": {"period": 0.1}, "noise": NOISE}),
    "two": run_of(
        TWO,
        {"type": "shgo_riccati", "theta": 2},
        {"outputs": {"a": {"sampling": {"period": 0.1}}, "c": {"sampling": {"period": 0.17}, "delay": 0.05}}},
    ),
    "corrected": run_of(
        TWO,
        {"type": "ekf", "Q": {"a": 0.1, "d": 0.2}, "initial": {"b": 1}},
        {"noise": NOISE, "outputs": {"a": {"sampling": {"period": 0.1}}, "c": {"sampling": {"period": 0.17}}}},
    ),
    "adapts": run_of(
        TWO,
        {"type": "aekf", "theta_1": 2, "update": "jump", "initial": {"b": 1}},
        {"noise": NOISE, "sampling": {"period": 0.1}},
    ),
    "phases": run_of(
        CHAIN,
        {"type": "shgo", "theta": 2},
        {
            "phases": [
                {"until": 1.5, "sampling": {"period": 0.1}},
                {"until": 3, "sampling": {"period": 0.3}, "delay": 0.1},
            ]
        },
    ),
    "large": run_of(
        chain(10, "-x1 + sin(t)/(1 + x1**2)"),
        {"type": "shgo_riccati", "theta": 1.5},
        {"sampling": {"period": 0.1}, "delay": 0.02},
    ),
    "jumps of time": run_of(
        DRIVEN, {"type": "reduced_sampled", "H": 3, "initial": {"b": 1}}, {"sampling": {"period": 0.1}}
    ),
    "kinks": run_of(
        CONTOIS, {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": 10}}, {"sampling": {"period": 0.2}}
    ),
    "euler": run_of(
        CONTOIS,
        {"type": "fhgo2", "r": 2, "theta": 2, "initial": {"x1": 1, "x2": 10}},
        {"sampling": {"period": 0.2}, "delay": 0.1},
        solver={"method": "euler", "step": 0.01},
    ),
    "dopri5": run_of(
        CONTOIS,
        {"type": "shgo", "coordinates": "canonical", "theta": 2, "initial": {"x1": 1, "x2": 10}},
        {"sampling": {"period": 0.2}},
        solver={"method": "dopri5", "step": 0.01},
    ),
    "auto": run_of(
        CONTOIS, {"type": "shgo", "theta": 2, "initial": {"x1": 1, "x2": 10}}, {"sampling": {"period": 0.2}}, step=None
    ),
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Compiled]:
    """All runs' observers in one library, each under the name of its run."""
    observers = []
    for name, run in RUNS.items():
        (observer,) = exported(run)
        observers.append(replace(observer, label=name))
    return load_all(tmp_path_factory.mktemp("c"), observers)


def test_inputs_that_are_told_to_an_observer_that_jumps(tmp_path: Path) -> None:
    """The value at a sample and at the one before."""
    run = RUNS["jumps of time"]
    one, found = load_all(tmp_path, exported(run, Wanted(inputs_given=True)))["O"], driven(run)
    switched = found.events[np.argmin(np.abs(found.events - 2.05))]
    assert one.input(0.0, [0.3]) == OK
    for t, samples, theirs in zip(found.events, found.samples, found.estimates["O"], strict=True):
        assert one.predict(t) == OK
        if t == switched:
            assert one.input(t, [-0.2]) == OK
        for _, _, y, _ in samples:
            assert one.update(t, [y], 1) == OK
        assert np.allclose(one.estimate, theirs, rtol=1e-12, atol=1e-12)
    assert one.input(5.0, [np.nan]) == NOT_FINITE


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_numbers(name: str, compiled: dict[str, Compiled]) -> None:
    run = RUNS[name]
    found = driven(run)
    own, theirs = np.array(list(follow(run, found, compiled[identifier(name)]))), found.estimates["O"]
    assert np.ptp(theirs, axis=0).max() > 0.05
    assert np.max(np.abs(own - theirs)) <= 1e-12 * np.max(np.abs(theirs))


@pytest.mark.parametrize("name", RUNS)
def test_the_header_tells_the_size(name: str, compiled: dict[str, Compiled]) -> None:
    observer = compiled[identifier(name)].observer
    assert (
        bytes_of(Source(observer, Real()))
        == ctypes.c_ulong.in_dll(compiled[identifier(name)].library, f"size_{identifier(name)}").value
    )


def started(one: Compiled) -> Compiled:
    return Compiled(one.library, one.observer, one.single)


def test_times_and_values_that_are_none(compiled: dict[str, Compiled]) -> None:
    one = started(compiled["late"])
    assert one.predict(0.5) == OK
    before = one.memory.raw
    assert one.predict(0.4) == one.predict(np.nan) == BAD_TIME
    assert one.predict(0.5 + 0.01 * (max_steps(one.observer) + 1)) == TOO_FAR
    assert one.predict(np.inf) == one.predict(-np.inf) == BAD_TIME
    for t in (np.nan, -1.0, np.inf, -np.inf):
        assert one.update(t, [1.0], 1) == BAD_TIME
    assert one.update(0.5, [np.nan], 1) == one.update(0.5, [np.inf], 1) == NOT_FINITE
    assert one.predict(0.5) == one.update(0.5, [1.0], 0) == OK
    assert one.memory.raw == before


def test_samples_that_are_too_old(compiled: dict[str, Compiled]) -> None:
    one = started(compiled["late"])
    for t in np.arange(1, 200) / 10:
        assert one.predict(t) == OK
    reach = one.observer.pieces * 0.01
    assert one.update(19.9 - 1.01 * reach, [1.0], 1) == OLD
    assert one.update(19.8, [1.0], 1) == OK
    assert one.update(19.7, [1.0], 1) == OLD
    assert one.update(20.5, [1.0], 1) == OK  # a clock that is a little ahead
    angle = started(compiled["angle"])
    assert angle.predict(1.0) == OK
    assert angle.update(0.9, [1.0], 1) == OLD  # nothing is remembered


def test_a_copy_of_the_memory_goes_on_alike(compiled: dict[str, Compiled]) -> None:
    one, other = started(compiled["late"]), started(compiled["late"])
    for k in range(1, 40):
        if k == 20:
            ctypes.memmove(other.memory, one.memory, len(one.memory))
        for each in (one, other) if k >= 20 else (one,):
            assert each.predict(k / 10) == OK
            assert each.update(max(k / 10 - 0.25, 0.0), [np.sin(k)], 1) == OK
    assert np.array_equal(one.estimate, other.estimate)
    assert one.memory.raw == other.memory.raw


def test_an_observer_that_jumps_needs_all_outputs_now(compiled: dict[str, Compiled]) -> None:
    one = started(compiled["jumps"])
    assert one.predict(1.0) == OK
    assert one.update(1.0, [1.0], 0) == INCOMPLETE
    assert one.update(0.5, [1.0], 1) == OLD
    assert one.predict(0.5) == BAD_TIME


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_samples_of_one_time_correct_together_however_they_are_told(
    compiled: dict[str, Compiled], order: tuple[int, int]
) -> None:
    found = driven(RUNS["adapts"])
    one, other = started(compiled["adapts"]), started(compiled["adapts"])
    y = [0.0, 0.0]
    for t, samples, theirs in zip(found.events, found.samples, found.estimates["O"], strict=True):
        assert one.predict(t) == other.predict(t) == OK
        if samples:
            y = [value for _, _, value, _ in sorted(samples)]
            assert one.update(t, y, 3) == OK
            for i in order:
                wrong = [1e6, 1e6]  # what is not told is not read
                wrong[i] = y[i]
                assert other.update(t, wrong, 1 << i) == OK
        assert np.array_equal(one.estimate, other.estimate)
        assert np.max(np.abs(other.estimate - theirs)) <= 1e-12
    assert one.update(t, y, 1) == other.update(t, y, 3) == OK  # sent again: corrected twice
    assert not np.array_equal(one.estimate, other.estimate)


def test_silence(compiled: dict[str, Compiled]) -> None:
    """Without an innovation the observer is the plant's copy: of x1'' = -x1, whose energy stays."""
    one = started(compiled["phases"])
    one.predict(0.1)
    one.update(0.1, [5.0], 1)
    one.predict(0.5)
    one.silence(1)
    before = np.sum(one.estimate**2)
    one.predict(2.5)
    assert np.sum(one.estimate**2) == pytest.approx(before, rel=1e-6)
    one.update(2.5, [5.0], 1)
    one.predict(3.0)
    assert abs(np.sum(one.estimate**2) / before - 1) > 0.1


def test_many_samples_keep_their_digits(compiled: dict[str, Compiled]) -> None:
    """A history that has been filled many times over: the numbers of the engine, which keeps all."""
    run = prepare(RUNS["late"].experiment.varied({"time.end": 40}))
    one, found = started(compiled["late"]), driven(run)
    assert one.observer.pieces * 0.01 < 4
    own = np.array(list(follow(run, found, one)))
    assert np.max(np.abs(own - found.estimates["O"])) <= 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("options", [("-O0",), ("-O2", "-ffp-contract=off")], ids=["O0", "O2"])
def test_compilers(compiler: str, options: tuple[str, ...], tmp_path: Path) -> None:
    files: dict[str, str] = {}
    for name in ("late", "two", "dopri5"):
        (observer,) = exported(RUNS[name])
        files |= c_files(observer, single=name == "two")
    assert compile_c(tmp_path, files, *options, compiler=compiler).exists()


def test_what_an_observer_does_without_is_not_there(tmp_path: Path) -> None:
    """No warning of what nothing reads: differentiators read no inputs, and the slope of some not even the state."""
    files: dict[str, str] = {}
    blocks: list[Block] = [
        {"type": "levant", "G": 3},
        {"type": "savgol", "window": 3, "degree": 1},
        {"type": "red", "L": 3},
    ]
    for block in blocks:
        run = run_of(DRIVEN, block, {"sampling": {"period": 0.1}})
        late = 0.3 if block["type"] == "levant" else 0.0  # the others jump at samples
        (observer,) = exported(run, Wanted(inputs_given=True, late=late))
        files |= c_files(replace(observer, label=str(block["type"])))
    (observer,) = exported(run_of(DRIVEN, {"type": "shgo", "theta": 2}, {}), Wanted(late=0.3))
    assert compile_c(tmp_path, {**files, **c_files(observer)}).exists()


def test_an_observer_may_be_called_as_what_its_code_has(tmp_path: Path) -> None:
    """What nothing reads is not there either where it is a part of the name of every function: no warning."""
    long, short = chain(10, "-x1 + x2/(1 + x1**2)"), {"type": "shgo", "theta": 2}
    found = [("time", run_of(long, {"type": "shgo_riccati", "theta": 1.5}, {"sampling": {"period": 0.1}}))]
    found += [(label, run_of(CHAIN, short, {"sampling": {"period": 0.1}})) for label in ("from", "to", "a stage")]
    files: dict[str, str] = {}
    for label, run in found:
        files |= c_files(replace(exported(run)[0], label=label))
    assert "(void)time;" in files["time.c"]
    compile_c(tmp_path, files, "-fsyntax-only")  # which asserts that nothing is said


def test_float_numbers(tmp_path: Path) -> None:
    run = RUNS["kinks"]
    one = load_all(tmp_path, exported(run), single=True)["O"]
    found = driven(run)
    own, theirs = np.array(list(follow(run, found, one))), found.estimates["O"]
    assert np.max(np.abs(own - theirs)) <= 2e-5 * np.max(np.abs(theirs))


def test_float_numbers_of_a_window_that_is_not_full(tmp_path: Path) -> None:
    """Two samples are too few for a parabola, whatever rounding leaves of its third column."""
    block: Block = {"type": "savgol", "window": 5, "degree": 2, "initial": {"b": 1}}
    run = run_of(DRIVEN, block, {"sampling": {"period": 0.1, "offset": 0.05}})
    found = driven(run)
    own = np.array(list(follow(run, found, load_all(tmp_path, exported(run), single=True)["O"])))
    np.testing.assert_allclose(own, found.estimates["O"], rtol=0, atol=2e-5)


def test_the_header_says_where_float_has_few_digits() -> None:
    """Of a spline, whose P begins at 1e8; not of double, nor where P begins smaller."""
    for single, own, said in ((True, {}, True), (False, {}, False), (True, {"P": [[1e4, 0], [0, 1e4]]}, False)):
        block: Block = {"type": "spline", "smoothing": 0.01, "internal": own}
        (observer,) = exported(run_of(CHAIN, block, {"sampling": {"period": 0.1}}))
        assert ("The start of P is so large" in header(Source(observer, Real(single)))) == said


def test_the_header_says_where_float_may_take_another_side() -> None:
    """Of steps across a jump; not of double, nor of a step from sample to sample."""
    for single, kind, keys, said in (
        (True, "super_twisting", {"f": 3}, True),
        (False, "super_twisting", {"f": 3}, False),
        (True, "shgo", {"theta": 2}, False),
        (True, "red", {"L": 2}, False),
    ):
        (observer,) = exported(run_of(chain(2, "0", 1.0), {"type": kind, **keys}, {"sampling": {"period": 0.1}}))
        assert ("jump where a sign changes" in header(Source(observer, Real(single)))) == said


def test_the_cost_of_a_step_is_that_of_its_stages() -> None:
    """Of two integrators with gains (4, 4): four right-hand sides and their sums."""
    run = run_of(chain(2, "0", 1.0), {"type": "shgo", "theta": 2}, {"sampling": {"period": 0.1}})
    cost = costs(Source(exported(run)[0], Real()))["step"]
    assert cost.divisions == cost.functions == 0
    assert 40 < cost.plain < 120


@pytest.mark.parametrize(("method", "clocks"), [("euler", 2), ("rk4", 3)])
def test_the_cost_of_a_step_has_functions_of_time_at_both_ends(method: str, clocks: int) -> None:
    """As a prediction of one step evaluates them: at its start, at its end, and within it."""
    solver = {"method": method, "step": 0.01}
    run = run_of(chain(2, "-x1 + sin(t)", 1.0), {"type": "shgo", "theta": 2}, {}, solver=solver)
    source = Source(exported(run)[0], Real())
    advance = source.text().partition("_advance(")[2].partition("\n}\n")[0]
    assert advance.count("_clock(") == clocks
    assert costs(source)["step"].functions == clocks


def test_the_header_says_with_whom_a_step_is_shared() -> None:
    """Found for several at once; not one that is given, nor of one that makes no steps."""
    blocks: dict[str, Block] = {"slow": {"type": "shgo", "theta": 1}, "fast": {"type": "shgo", "theta": 8}}
    blocks["jumps"] = {"type": "deadbeat"}

    def headers(observers: dict[str, Block], step: float | None) -> dict[str, str]:
        measurement = {"sampling": {"period": 0.1}}
        run = prepare(experiment(CHAIN, observers, measurement=measurement, step=step, end=1.0))
        return {one.label: header(Source(one, Real())) for one in exported(run)}

    said = headers(blocks, None)
    assert "That step was found for it and fast together; exported alone it may take longer ones." in said["slow"]
    assert "was found for it and slow together" in said["fast"]
    for text in (said["jumps"], *headers(blocks, 0.01).values(), *headers({"slow": blocks["slow"]}, None).values()):
        assert "together" not in text


def test_outputs_that_differ_in_capital_letters_alone_have_a_bit_each(tmp_path: Path) -> None:
    block: Block = {"type": "ekf", "Q": {"P": 0.1}, "R": 0.1}
    run = run_of(inline({"p": "P", "P": "r", "r": "-p"}, ["p", "P", "r"]), block, {"sampling": {"period": 0.1}})
    files = c_files(exported(run)[0])
    lines = [line.split()[1:3] for line in files["O.h"].splitlines() if "_OUTPUT_" in line]
    assert lines == [["HGO_O_OUTPUT_p", "1U"], ["HGO_O_OUTPUT_P", "2U"], ["HGO_O_OUTPUT_R", "4U"]]
    compile_c(tmp_path, files, "-fsyntax-only")


def test_names() -> None:
    assert identifier("FHGO r=2") == "FHGO_r_2"


REFUSED: dict[str, Block] = {
    "rodas5p solves": {"solver": {"method": "rodas5p", "step": 0.01}},
    "no bound": {"solver": {"method": "dopri5", "rtol": 1e-6}},
    "falls below the step": {"measurement": {"delay": "0.05*t"}},
    "differs from phase": {"measurement": {"phases": [{"until": 1, "delay": 0.1}, {"until": 3, "delay": 0.2}]}},
}


@pytest.mark.parametrize("reason", REFUSED)
def test_what_is_refused(reason: str) -> None:
    more: Block = {"measurement": {}, "solver": {"method": "rk4", "step": 0.01}} | REFUSED[reason]
    run = prepare(experiment(chain(2, "-x1"), {"O": {"type": "shgo", "theta": 2}}, end=3.0, **more))
    with pytest.raises(ConfigError, match=reason):
        exported(run)


@pytest.mark.parametrize(
    ("block", "late", "reason"),
    [
        ({"type": "predictor_chain", "theta": 2, "m": 2}, 0.0, "it looks back at its own past"),
        ({"type": "deadbeat"}, 0.3, "code of deadbeat takes samples when they are taken"),
    ],
)
def test_what_the_observer_is_refused_for(block: Block, late: float, reason: str) -> None:
    run = run_of(CHAIN, block, {"sampling": {"period": 0.1}, "delay": 0.2 * (late == 0.0)})
    with pytest.raises(ConfigError, match=reason):
        exported(run, Wanted(late=late))


@pytest.mark.parametrize("delay", [{}, {"delay": 0.1}])
def test_what_is_never_exported_is_told_before_late_samples(delay: Block) -> None:
    """Without the delay it would be refused all the same."""
    block: Block = {"type": "mhe", "window": 3, "q": 1}
    measured = {"sampling": {"period": 0.1}, "noise": [{"type": "gaussian", "std": 0.1}]}
    with pytest.raises(ConfigError) as caught:
        exported(run_of(CHAIN, block, measured | delay))
    assert "delay" not in caught.value.message
    assert str(caught.value.key).endswith("O.type")


def test_labels_that_are_one_name() -> None:
    blocks = {"A b": {"type": "shgo", "theta": 2}, "a-b": {"type": "shgo", "theta": 2}}
    both = experiment(chain(2, "-x1"), blocks, step=0.01)
    with pytest.raises(ConfigError, match="same files"):
        exported(prepare(both))
    assert [o.label for o in exported(prepare(only(both, ["a-b"])))] == ["a-b"]
    with pytest.raises(ConfigError, match="no observer is called 'c'"):
        only(both, ["c"])
