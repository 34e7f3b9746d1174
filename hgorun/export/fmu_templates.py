"""What is around an observer in a unit of FMI, in C: its state, its steps and its values.

Names between @ are filled in; ~ stands for the prefix of the observer's functions.
"""

from __future__ import annotations

from typing import Literal

Version = Literal["2.0", "3.0"]
VERSIONS: tuple[Version, ...] = ("2.0", "3.0")

TOP = """\
/* The functions of FMI around an observer; the observer itself allocates nothing. */
#include "@HEADER@"

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
    logger log; /* of the simulator, with the two below: no part of the state */
    void *environment;
    char name[64];
    ~observer observer;
    double start;
    double y[@Q@];
    double age[@Q@];
    double u[@M@];
    int fresh[@Q@];
} instance;

/* take the state of another instance */
static void take(instance *m, const instance *other)
{
    const logger log = m->log;
    void *const environment = m->environment;
    char name[sizeof(m->name)];

    (void)memcpy(name, m->name, sizeof(name));
    (void)memcpy(m, other, sizeof(*m));
    m->log = log;
    m->environment = environment;
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

/* say why a step fails */
static void say(const instance *m, uint32_t status)
{
    if (m->log != NULL) {
        m->log(@SAID@, 3, "logStatusError", @WHY@);
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

        status = ~predict(s, (to < s->t) ? s->t : to);
    }
    if (status != ~~OK) {
        say(m, status);
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
"""
