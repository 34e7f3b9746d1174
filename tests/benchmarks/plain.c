/* A member of an ensemble in plain C: the classical Runge-Kutta method between events, and what happens at events.
 *
 * The right-hand side and the channels are C that CasADi writes from the same equations, with libm. Everything is
 * inlined into one loop and compiled by -O3 -march=native: what a careful programmer has for one run after the other.
 */
#include <math.h>
#include <string.h>
#define casadi_real double
#define casadi_int long
#include "functions.h"

enum { TAKE, ARRIVE, RECORD, SET, REBASE };

static inline void flow(double t, const double *p, const double *z, const double *w, double *dz) {
  const double *arguments[] = {&t, p, z, w};
  double *results[] = {dz};
  FLOW(arguments, results, 0, 0, 0);
}

static void channels(double t, const double *p, const double *z, const double *w, double *c) {
  const double *arguments[] = {&t, p, z, w};
  double *results[] = {c};
  CHANNELS(arguments, results, 0, 0, 0);
}

void run(long segments, const double *spans, const long *counts, const long *actions, const double *gain,
         const double *bias, const double *holds, const long *alpha, const double *p, const double *grid,
         const double *z0, double *slots, double *rows, double *last) {
  double z[STATES], w[HELD], k1[STATES], k2[STATES], k3[STATES], k4[STATES], stage[STATES], c[OUTPUTS * WIDTH + 1];
  memcpy(z, z0, sizeof z);
  memset(w, 0, sizeof w);
  for (long s = 0; s < segments; s++) {
    const double *span = spans + 4 * s;
    const long *n = counts + 7 * s;
    for (long a = n[4]; a < n[5]; a++) {
      const long *what = actions + 5 * a, output = what[1], slot = what[2];
      double *held = w + output * (WIDTH + 2), *here = slots + slot * WIDTH;
      switch (what[0]) {
        case SET: w[output] = holds[slot]; break;
        case TAKE:
          channels(span[2], p, z, w, c);
          memcpy(here, c + output * WIDTH, WIDTH * sizeof *here);
          break;
        case ARRIVE:
          held[1] = held[2];
          held[2] = gain[slot] * here[0] + bias[slot];
          memcpy(held + 3, here + 1, (WIDTH - 1) * sizeof *here);
          break;
        case REBASE:
          for (long j = 0; j < WIDTH - 1; j++) {
            double *own = z + alpha[output * (WIDTH - 1) + j];
            held[3 + j] += *own;
            for (long i = what[3]; i < what[4]; i++) slots[i * WIDTH + 1 + j] += *own;
            *own = 0;
          }
      }
    }
    const double h = (span[1] - span[0]) / (double)n[0];
    for (long step = n[1]; step < n[2]; step++) {
      const double t = span[0] + (double)step * h;
      flow(step ? t : span[2], p, z, w, k1);
      while (*grid < t + 0.5 * h) {
        memcpy(rows, z, sizeof z);
        rows += STATES;
        grid++;
      }
      for (int i = 0; i < STATES; i++) stage[i] = z[i] + 0.5 * h * k1[i];
      flow(t + 0.5 * h, p, stage, w, k2);
      for (int i = 0; i < STATES; i++) stage[i] = z[i] + 0.5 * h * k2[i];
      flow(t + 0.5 * h, p, stage, w, k3);
      for (int i = 0; i < STATES; i++) stage[i] = z[i] + h * k3[i];
      flow(step + 1 == n[0] ? span[3] : t + h, p, stage, w, k4);
      for (int i = 0; i < STATES; i++) z[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    }
  }
  memcpy(last, z, sizeof z);
}
