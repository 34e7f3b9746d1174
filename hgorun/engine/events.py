"""The native functions of events: what is kept, what arrives, what jumps."""

from __future__ import annotations

from hgorun.engine.layout import (
    ACTION_WORDS,
    ARRIVE,
    HEAR,
    JUMP,
    NOTHING,
    REBASE,
    RECORD,
    RESTORE,
    RETAKE,
    SAVE,
    SET,
    SHOW,
    TAKE,
    WORD,
    Held,
)
from hgorun.engine.module import Module, copy, counts, each, span
from hgorun.native.ir import Function, hexadecimal


def add_channels(m: Module) -> None:
    """``channels(ctx, t)``: all channels at the state z of the context, into its channel buffer."""
    emitted = m.emit(m.system.channels, "channels_of")
    f = m.function("channels", "ptr %ctx, double %t", attributes="nounwind noinline")
    p, z, w, out = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w", "channels"))
    c = m.constants_of(f, emitted)
    tau = f.slot("double", emitted.clocked * m.lanes)
    emitted.clock(f, f.splat("%t") if m.loose else "%t", p, c, tau)
    emitted.main(f, p, c, tau, z, w, out)
    f.do("ret void")
    m.finish(f)


def add_spreads(m: Module) -> None:
    """``spreads(ctx, t, output, to)``: those of an output at the state of the context; what is there already stays."""
    s, lanes = m.system, m.lanes
    if s.spreads is None:
        return
    emitted = m.emit(s.spreads, "spreads_of")
    f = m.function("spreads", "ptr %ctx, double %t, i64 %output, ptr %to", attributes="nounwind noinline")
    p, z, w = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w"))
    c = m.constants_of(f, emitted)
    tau, all_of = f.slot("double", emitted.clocked * lanes), f.slot("double", s.outputs * s.observers * lanes)
    emitted.clock(f, f.splat("%t") if m.loose else "%t", p, c, tau)
    emitted.main(f, p, c, tau, z, w, all_of)
    own = f.at(all_of, f.scalar("mul", "%output", str(s.observers * lanes)))
    with f.count(0, s.observers * lanes) as i:
        _keep_first(m, f, f.load(f.at(own, i)), f.at("%to", i))
    f.do("ret void")
    m.finish(f)


def add_jumps(m: Module) -> None:
    """``jump<number>(ctx, t, from, to)``: a part of the state, in some lanes, becomes what its jump says."""
    for number in range(len(m.system.jumps)):
        _add_jump(m, number)


