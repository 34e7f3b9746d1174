"""What an observer in C is told: samples, and values of continuous outputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hgorun.export.c_code import LAST
from hgorun.export.c_functions import Part
from hgorun.export.equations import Output
from hgorun.observers.whole_periods import UNEVEN

_SHORT, _SHORT_IN_FLOAT = 1e-9, 1e-6  # of the usual time between events: no step; its powers have no digits


class SampleWriter(Part):
    """Writes ``update`` and ``measure``."""

    def update(self) -> Iterator[str]:
        """Samples."""
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        yield f"uint32_t {p}update({p}observer *s, double taken, const {real.name} y[], uint32_t which)"
        yield "{"
        yield f"    uint32_t status = {u}OK;"
        functions = self.functions.all
        compared = [i for i, o in enumerate(observer.outputs) if o.sampled and not o.remembered]
        if observer.compares and compared:
            guess = functions["guess"]
            yield f"    {real.name} guess[{len(observer.outputs)}];"
            yield from self.functions.read_now(guess)
            yield ""
            yield f"    {guess.call('guess', z='s->z')}"
        if observer.jump is None:
            yield "    const double then = (taken < s->t) ? taken : s->t; /* a later one counts as now */"
            yield ""
        yield from self._refused()
        if observer.corrected:
            yield from self._corrected()
        elif observer.jump is not None:
            yield from self._jumped()
        else:
            for i, output in enumerate(observer.outputs):
                if output.sampled:
                    yield from self._taken(i, output)
        yield "    return status;"
        yield from ("}", "")

    def _refused(self) -> Iterator[str]:
        """What is wrong with samples: nothing is done then."""
        observer, u = self.observer, self.upper
        everything = (1 << len(observer.outputs)) - 1
        if observer.jump is not None and not observer.corrected:
            yield f"    if ((which & {everything}U) != {everything}U) {{"
            yield f"        status = {u}INCOMPLETE;"
            yield "    }"
            yield "    /* a second sample of one time, but for its rounding: no step has the length zero */"
            short = (_SHORT_IN_FLOAT if self.real.single else _SHORT) * observer.usual_gap
            yield f"    if ((s->samples > 0U) && !((s->t - s->sampled) > {short!r}) && (status == {u}OK)) {{"
            yield f"        status = {u}OLD;"
            yield "    }"
        if observer.jump is not None:
            yield f"    if (!(taken >= s->t) && (status == {u}OK)) {{"
            yield f"        status = {u}OLD;"
            yield "    }"
        if observer.period is not None:
            yield from self._off_period(observer.period)
        yield from self._no_numbers("taken", [i for i, output in enumerate(observer.outputs) if output.sampled])

    def _off_period(self, period: float) -> Iterator[str]:
        """Whether a sample is no whole number of periods after the last one, as well as the period is known."""
        number, u = repr(period), self.upper
        yield f"    if ((s->samples > 0U) && (which != 0U) && (status == {u}OK)) {{"
        yield "        const double gap = s->t - s->sampled;"
        yield f"        const double periods = floor((gap / {number}) + 0.5);"
        yield f"        const double most = {UNEVEN * period!r} * ((periods > 1.0) ? periods : 1.0);"
        yield ""
        yield f"        if (!(fabs(gap - (periods * {number})) <= most)) {{"
        yield f"            status = {u}BAD_GAP;"
        yield "        }"
        yield "    }"

    def _no_numbers(self, time: str, outputs: Sequence[int]) -> Iterator[str]:
        """What is wrong with a time and values that are no numbers."""
        yield f"    if (!(({time} >= 0.0) && ({time} <= {LAST}))) {{"
        yield f"        status = {self.upper}BAD_TIME;"
        yield "    }"
        for i in outputs:
            yield f"    if ({self._none(i)}) {{"
            yield f"        status = {self.upper}NOT_FINITE;"
            yield "    }"

    def _none(self, i: int) -> str:
        """Whether an output is given, as something that is no number."""
        real = self.real
        return f"((which & {1 << i}U) != 0U) && !({real.function('fabs')}(y[{i}]) <= {real.largest})"

    def _taken(self, i: int, output: Output) -> Iterator[str]:
        """A sample of an output."""
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        assert observer.alpha is not None
        alpha = f"s->z[{observer.alpha + i}]"
        yield f"    if (((which & {1 << i}U) != 0U) && ((status == {u}OK) || (status == {u}OLD))) {{"
        if output.remembered:
            place = observer.remembered.index(i)
            yield f"        {real.name} past = {real.number(0.0)};"
            yield f"        if ((then < s->taken[{i}]) || ({p}recall(s, {place}U, then, &past) == 0U)) {{"
        else:
            yield f"        const {real.name} past = guess[{i}] - {alpha};"
            yield "        if (then < s->t) {"
        yield f"            status = {u}OLD;"
        yield "        } else {"
        yield "            /* alpha is counted from zero again: it keeps its digits for ever */"
        yield f"            s->s[{i}] = past + {alpha};"
        if output.remembered:
            yield f"            {p}rebase(s, {place}U, {alpha});"
        yield f"            {alpha} = {real.number(0.0)};"
        yield f"            s->y[{i}] = y[{i}];"
        yield f"            s->taken[{i}] = then;"
        yield f"            s->mode[{i}] = {u}HELD;"
        yield "        }"
        yield "    }"

    def _corrected(self) -> Iterator[str]:
        """Samples of some outputs that correct the observer together."""
        observer, u, real = self.observer, self.upper, self.real
        assert observer.jump is not None
        jump, q, m = self.functions.all["jump"], len(observer.outputs), len(observer.inputs)
        yield f"    if ((status == {u}OK) && (which != 0U)) {{"
        yield f"        {real.name} fresh[{q}];"
        yield f"        {real.name} after[{observer.size}];"
        yield from self._of_jump(m if "u" in jump.arrays else 0)
        if observer.joins:
            yield from self._joined()
        given = "s->which" if observer.joins else "which"
        yield f"        for (i = 0U; i < {q}U; ++i) {{"
        yield f"            fresh[i] = {real.number(0.0)};"
        yield f"            if (({given} & ((uint32_t)1U << i)) != 0U) {{"
        yield f"                fresh[i] = {real.number(1.0)};"
        yield "            }"
        yield "            if ((which & ((uint32_t)1U << i)) != 0U) {"
        yield "                s->y[i] = y[i];"
        yield "                s->taken[i] = s->t;"
        yield "            }"
        yield "        }"
        yield f"        {jump.call('after', z='s->z', y='s->y')}"
        yield from self._becomes_after("        ")
        if observer.clocks:
            yield "        s->samples = 1U;"
            yield "        s->sampled = s->t;"
        yield "        (void)fresh;"
        yield "    }"

    def _joined(self) -> Iterator[str]:
        """Samples of other outputs that were taken at this time correct anew, with these."""
        size = self.observer.size
        yield "        if ((s->joined == s->t) && ((s->which & which) == 0U)) {"
        yield f"            for (i = 0U; (s->which != 0U) && (i < {size}U); ++i) {{"
        yield "                s->z[i] = s->before[i];"
        yield "            }"
        yield "            s->which |= which;"
        yield "        } else {"
        yield "            s->which = which;"
        yield "        }"
        yield f"        for (i = 0U; i < {size}U; ++i) {{"
        yield "            s->before[i] = s->z[i];"
        yield "        }"
        yield "        s->joined = s->t;"

    def _becomes_after(self, indent: str) -> Iterator[str]:
        """The state becomes what the jump has given."""
        yield f"{indent}for (i = 0U; i < {self.observer.size}U; ++i) {{"
        yield f"{indent}    s->z[i] = after[i];"
        yield f"{indent}}}"

    def _of_jump(self, inputs: int) -> Iterator[str]:
        """What a jump reads beside the state and the samples: declarations, then what fills them."""
        observer, p, real = self.observer, self.prefix, self.real.name
        clocked = 0 if observer.jump is None else len(observer.jump.clocked)
        yield from (f"        {real} {name}[{count}];" for name, count in (("tau", clocked), ("u", inputs)) if count)
        yield "        uint32_t i;"
        yield ""
        if clocked:
            yield f"        {p}jump_clock(s->t, tau);"
        if inputs:
            yield f"        {p}inputs(s, s->t, u, NULL);"

    def _jumped(self) -> Iterator[str]:
        """A sample of all outputs at which the observer jumps."""
        observer, u, real = self.observer, self.upper, self.real
        assert observer.jump is not None
        jump, q, m = self.functions.all["jump"], len(observer.outputs), len(observer.inputs)
        yield f"    if (status == {u}OK) {{"
        yield f"        {real.name} previous[{q}];"
        yield f"        {real.name} after[{observer.size}];"
        yield (
            f"        const {real.name} interval[1] = {{({real.name})(s->t - s->sampled)}};"
            if real.single
            else ("        const double interval[1] = {s->t - s->sampled};")
        )
        yield from self._of_jump(m)
        yield f"        for (i = 0U; i < {q}U; ++i) {{"
        yield "            previous[i] = s->y[i];"
        yield "            s->y[i] = y[i];"
        yield "            s->taken[i] = s->t;"
        if observer.compares:
            yield f"            s->mode[i] = {u}HELD;"
        if observer.alpha is not None:
            yield f"            s->s[i] = (guess[i] - s->z[{observer.alpha}U + i]) + s->z[{observer.alpha}U + i];"
            yield f"            s->z[{observer.alpha}U + i] = {real.number(0.0)};"
        yield "        }"
        yield "        if (s->samples > 0U) {"
        yield f"            {jump.call('after', z='s->z', y='s->y', before='s->before')}"
        yield from self._becomes_after("            ")
        yield "        }"
        if m:
            yield f"        for (i = 0U; i < {m}U; ++i) {{"
            yield "            s->before[i] = u[i];"
            yield "        }"
        yield "        s->samples = 1U;"
        yield "        s->sampled = s->t;"
        yield "        (void)previous;"
        yield "        (void)interval;"
        yield "    }"

    def measure(self) -> Iterator[str]:
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        yield f"uint32_t {p}measure({p}observer *s, double t, const {real.name} y[], uint32_t which)"
        yield "{"
        yield f"    uint32_t status = {u}OK;"
        yield ""
        yield from self._no_numbers("t", [i for i, output in enumerate(observer.outputs) if output.continuous])
        for i, output in enumerate(observer.outputs):
            if output.continuous:
                yield f"    if (((which & {1 << i}U) != 0U) && (status == {u}OK)) {{"
                yield f"        if (s->mode[{i}] == {u}CONTINUOUS) {{"
                yield f"            {p}lead(&s->line[{i}], s->t, t, y[{i}]);"
                yield "        } else {"
                yield f"            {p}hold(&s->line[{i}], s->t, y[{i}]);"
                yield f"            s->mode[{i}] = {u}CONTINUOUS;"
                yield "        }"
                yield "    }"
        yield "    return status;"
        yield from ("}", "")
