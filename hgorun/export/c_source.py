"""An observer as one file of C99: what moves it in time and what tells it of samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from hgorun.engine.methods import Row
from hgorun.export.c_code import Real
from hgorun.export.c_functions import Functions
from hgorun.export.c_history import HISTORY
from hgorun.export.observer import Exported, Output

_LARGEST = {False: 1e300, True: 1e37}


@dataclass(frozen=True, eq=False, repr=False)
class Source:
    """Writes the file ``<label>.c``.

    Attributes
    ----------
    observer : Exported
    real : Real
    """

    observer: Exported
    real: Real

    @property
    def prefix(self) -> str:
        """Of functions and types."""
        return f"hgo_{self.observer.name}_"

    @property
    def upper(self) -> str:
        """Of macros."""
        return self.prefix.upper()

    @cached_property
    def functions(self) -> Functions:
        """The observer's equations."""
        return Functions(self.observer, self.real, self.prefix)

    def text(self) -> str:
        """The whole file, without the comment at its top."""
        body = "\n".join(self._functions())
        muladd = _MULADD if "~muladd(" in body.replace(self.prefix, "~") else ""
        names = [*(["float"] if "DBL_EPSILON" in body else []), "math", *(["stddef"] if "NULL" in body else [])]
        includes = f'#include "{self.observer.name}.h"\n\n' + "".join(f"#include <{name}.h>\n" for name in names) + "\n"
        return includes + self._filled(muladd) + body

    def _functions(self) -> Iterator[str]:
        observer = self.observer
        yield from self.functions.text()
        if observer.continuous or observer.inputs:
            yield self._filled(_LINES)
        if observer.remembered:
            yield self._filled(HISTORY)
        if observer.inputs:
            yield from self._inputs()
        if observer.flows:
            yield from self._slope()
            yield from self._step()
        yield from self._init()
        yield from self._predict()
        if observer.sampled:
            yield from self._update()
        if observer.continuous:
            yield from self._measure()
        if observer.inputs:
            yield self._filled(_INPUT)
        if observer.flows:
            yield self._filled(_SILENCE)
        yield from self._estimate()

    def _filled(self, template: str) -> str:
        """A template with the names of this observer: ~ stands for the prefix, REAL for the type of numbers."""
        fast = "FP_FAST_FMAF" if self.real.single else "FP_FAST_FMA"
        text = template.replace("FAST_FMA", fast).replace("FMA(", f"{self.real.function('fma')}(")
        text = text.replace("ZERO", self.real.number(0.0)).replace("ONE", self.real.number(1.0))
        return text.replace("REAL", self.real.name).replace("~~", self.upper).replace("~", self.prefix)

    @property
    def timed(self) -> bool:
        """Whether some equation depends on time itself."""
        return bool(self.observer.equations.clocked)

    def _tau(self, time: str, *, declare: bool = True) -> list[str]:
        """Lines that compute what depends on time alone."""
        if not self.timed:
            return []
        size = len(self.observer.equations.clocked)
        return [*([f"    {self.real.name} tau[{size}];"] if declare else []), f"    {self.prefix}clock({time}, tau);"]

    def _told(self, time: str, *, slopes: bool = False) -> list[str]:
        """Lines that fill u, and du, with the inputs at a time."""
        m = len(self.observer.inputs)
        if not m:
            return []
        arrays = ["u", "du"] if slopes else ["u"]
        lines = [f"    {self.real.name} {name}[{m}];" for name in arrays]
        return [*lines, f"    {self.prefix}inputs(s, {time}, u{', du' if slopes else ', NULL'});"]

    def _inputs(self) -> Iterator[str]:
        yield self._filled(_INPUTS)

    def _slope(self) -> Iterator[str]:
        """The right-hand side at a time and a state."""
        observer, real, functions = self.observer, self.real, self.functions.all
        rate, q = functions["rate"], len(observer.outputs)
        compared = [functions["guess"]] if any(o.continuous and o.delay is None for o in observer.outputs) else []
        late = [functions["delay"]] if any(o.delay is not None for o in observer.outputs) else []
        told = any("u" in function.arrays for function in (rate, *compared, *late))
        body = self._told("time") if told else []
        body += [f"    {real.name} {f.output}[{f.size}];" for f in (*compared, *late)]
        body += [f"    {real.name} past;"] if late else []
        body += [f"    {real.name} e[{q}];", ""] if "e" in rate.arrays else [""]
        body += [f"    {f.call(f.output)}" for f in (*compared, *late)]
        if "e" in rate.arrays:
            body += [line for i, output in enumerate(observer.outputs) for line in self._innovation(i, output)]
        text = "\n".join(body)
        unused = [] if "s->" in text or "(s," in text else ["    (void)s;"]
        unused += [] if "time" in text else ["    (void)time;"]
        yield f"static void {self.prefix}slope(const {self.prefix}observer *s, double time,"
        yield f"    {self._with_tau}const {real.name} z[], {real.name} dz[])"
        yield from ("{", *body, *unused)
        yield f"    {rate.call('dz')}"
        yield from ("}", "")

    @property
    def _with_tau(self) -> str:
        """What depends on time alone as a parameter, where there is something."""
        return f"const {self.real.name} tau[], " if self.timed else ""

    def _innovation(self, i: int, output: Output) -> Iterator[str]:
        """Lines that set e[i]."""
        observer, zero = self.observer, self.real.number(0.0)
        alpha = "" if observer.alpha is None else f"z[{observer.alpha + i}]"
        yield f"    e[{i}] = {zero};"
        if output.sampled:
            yield f"    if (s->mode[{i}] == {self.upper}HELD) {{"
            yield f"        e[{i}] = (s->s[{i}] + {alpha}) - s->y[{i}];"
            yield "    }"
        if output.continuous:
            value = f"{self.prefix}value(&s->line[{i}], time)"
            yield f"    if (s->mode[{i}] == {self.upper}CONTINUOUS) {{"
            if output.delay is None:
                yield f"        e[{i}] = guess[{i}] - {value};"
            else:
                late = [k for k, o in enumerate(observer.outputs) if o.delay is not None].index(i)
                place = observer.remembered.index(i)
                yield f"        (void){self.prefix}recall(s, {place}U, time - (double)delay[{late}], &past);"
                yield f"        e[{i}] = (past + {alpha}) - {value};"
            yield "    }"
        if output.period is not None:
            period, half = self.real.number(output.period), self.real.number(0.5)
            yield f"    e[{i}] -= {period} * {self.real.function('floor')}((e[{i}] / {period}) + {half});"

    def _step(self) -> Iterator[str]:
        """One step of the method."""
        observer, real, method = self.observer, self.real, self.observer.method
        p, size = self.prefix, self.observer.size
        given, kept = "tau, " if self.timed else "", bool(observer.remembered)
        parameters = ["double from", "double h", *(["double end"] if self._ends else [])]
        parameters += [f"{real.name} {name}[]" for name, there in (("tau", self.timed), ("k1", kept)) if there]
        yield f"static void {p}step({p}observer *s, {', '.join(parameters)})"
        yield "{"
        yield f"    const {real.name} dt = ({real.name})h;" if real.single else "    const double dt = h;"
        names = [f"k{j + 1}" for j in range(len(method.c))]
        yield from (f"    {real.name} {name}[{size}];" for name in names[1 if kept else 0 :])
        if method.stages:
            yield f"    {real.name} stage[{size}];"
        yield "    uint32_t i;"
        yield ""
        if not kept:
            yield f"    {p}slope(s, from, {given}s->z, k1);"
        ticked = 0.0
        for c, row, name in zip(method.c[1:], method.stages, names[1:], strict=True):
            yield from self._combined(row, "stage", names)
            time = "end" if c == 1.0 else f"from + (h * {Real().number(c)})"
            if self.timed and c != ticked:
                yield f"    {p}clock({time}, tau);"
                ticked = c
            yield f"    {p}slope(s, {time}, {given}stage, {name});"
        yield from self._combined(method.result, "s->z", names)
        if self.timed and ticked != 1.0:
            yield f"    {p}clock(end, tau);"
        yield from ("}", "")

    @property
    def _ends(self) -> bool:
        """Whether a step evaluates something at its end."""
        return self.timed or 1.0 in self.observer.method.c

    def _advance(self, end: str) -> str:
        """The call of a step."""
        optional = ((end, self._ends), ("tau", self.timed), ("k1", bool(self.observer.remembered)))
        return f"{self.prefix}step(s, {', '.join(['from', 'h', *(name for name, there in optional if there)])});"

    def _combined(self, row: Row, target: str, names: list[str]) -> Iterator[str]:
        """target = z + dt scale sum_j weights[j] k_j, rounded as the engine rounds."""
        real = self.real
        total = ""
        for weight, name in zip(row.weights, names, strict=False):
            if weight == 0.0:
                continue
            term, number = f"{name}[i]", real.number(weight)
            if not total:
                total = term if weight == 1.0 else f"{number} * {term}"
            else:
                total = f"({total}) + {term}" if weight == 1.0 else f"{self.prefix}muladd({number}, {term}, {total})"
        factor = "dt" if row.scale == 1.0 else f"dt * {real.number(row.scale)}"
        yield f"    for (i = 0U; i < {self.observer.size}U; ++i) {{"
        yield f"        {target}[i] = {self.prefix}muladd({factor}, {total}, s->z[i]);"
        yield "    }"

    def _init(self) -> Iterator[str]:
        observer, real = self.observer, self.real
        numbers = ", ".join(real.number(value) for value in observer.start)
        zero = real.number(0.0)
        yield f"void {self.prefix}init({self.prefix}observer *s)"
        yield "{"
        yield f"    static const {real.name} start[{observer.size}] = {{{numbers}}};"
        yield "    uint32_t i;"
        yield ""
        yield "    s->t = 0.0;"
        yield f"    for (i = 0U; i < {observer.size}U; ++i) {{"
        yield "        s->z[i] = start[i];"
        yield "    }"
        yield f"    for (i = 0U; i < {len(observer.outputs)}U; ++i) {{"
        if observer.flows:
            yield f"        s->mode[i] = {self.upper}SILENT;"
        if observer.sampled:
            yield f"        s->y[i] = {zero};"
            yield "        s->taken[i] = 0.0;"
            if observer.flows:
                yield f"        s->s[i] = {zero};"
        if observer.continuous:
            yield f"        {self.prefix}hold(&s->line[i], 0.0, {zero});"
        yield "    }"
        if observer.jump is not None:
            yield "    s->samples = 0U;"
            yield "    s->sampled = 0.0;"
        if observer.inputs:
            yield f"    for (i = 0U; i < {len(observer.inputs)}U; ++i) {{"
            yield f"        {self.prefix}hold(&s->input[i], 0.0, {zero});"
            if observer.jump is not None:
                yield f"        s->before[i] = {zero};"
            yield "    }"
        if observer.remembered:
            yield "    s->pieces = 0U;"
            yield "    s->newest = 0U;"
            past = self.functions.all["past"]
            yield "    {"
            needed = [*(self._tau("0.0") if "tau" in past.arrays else []), *(self._told("0.0") if "u" in past.arrays else [])]
            yield from (f"    {line}" for line in needed)
            yield f"        {past.call('s->first', z='s->z')}"
            yield "    }"
        yield from ("}", "")

    def _predict(self) -> Iterator[str]:
        observer = self.observer
        p, u, real = self.prefix, self.upper, self.real
        yield f"uint32_t {p}predict({p}observer *s, double t)"
        yield "{"
        if not observer.flows:
            yield self._filled(_WAIT)
            return
        h = Real().number(observer.step)
        yield "    const double start = s->t;"
        yield f"    const double count = ceil(((t - start) / {h}) * (1.0 - 1e-9));"
        yield f"    uint32_t status = {u}OK;"
        yield ""
        yield "    if (!(t >= start)) {"
        yield f"        status = {u}BAD_TIME;"
        yield f"    }} else if (!(count <= (double){u}MAX_STEPS)) {{"
        yield f"        status = {u}TOO_FAR;"
        yield "    } else if (t > start) {"
        yield "        const uint32_t n = (count > 1.0) ? (uint32_t)count : 1U;"
        yield "        const double h = (t - start) / (double)n;"
        inside = "start"
        if observer.sides and self.timed:
            yield "        /* functions of time may jump at both ends: they are evaluated inside */"
            yield "        const double margin = 8.0 * DBL_EPSILON * (fabs(t) + h);"
            inside = "start + margin"
        if self.timed:
            yield f"        {real.name} tau[{len(observer.equations.clocked)}];"
        if observer.remembered:
            yield f"        {real.name} k1[{observer.size}];"
        yield "        uint32_t k;"
        yield "        uint32_t i;"
        yield ""
        if self.timed:
            yield f"        {p}clock({inside}, tau);"
        tau = "tau, " if self.timed else ""
        if observer.remembered:
            yield f"        {p}slope(s, start, {tau}s->z, k1);"
        yield "        for (k = 0U; k < n; ++k) {"
        yield "            const double from = start + ((double)k * h);"
        if self._ends or observer.remembered:
            yield "            const double to = ((k + 1U) == n) ? t : (start + ((double)(k + 1U) * h));"
        end = "to"
        if inside != "start":
            yield "            const double end = ((k + 1U) == n) ? (t - margin) : to;"
            end = "end"
        if observer.remembered:
            yield from self._remembered(end)
        else:
            yield f"            {self._advance(end)}"
        yield "        }"
        yield "        s->t = t;"
        yield f"        for (i = 0U; i < {observer.size}U; ++i) {{"
        yield f"            if (!({real.function('fabs')}(s->z[i]) <= {real.number(_LARGEST[real.single])})) {{"
        yield f"                status = {u}NOT_FINITE;"
        yield "            }"
        yield "        }"
        yield "    } else {"
        yield "        /* it is there already */"
        yield "    }"
        yield "    return status;"
        yield from ("}", "")

    def _remembered(self, end: str) -> Iterator[str]:
        """A step, and the piece of history that it makes."""
        p, functions = self.prefix, self.functions.all
        past, rate = functions["past"], functions["past_rate"]
        tau = "tau, " if self.timed else ""
        yield f"            {p}piece piece;"
        told = bool({"u", "du"} & {*past.arrays, *rate.arrays})
        for time, which in (("from", "0"), (end, "1")):
            if which == "1":
                yield f"            {self._advance(end)}"
                yield f"            {p}slope(s, {end}, {tau}s->z, k1);"
            yield "            {"
            if told:
                yield from (f"            {line}" for line in self._told(time, slopes=True))
            yield f"                {past.call(f'piece.s{which}', z='s->z')}"
            yield f"                {rate.call(f'piece.r{which}', z='s->z', dz='k1')}"
            yield "            }"
        yield "            piece.from = from;"
        yield "            piece.to = to;"
        yield f"            {p}remember(s, &piece);"

    def _update(self) -> Iterator[str]:
        """Samples."""
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        everything = (1 << len(observer.outputs)) - 1
        yield f"uint32_t {p}update({p}observer *s, double taken, const {real.name} y[], uint32_t which)"
        yield "{"
        yield f"    uint32_t status = {u}OK;"
        functions = self.functions.all
        compared = [i for i, o in enumerate(observer.outputs) if o.sampled and not o.remembered]
        if observer.flows and compared:
            guess = functions["guess"]
            yield f"    {real.name} guess[{len(observer.outputs)}];"
            if "tau" in guess.arrays:
                yield from self._tau("s->t")
            if "u" in guess.arrays:
                yield from self._told("s->t")
            yield ""
            yield f"    {guess.call('guess', z='s->z')}"
        if observer.jump is not None:
            yield f"    if ((which & {everything}U) != {everything}U) {{"
            yield f"        status = {u}INCOMPLETE;"
            yield "    }"
            yield f"    if (!(taken >= s->t) && (status == {u}OK)) {{"
            yield f"        status = {u}OLD;"
            yield "    }"
        yield "    if (!(taken >= 0.0)) {"
        yield f"        status = {u}BAD_TIME;"
        yield "    }"
        for i, output in enumerate(observer.outputs):
            if output.sampled:
                yield f"    if (((which & {1 << i}U) != 0U) && !({real.function('fabs')}(y[{i}]) <= {real.number(_LARGEST[real.single])})) {{"
                yield f"        status = {u}NOT_FINITE;"
                yield "    }"
        if observer.jump is not None:
            yield from self._jumped()
        else:
            for i, output in enumerate(observer.outputs):
                if output.sampled:
                    yield from self._taken(i, output)
        yield "    return status;"
        yield from ("}", "")

    def _taken(self, i: int, output: Output) -> Iterator[str]:
        """A sample of an output."""
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        assert observer.alpha is not None
        alpha = f"s->z[{observer.alpha + i}]"
        yield f"    if (((which & {1 << i}U) != 0U) && ((status == {u}OK) || (status == {u}OLD))) {{"
        if output.remembered:
            place = observer.remembered.index(i)
            yield f"        {real.name} past = {real.number(0.0)};"
            yield f"        if ((taken < s->taken[{i}]) || ({p}recall(s, {place}U, taken, &past) == 0U)) {{"
        else:
            yield f"        const {real.name} past = guess[{i}] - {alpha};"
            yield "        if (taken < s->t) {"
        yield f"            status = {u}OLD;"
        yield "        } else {"
        yield "            /* alpha is counted from zero again: it keeps its digits for ever */"
        yield f"            s->s[{i}] = past + {alpha};"
        if output.remembered:
            yield f"            {p}rebase(s, {place}U, {alpha});"
        yield f"            {alpha} = {real.number(0.0)};"
        yield f"            s->y[{i}] = y[{i}];"
        yield f"            s->taken[{i}] = taken;"
        yield f"            s->mode[{i}] = {u}HELD;"
        yield "        }"
        yield "    }"

    def _jumped(self) -> Iterator[str]:
        """A sample of all outputs at which the observer jumps."""
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        assert observer.jump is not None
        jump, q, m = self.functions.all["jump"], len(observer.outputs), len(observer.inputs)
        yield f"    if (status == {u}OK) {{"
        yield f"        {real.name} previous[{q}];"
        yield f"        {real.name} after[{observer.size}];"
        yield f"        const {real.name} interval[1] = {{({real.name})(s->t - s->sampled)}};" if real.single else (
            "        const double interval[1] = {s->t - s->sampled};"
        )
        if observer.jump.clocked:
            yield f"        {real.name} tau[{len(observer.jump.clocked)}];"
        if m:
            yield f"        {real.name} u[{m}];"
        yield "        uint32_t i;"
        yield ""
        if observer.jump.clocked:
            yield f"        {p}jump_clock(s->t, tau);"
        if m:
            yield f"        {p}inputs(s, s->t, u, NULL);"
        yield f"        for (i = 0U; i < {q}U; ++i) {{"
        yield "            previous[i] = s->y[i];"
        yield "            s->y[i] = y[i];"
        yield "            s->taken[i] = taken;"
        if observer.flows:
            yield f"            s->mode[i] = {u}HELD;"
        if observer.alpha is not None:
            yield f"            s->s[i] = (guess[i] - s->z[{observer.alpha}U + i]) + s->z[{observer.alpha}U + i];"
            yield f"            s->z[{observer.alpha}U + i] = {real.number(0.0)};"
        yield "        }"
        yield "        if (s->samples > 0U) {"
        yield f"            {jump.call('after', z='s->z', y='s->y', before='s->before')}"
        yield f"            for (i = 0U; i < {observer.size}U; ++i) {{"
        yield "                s->z[i] = after[i];"
        yield "            }"
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

    def _measure(self) -> Iterator[str]:
        observer, p, u, real = self.observer, self.prefix, self.upper, self.real
        yield f"uint32_t {p}measure({p}observer *s, double t, const {real.name} y[], uint32_t which)"
        yield "{"
        yield f"    uint32_t status = {u}OK;"
        yield ""
        for i, output in enumerate(observer.outputs):
            if output.continuous:
                yield f"    if ((which & {1 << i}U) != 0U) {{"
                yield f"        if (!({real.function('fabs')}(y[{i}]) <= {real.number(_LARGEST[real.single])})) {{"
                yield f"            status = {u}NOT_FINITE;"
                yield f"        }} else if (s->mode[{i}] == {u}CONTINUOUS) {{"
                yield f"            {p}lead(&s->line[{i}], s->t, t, y[{i}]);"
                yield "        } else {"
                yield f"            {p}hold(&s->line[{i}], s->t, y[{i}]);"
                yield f"            s->mode[{i}] = {u}CONTINUOUS;"
                yield "        }"
                yield "    }"
        yield "    return status;"
        yield from ("}", "")

    def _estimate(self) -> Iterator[str]:
        estimate = self.functions.all["estimate"]
        yield f"void {self.prefix}estimate(const {self.prefix}observer *s, {self.real.name} xhat[])"
        yield "{"
        if "tau" in estimate.arrays:
            yield from self._tau("s->t")
        if "u" in estimate.arrays:
            yield from self._told("s->t")
        yield f"    {estimate.call('xhat', z='s->z')}"
        yield from ("}", "")