def add_actions(m: Module) -> None:
    """``act(ctx, segment)``: what happens at the event that starts a segment.

    TAKE (output, slot): remember the output and every observer's s. ARRIVE (output, slot): the sample taken
    in the slot becomes what the observers compare with; RECORD: it came after a newer one and is only
    noted. SET (place, index): a new value of the held noise or of the time between samples, in w. REBASE
    (output, first, last): count alpha from zero again, also in the slots that are still on their way. JUMP
    (number): a part of the state becomes what its jump says. SAVE, RESTORE (-, number): keep a part of all states
    and go back to it; RETAKE (output, slot): as TAKE, of every observer's s alone. SHOW (-, row): the states become a
    row of output; where innovations are kept. HEAR (output, slot): TAKE, ARRIVE and REBASE of all samples of an event,
    none of which is on its way. Where no plant is simulated, the bound grows with what arrives.
    """
    s, lanes = m.system, m.lanes
    f = m.function("act", "ptr %ctx, i64 %segment", attributes="nounwind noinline")
    c = counts(f, "%segment")
    t = span(f, "%segment")[2]
    w, z, slots, channels = (f.word("%ctx", WORD[name], "ptr") for name in ("w", "z", "slots", "channels"))
    table, advance = (f.word("%ctx", WORD[name], "ptr") for name in ("actions", "advance"))
    event, before = f.scalar("lshr", "%segment", f.word("%ctx", WORD["shift"])), f.slot("i64")
    f.store(str(NOTHING), before, "i64")

    def channels_here() -> None:
        """Nothing has changed since samples were taken just before."""
        after = f.label()
        for op in (TAKE, RETAKE, HEAR):
            f.leave_if(f.test("eq", f.load(before, "i64"), str(op)), after)
        f.call("channels", f"ptr %ctx, double {t}")
        f.jump(after)
        f.place(after)

    with f.count(c["action_first"], c["action_last"]) as index:
        row = f.at(table, f.scalar("mul", index, str(ACTION_WORDS)))
        further = f.at(advance, f.scalar("mul", index, f.word("%ctx", WORD["advance_words"])))
        op, output = f.word(row, 0), f.word(row, 1)
        slot, first, last = (
            f.scalar("add", f.word(row, i), f.scalar("mul", event, f.word(further, i))) for i in range(2, ACTION_WORDS)
        )
        held = f.at(w, f.scalar("mul", output, str(s.held.width * lanes)))
        here = f.at(slots, f.scalar("mul", slot, str(s.width * lanes)))
        with f.choice(op) as case:
            with case(TAKE):
                channels_here()
                copy(f, f.at(channels, f.scalar("mul", output, str(s.width * lanes))), here, s.width)
            with case(SET):
                value = f.at(f.word("%ctx", WORD["holds"], "ptr"), f.scalar("mul", slot, str(lanes)))
                copy(f, value, f.at(w, f.scalar("mul", output, str(lanes))), 1)
            if s.innovations:
                with case(SHOW):
                    rows = f.word("%ctx", WORD["rows"], "ptr")
                    copy(f, z, f.at(rows, f.scalar("mul", slot, str(s.states * lanes))), s.states)
            if s.replayed is not None or s.recalled:
                with case(RETAKE):
                    channels_here()
                    of_output = f.at(channels, f.scalar("mul", output, str(s.width * lanes)))
                    copy(f, f.at(of_output, lanes), f.at(here, lanes), s.observers)
            if s.replayed is not None:
                with case(SAVE):
                    for own, saved, count in _kept_parts(m, f, slot):
                        copy(f, own, saved, count)
                with case(RESTORE):
                    _restore(m, f, slot)
            if s.jumps:
                with case(JUMP), f.choice(output) as of_number:
                    for number in range(len(s.jumps)):
                        with of_number(number):
                            f.call(f"jump{number}", f"ptr %ctx, double {t}, i64 0, i64 {lanes}")
            with case(ARRIVE, RECORD):
                y = _measure(m, f, slot, here)
                if s.innovations:
                    measured = f.at(f.word("%ctx", WORD["measured"], "ptr"), f.scalar("mul", slot, str(lanes)))
                    _keep_innovations(m, f, output, slot, here, measured, t)
                with f.when(f.test("eq", op, str(ARRIVE))):
                    if not s.plant_states:
                        _grow(f, y)
                    copy(f, f.at(held, Held.OUTPUT * lanes), f.at(held, Held.PREVIOUS * lanes), 1)
                    f.store(y, f.at(held, Held.OUTPUT * lanes), f.real)
                    copy(f, f.at(here, lanes), f.at(held, Held.S * lanes), s.observers)
            if s.hears:
                with case(HEAR):
                    channels_here()
                    _hear(m, f, output, slot, held)
            with case(REBASE):
                for i in each(f, s.observers * lanes):
                    place = f.scalar("add", f.scalar("mul", output, str(s.observers * lanes)), str(i))
                    alpha_at = f.at(z, f.word(f.word("%ctx", WORD["alpha"], "ptr"), place))
                    alpha = f.load(alpha_at)
                    f.store(hexadecimal(0.0), alpha_at)
                    held_s = f.at(f.at(held, Held.S * lanes), i)
                    f.store(f.scalar("fadd", f.load(held_s), alpha), held_s)
                    with f.count(first, last) as pending:
                        there = f.at(slots, f.scalar("mul", pending, str(s.width * lanes)))
                        pending_s = f.at(f.at(there, lanes), i)
                        f.store(f.scalar("fadd", f.load(pending_s), alpha), pending_s)
        f.store(op, before, "i64")
    f.do("ret void")
    m.finish(f)


