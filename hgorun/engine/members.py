"""The native loop over the members of an ensemble: W of them at a time, from their numbers to what is kept of them."""

from __future__ import annotations

from hgorun.engine.lane_tables import TABLES
from hgorun.engine.lane_tables import own as lane_word
from hgorun.engine.layout import DONE, WORD
from hgorun.engine.module import Module, copy
from hgorun.native.ir import Function, hexadecimal

# Numbers of members are read from arrays of any strides: for each an address, its rows, and the distances in words
# from row to row and from member to member.
INPUTS = ("z", "p", "gain", "bias", "holds", "awaited")
SOURCE = ("address", "rows", "row_stride", "member_stride")
# What is written of each member, arrays of shape (rows, members).
OUTPUTS = ("final", "first", "diverged", "lost", "error", "tries", "found", "kept")
OTHERS = ("count", "segments", "points", "slots", "reduce", "workspace", "reduced", "numbers", "tables")
JOB = (*(f"{name}_{part}" for name in INPUTS for part in SOURCE), *OUTPUTS, *OTHERS)
PLACE = {name: index for index, name in enumerate(JOB)}


def add_members(m: Module) -> None:
    """``members(ctx, job, from, to)``: some blocks of W members each, with the memory of one.

    A last block that is not full repeats the last member, and writes it once.
    """
    _add_spread(m)
    _add_collect(m)
    s, lanes = m.system, m.lanes
    f = m.function("members", "ptr %ctx, ptr %job, i64 %from, i64 %to")

    def job(name: str, kind: str = "i64") -> str:
        return f.word("%job", PLACE[name], kind)

    def collect(name: str, source: str, rows: str) -> None:
        target = job(name)
        with f.when(f.test("ne", target, "0")):
            f.call("collect", f"ptr {source}, i64 {rows}, ptr {job(name, 'ptr')}, i64 {first}, i64 {job('count')}")

    own = {name: f.word("%ctx", WORD[name], "ptr") for name in _OWN}
    channels = max(s.outputs * s.width, 1)
    with f.count("%from", "%to") as block:
        first = f.scalar("mul", block, str(lanes))
        for name in INPUTS:
            rows, row, member = (job(f"{name}_{part}") for part in SOURCE[1:])
            strides = f"i64 {rows}, i64 {row}, i64 {member}, i64 {first}, i64 {job('count')}"
            f.call("spread", f"ptr {job(f'{name}_address', 'ptr')}, {strides}, ptr {own[name]}")
        for name, count, value in (
            ("w", str(s.held.size), 0.0),
            ("channels", str(channels), 0.0),
            ("slots", job("slots"), 0.0),
            ("diverged", str(max(s.observers, 1)), float("inf")),
            ("lost", "1", float("inf")),
            ("error", str(s.states), 0.0),
        ):
            _fill(f, own[name], count, value)
        with f.count(0, max(s.outputs, 1) * lanes) as i:
            f.store("0", f.at(own["hints"], i), "i64")
        largest = f.constant(0.0)
        for state in range(s.plant_states):
            size = f.intrinsic("fabs", f.load(f.at(own["z"], state * lanes), f.real))
            largest = f.select(f.compare("ogt", size, largest), size, largest)
        f.store(largest, own["largest"], f.real)
        if m.loose:
            with f.count(0, s.states) as i:
                place, zero = f.scalar("mul", i, str(lanes)), f.constant(0.0)
                size = f.intrinsic("fabs", f.load(f.at(own["z"], place), f.real))
                finite = f.compare("olt", size, f.constant(float("inf")))
                f.store(f.select(finite, size, zero), f.at(own["size"], place), f.real)
        for word in ("row", "ring_count", "segment", "paused", "stopped"):
            f.store("0", f.at("%ctx", WORD[word]), "i64")
        collect("first", own["z"], str(s.states))
        f.call("begin", "ptr %ctx")
        copy(f, own["channels"], own["initial"], channels)
        if m.loose:
            _run_each(f, m, own, job("tables", "ptr"), first, job("count"), job("points"))
        else:
            verdict = f.call("run", f"ptr %ctx, i64 {job('segments')}", "i64")
            lost = f.test("ne", verdict, str(DONE))
            with f.when(f.let(f"and i1 {lost}, {f.test('eq', f.word('%ctx', WORD['stopped']), '0')}")):
                _fill(f, own["lost"], "1", float("-inf"))
            _add_last_rows(f, m, own, job("points"))
        with f.when(f.test("ne", job("first"), "0")):
            for k, state in enumerate(range(s.states) if m.shown is None else m.shown):
                at = f.at(job("first", "ptr"), f.scalar("mul", job("count"), str(state)))
                row = f.at(own["rows"], k * lanes)
                f.call("collect", f"ptr {row}, i64 1, ptr {at}, i64 {first}, i64 {job('count')}")
        with f.when(f.test("ne", job("reduce"), "0")):
            f.do(
                f"call void {job('reduce', 'ptr')}(ptr {job('workspace', 'ptr')}, ptr {own['rows']}, "
                f"ptr {job('reduced', 'ptr')})"
            )
            collect("found", job("reduced", "ptr"), job("numbers"))
        for name, source, rows in (
            ("final", "z", str(s.states)),
            ("diverged", "diverged", str(s.observers)),
            ("lost", "lost", "1"),
            ("error", "error", str(s.states)),
            ("kept", "rows", f.scalar("mul", job("points"), str(m.row_words // lanes))),
        ):
            collect(name, own[source], rows)
        if m.loose:
            collect("tries", lane_word(f, "tries"), "1")
    f.do("ret void")
    m.finish(f, "dso_local")


_OWN = (*INPUTS, "w", "channels", "initial", "slots", "diverged", "lost", "error", "hints", "largest", "size", "rows")


def _fill(f: Function, array: str, count: str, value: float) -> None:
    with f.count(0, count) as i:
        f.store(f.constant(value), f.at(array, f.scalar("mul", i, str(f.lanes))), f.real)


def _add_last_rows(f: Function, m: Module, own: dict[str, str], points: str) -> None:
    """The output points at the end of the run."""
    shown = range(m.system.states) if m.shown is None else m.shown
    with f.count(f.word("%ctx", WORD["row"]), points) as row:
        target = f.at(own["rows"], f.scalar("mul", row, str(m.row_words)))
        for k, i in enumerate(shown):
            f.store(f.load(f.at(own["z"], i * m.lanes), f.real), f.at(target, k * m.lanes), f.real)


def _run_each(f: Function, m: Module, arrays: dict[str, str], tables: str, first: str, count: str, points: str) -> None:
    """Every lane goes through the tables of its member; the output points at the end."""
    grid, last = f.word("%ctx", WORD["grid"], "ptr"), f.scalar("sub", count, "1")
    m.declarations.add("declare i64 @llvm.smin.i64(i64, i64)")
    with f.count(0, m.lanes) as lane:
        member = f.let(f"call i64 @llvm.smin.i64(i64 {f.scalar('add', first, lane)}, i64 {last})")
        base = f.at(tables, f.scalar("mul", member, str(len(TABLES))))
        for i, name in enumerate(TABLES):
            f.store(f.word(base, i), lane_word(f, name, lane), "i64")
        for name in ("segment", "row"):
            f.store("0", lane_word(f, name, lane), "i64")
        f.store(f.word(grid, 0, "double"), lane_word(f, "due", lane))
        f.store(hexadecimal(1.0), lane_word(f, "active", lane))
        for name, value in (
            ("wanted", f.word("%ctx", WORD["step"], "double")),
            ("leapt", hexadecimal(0.0)),
            ("tries", hexadecimal(0.0)),
        ):
            f.store(value, lane_word(f, name, lane))
    f.call("run_each", "ptr %ctx")
    shown = range(m.system.states) if m.shown is None else m.shown
    with f.count(0, m.lanes) as lane, f.count(f.load(lane_word(f, "row", lane), "i64"), points) as row:
        target = f.at(f.at(arrays["rows"], f.scalar("mul", row, str(m.row_words))), lane)
        for k, i in enumerate(shown):
            f.store(f.load(f.at(f.at(arrays["z"], i * m.lanes), lane)), f.at(target, k * m.lanes))


def _add_spread(m: Module) -> None:
    """``spread(source, rows, row_stride, member_stride, first, count, target)``: numbers of W members side by side."""
    arguments = "ptr %source, i64 %rows, i64 %row, i64 %member, i64 %first, i64 %count, ptr %target"
    f = m.function("spread", arguments, attributes="nounwind noinline")
    last = f.scalar("sub", "%count", "1")
    m.declarations.add("declare i64 @llvm.smin.i64(i64, i64)")
    places = []
    for lane in range(m.lanes):
        member = f.let(f"call i64 @llvm.smin.i64(i64 {f.scalar('add', '%first', str(lane))}, i64 {last})")
        places.append(f.scalar("mul", member, "%member"))
    full = f.test("eq", f.scalar("sub", places[-1], places[0]), str(m.lanes - 1))
    neighbours = f.let(f"and i1 {full}, {f.test('eq', '%member', '1')}")
    with f.when(neighbours):
        base = f.at("%source", places[0])
        with f.count(0, "%rows") as i:
            value = f.load(f.at(base, f.scalar("mul", i, "%row")), f.real)
            f.store(value, f.at("%target", f.scalar("mul", i, str(m.lanes))), f.real)
    with f.when(f.let(f"xor i1 {neighbours}, true")), f.count(0, "%rows") as i:
        base, target = f.at("%source", f.scalar("mul", i, "%row")), f.at("%target", f.scalar("mul", i, str(m.lanes)))
        for lane, place in enumerate(places):
            f.store(f.word(base, place, "double"), f.at(target, lane))
    f.do("ret void")
    m.finish(f)


def _add_collect(m: Module) -> None:
    """``collect(source, rows, target, first, count)``: what is kept of W members, to the others."""
    arguments = "ptr %source, i64 %rows, ptr %target, i64 %first, i64 %count"
    f = m.function("collect", arguments, attributes="nounwind noinline")
    left = f.scalar("sub", "%count", "%first")
    full = f.test("sge", left, str(m.lanes))
    base = f.at("%target", "%first")
    with f.when(full), f.count(0, "%rows") as i:
        value = f.load(f.at("%source", f.scalar("mul", i, str(m.lanes))), f.real)
        f.store(value, f.at(base, f.scalar("mul", i, "%count")), f.real)
    with f.when(f.let(f"xor i1 {full}, true")), f.count(0, "%rows") as i:
        source, target = f.at("%source", f.scalar("mul", i, str(m.lanes))), f.at(base, f.scalar("mul", i, "%count"))
        with f.count(0, left) as lane:
            f.store(f.word(source, lane, "double"), f.at(target, lane))
    f.do("ret void")
    m.finish(f)