_MULADD = """\
/* a b + c, rounded once where the processor can do so at once */
static inline REAL ~muladd(REAL a, REAL b, REAL c)
{
#ifdef FAST_FMA
    return FMA(a, b, c);
#else
    return (a * b) + c;
#endif
}

"""

_LINES = """\
/* a signal that has a value from now on */
static void ~hold(~line *line, double now, REAL value)
{
    line->since = now;
    line->until = now;
    line->level = value;
    line->slope = ZERO;
    line->last = value;
}

static REAL ~value(const ~line *line, double t)
{
    REAL value = line->last;

    if (t < line->until) {
        value = ~muladd(line->slope, (REAL)(t - line->since), line->level);
    }
    return value;
}

/* a signal that goes to a value at time t on a straight line, and stays there */
static void ~lead(~line *line, double now, double t, REAL value)
{
    const REAL level = ~value(line, now);

    ~hold(line, now, value);
    if (t > now) {
        line->until = t;
        line->level = level;
        line->slope = (value - level) / (REAL)(t - now);
    }
}
"""

_INPUTS = """\
/* the inputs at a time, and their slopes */
static void ~inputs(const ~observer *s, double t, REAL u[], REAL du[])
{
    uint32_t i;

    for (i = 0U; i < ~~INPUTS; ++i) {
        u[i] = ~value(&s->input[i], t);
        if (du != NULL) {
            du[i] = (t <= s->input[i].until) ? s->input[i].slope : ZERO;
        }
    }
}
"""

_INPUT = """\
uint32_t ~input(~observer *s, double t, const REAL u[])
{
    uint32_t status = ~~OK;
    uint32_t i;

    for (i = 0U; i < ~~INPUTS; ++i) {
        if (!(fabs((double)u[i]) <= 1e300)) {
            status = ~~NOT_FINITE;
        } else {
            ~lead(&s->input[i], s->t, t, u[i]);
        }
    }
    return status;
}
"""

_SILENCE = """\
void ~silence(~observer *s, uint32_t which)
{
    uint32_t i;

    for (i = 0U; i < ~~OUTPUTS; ++i) {
        if ((which & ((uint32_t)1U << i)) != 0U) {
            s->mode[i] = ~~SILENT;
        }
    }
}
"""

_WAIT = """\
    uint32_t status = ~~OK;

    if (!(t >= s->t)) {
        status = ~~BAD_TIME;
    } else {
        s->t = t;
    }
    return status;
}
"""