def _hear(m: Module, f: Function, output: str, slot: str, held: str) -> None:
    """A sample is compared and held, and alpha counted from there; channels are those before any sample was heard."""
    s, lanes = m.system, m.lanes
    here = f.at(f.word("%ctx", WORD["channels"], "ptr"), f.scalar("mul", output, str(s.width * lanes)))
    gain, bias, measured = (
        f.at(f.word("%ctx", WORD[name], "ptr"), f.scalar("mul", slot, str(lanes)))
        for name in ("gain", "bias", "measured")
    )
    y = f.add(f.mul(f.load(gain, f.real), f.load(here, f.real)), f.load(bias, f.real))
    f.store(y, measured, f.real)
    if not s.plant_states:
        _grow(f, y)
    copy(f, f.at(held, Held.OUTPUT * lanes), f.at(held, Held.PREVIOUS * lanes), 1)
    f.store(y, f.at(held, Held.OUTPUT * lanes), f.real)
    kept = f.at(f.word("%ctx", WORD["innovations"], "ptr"), f.scalar("mul", slot, str(s.noted * lanes)))
    z, alpha = f.word("%ctx", WORD["z"], "ptr"), f.word("%ctx", WORD["alpha"], "ptr")
    for j in each(f, s.observers):
        at = f.scalar("mul", str(j), str(lanes))
        place = f.scalar("add", f.scalar("mul", output, str(s.observers * lanes)), at)
        alpha_at = f.at(z, f.word(alpha, place))  # that of all lanes
        guess = f.add(f.load(f.at(f.at(here, lanes), at), f.real), f.load(alpha_at, f.real))
        f.store(f.sub(guess, y), f.at(kept, at), f.real)
        f.store(guess, f.at(f.at(held, Held.S * lanes), at), f.real)
        f.store(f.constant(0.0), alpha_at, f.real)


def _measure(m: Module, f: Function, slot: str, taken: str) -> str:
    """What is measured of an output as it was when a sample was taken; it is written down."""
    at = f.scalar("mul", slot, str(m.lanes))
    gain, bias, measured = (f.at(f.word("%ctx", WORD[name], "ptr"), at) for name in ("gain", "bias", "measured"))
    y = f.add(f.mul(f.load(gain, f.real), f.load(taken, f.real)), f.load(bias, f.real))
    f.store(y, measured, f.real)
    return y


def _grow(f: Function, measured: str) -> None:
    """The largest sample so far, from which the bound of the observers follows."""
    place = f.word("%ctx", WORD["largest"], "ptr")
    largest, size = f.load(place, f.real), f.intrinsic("fabs", measured)
    f.store(f.select(f.compare("ogt", size, largest), size, largest), place, f.real)


def _kept_parts(m: Module, f: Function, number: str) -> list[tuple[str, str, int]]:
    """Of the states and of what is held: where they are, where they are kept under a number, and how many."""
    s, lanes = m.system, m.lanes
    assert s.replayed is not None
    first, held = s.replayed
    place = f.scalar("mul", number, str(s.snapshot * lanes))
    kept = f.at(f.word("%ctx", WORD["snapshots"], "ptr"), place)
    z, w = f.word("%ctx", WORD["z"], "ptr"), f.word("%ctx", WORD["w"], "ptr")
    states, numbers = s.states - first, s.held.size - held
    return [(f.at(z, first * lanes), kept, states), (f.at(w, held * lanes), f.at(kept, states * lanes), numbers)]


