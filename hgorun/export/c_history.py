"""The history of an observer in C: for what is known late, what it thought at the time that was measured."""

from __future__ import annotations

HISTORY = """\
/* one more step of history, in place of the oldest */
static void ~remember(~observer *s, const ~piece *piece)
{
    if (s->pieces > 0U) {
        s->newest = ((s->newest + 1U) < ~~HISTORY) ? (s->newest + 1U) : 0U;
    }
    if (s->pieces < ~~HISTORY) {
        s->pieces += 1U;
    }
    s->past[s->newest] = *piece;
}

/* C xhat - alpha of an output at an earlier time, by the cubic of the step that this lies in; 0 if that is forgotten */
static uint32_t ~recall(const ~observer *s, uint32_t j, double t, REAL *value)
{
    uint32_t known = 1U;

    if ((t <= 0.0) || (s->pieces == 0U)) {
        *value = s->first[j];
    } else {
        const ~piece *piece;
        uint32_t low = 0U; /* steps back from the newest one */
        uint32_t high = s->pieces - 1U;
        uint32_t k;

        for (k = 0U; (k < 32U) && (low < high); ++k) {
            const uint32_t middle = low + ((high - low) / 2U);

            if (s->past[((s->newest + ~~HISTORY) - middle) % ~~HISTORY].from <= t) {
                high = middle;
            } else {
                low = middle + 1U;
            }
        }
        piece = &s->past[((s->newest + ~~HISTORY) - low) % ~~HISTORY];
        if (t < piece->from) {
            *value = piece->s0[j];
            known = 0U;
        } else if (t >= piece->to) {
            *value = piece->s1[j];
        } else {
            const REAL h = (REAL)(piece->to - piece->from);
            const REAL part = (REAL)((t - piece->from) / (piece->to - piece->from));
            const REAL rest = ONE - part;
            const REAL line = ~muladd(rest, piece->s0[j], part * piece->s1[j]);
            const REAL ends = ~muladd(part * h, piece->r1[j], -((rest * h) * piece->r0[j]));
            const REAL bend = ~muladd(rest - part, piece->s1[j] - piece->s0[j], ends);

            *value = ~muladd(-(part * rest), bend, line);
        }
    }
    return known;
}

/* alpha of an output counted from zero again, in the history too */
static void ~rebase(~observer *s, uint32_t j, REAL alpha)
{
    uint32_t k;

    for (k = 0U; k < s->pieces; ++k) {
        s->past[k].s0[j] += alpha;
        s->past[k].s1[j] += alpha;
    }
    s->first[j] += alpha;
}
"""
