"""What is around an observer in a unit of FMI, in C: its state, its steps and its values.

Names between @ are filled in; ~ stands for the prefix of the observer's functions.
"""

from __future__ import annotations

from typing import Literal

Version = Literal["2.0", "3.0"]
WARNING = "logStatusWarning"
"""The category of messages about samples that are left out."""

ERROR = "logStatusError"
"""That of messages about steps that fail."""

_MOST = 10  # samples that are left out of which a unit tells
VERSIONS: tuple[Version, ...] = ("2.0", "3.0")

TOP = """\
/* The functions of FMI around an observer; the observer itself allocates nothing. */
#include "@HEADER@"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif

static const char token[] = "@TOKEN@";

"""

CORE = """\
@LOGGER@
typedef struct {
    logger log; /* of the simulator, with the three below: no part of the state */
    void *environment;
    char name[64];
    int quiet; /* whether nothing is said of samples that are left out */
    ~observer observer;
    double start;
    double y[@Q@];
    double age[@Q@];
    double u[@M@];
    uint32_t left; /* samples that were left out */
    int fresh[@Q@];
} instance;

/* take the state of another instance */
static void take(instance *m, const instance *other)
{
    const logger log = m->log;
    void *const environment = m->environment;
    const int quiet = m->quiet;
    char name[sizeof(m->name)];

    (void)memcpy(name, m->name, sizeof(name));
    (void)memcpy(m, other, sizeof(*m));
    m->log = log;
    m->environment = environment;
    m->quiet = quiet;
    (void)memcpy(m->name, name, sizeof(name));
}

static void begin(instance *m)
{
    static const instance nothing;

    take(m, &nothing);
    ~init(&m->observer);
@FRESH@
}

static instance *made(const char *given)
{
    instance *m = NULL;

    if ((given != NULL) && (strcmp(given, token) == 0)) {
        m = (instance *)calloc(1, sizeof(instance));
        if (m != NULL) {
            begin(m);
        }
    }
    return m;
}

static const char *why(uint32_t status)
{
    return @WHY@;
}

/* say why a step fails */
static void say(const instance *m, const char *words)
{
    if (m->log != NULL) {
        m->log(@SAID@, 3, "ERROR", words);
    }
}

/* say what is not used */
static void warn(const instance *m, const char *words)
{
    if ((m->log != NULL) && (m->quiet == 0)) {
        m->log(@SAID@, 1, "WARNING", words);
    }
}

@LEAVE@/* whether something of this category is said */
static void hear(instance *m, int on, size_t n, const char *const categories[])
{
    size_t k;

    if (n == 0U) {
        m->quiet = (on != 0) ? 0 : 1;
    }
    for (k = 0U; k < n; ++k) {
        if (strcmp(categories[k], "WARNING") == 0) {
            m->quiet = (on != 0) ? 0 : 1;
        }
    }
}

/* tell the observer what it is told at the start of a step, and go on to its end; 0, or 3 for an error */
static int step(instance *m, double end)
{
    ~observer *s = &m->observer;
    uint32_t status = ~~OK;
@TELL@
    if (status == ~~OK) {
        const double to = end - m->start;

        if (to < (s->t - (1e-12 * fabs(end)))) {
            warn(m, "the step ends before the time that has been reached: the estimate stays where it is");
        }
        status = ~predict(s, (to < s->t) ? s->t : to);
    }
    if (status != ~~OK) {
        say(m, why(status));
    }
    return (status == ~~OK) ? 0 : 3;
}

static int copied(const instance *m, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(instance));
    }
    if (*state != NULL) {
        (void)memset(*state, 0, sizeof(instance));
        take((instance *)*state, m);
    }
    return (*state != NULL) ? 0 : 3;
}

@ACCESS@
""".replace("WARNING", WARNING).replace("ERROR", ERROR)

LEAVE = """\
/* a sample was left out: the first of them are told */
static void leave_out(instance *m, uint32_t status)
{
    if (m->left < MOSTU) {
        m->left += 1U;
        warn(m, why(status));
        if (m->left == MOSTU) {
            warn(m, "further samples that are left out are not told");
        }
    }
}

""".replace("MOST", str(_MOST))
"""Of a unit with sampled outputs."""