def _restore(m: Module, f: Function, number: str) -> None:
    """Go back to states and what is held as they have been kept; what has diverged stays masked."""
    s, lanes = m.system, m.lanes
    assert s.replayed is not None
    for own, saved, count in _kept_parts(m, f, number):
        copy(f, saved, own, count)
    diverged, z = f.word("%ctx", WORD["diverged"], "ptr"), f.word("%ctx", WORD["z"], "ptr")
    for j, (start, _, end) in enumerate(s.blocks):
        if start >= s.replayed[0]:
            with f.count(0, lanes) as lane:
                when = f.word(f.at(diverged, j * lanes), lane, "double")
                with f.when(f.test("one", when, hexadecimal(float("inf")))), f.count(start, end) as i:
                    state = f.scalar("add", f.scalar("mul", i, str(lanes)), lane)
                    f.store(hexadecimal(float("nan")), f.at(z, state))


def _keep_innovations(m: Module, f: Function, output: str, slot: str, here: str, measured: str, t: str) -> None:
    """C xhat - y of every observer as it is compared when a sample arrives, before anything follows from it."""
    s, lanes = m.system, m.lanes
    kept = f.at(f.word("%ctx", WORD["innovations"], "ptr"), f.scalar("mul", slot, str(s.noted * lanes)))
    if s.spreads is not None:
        f.call("spreads", f"ptr %ctx, double {t}, i64 {output}, ptr {f.at(kept, s.observers * lanes)}")
    z = f.word("%ctx", WORD["z"], "ptr")
    for j in each(f, s.observers):
        for lane in each(f, lanes):
            i = f.scalar("add", f.scalar("mul", str(j), str(lanes)), str(lane))
            guess = f.load(f.at(f.at(here, lanes), i))
            if s.alpha:
                place = f.scalar("add", f.scalar("mul", output, str(s.observers * lanes)), i)
                guess = f.scalar("fadd", guess, f.load(f.at(z, f.word(f.word("%ctx", WORD["alpha"], "ptr"), place))))
            _keep_first(m, f, f.scalar("fsub", guess, f.load(f.at(measured, lane))), f.at(kept, i))


def _keep_first(m: Module, f: Function, found: str, place: str) -> None:
    """Keep a number of a sample: what was thought at first, and not when it was carried out again."""
    if m.system.replayed is not None:
        first = f.load(place)
        found = f.let(f"select i1 {f.test('uno', first, first)}, double {found}, double {first}")
    f.store(found, place)


def _add_jump(m: Module, number: int) -> None:
    """Evaluated whole before it is written; what has diverged stays masked."""
    start, stop, function = m.system.jumps[number]
    emitted = m.emit(function, f"jump_of{number}")
    arguments = "ptr %ctx, double %t, i64 %from, i64 %to"
    f = m.function(f"jump{number}", arguments, attributes="nounwind noinline")
    p, z, w = (f.word("%ctx", WORD[name], "ptr") for name in ("p", "z", "w"))
    c = m.constants_of(f, emitted)
    tau, new = f.slot("double", emitted.clocked * m.lanes), f.slot("double", (stop - start) * m.lanes)
    emitted.clock(f, f.splat("%t") if m.loose else "%t", p, c, tau)
    emitted.main(f, p, c, tau, z, w, new)
    observers = [j for j, block in enumerate(m.system.blocks) if block[0] <= start < block[2]]  # none: the plant
    with f.count("%from", "%to") as lane:
        alive = "true"
        if observers:
            diverged = f.at(f.word("%ctx", WORD["diverged"], "ptr"), observers[0] * m.lanes)
            alive = f.test("oeq", f.word(diverged, lane, "double"), hexadecimal(float("inf")))
        with f.when(alive), f.count(0, stop - start) as i:
            place = f.scalar("add", f.scalar("mul", i, str(m.lanes)), lane)
            f.store(f.word(new, place, "double"), f.at(z, f.scalar("add", place, str(start * m.lanes))))
    f.do("ret void")
    m.finish(f)
