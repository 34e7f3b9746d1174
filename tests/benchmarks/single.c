/* Single runs in plain C, beside which hgorun's are measured: written by hand from the equations, as one would.
 *
 * Each case is a right-hand side; RK4 around it is the same for all. z holds the plant's states, then each observer's.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

/* Chain of 8 integrators, x8' = sin(t) - x1, and a standard high-gain observer with poles at -1: binomial gains. */
enum { CHAIN = 8 };
INLINE void chain_flow(double t, const double *restrict z, double *restrict dz, const double *p) {
  static const double G[CHAIN] = {8, 28, 56, 70, 56, 28, 8, 1};
  const double *x = z, *xhat = z + CHAIN;
  const double theta = p[0], u = sin(t), e = xhat[0] - x[0];
  double power = theta;
  for (int i = 0; i < CHAIN; i++) {
    const double f = i + 1 < CHAIN ? x[i + 1] : u - x[0];
    const double copied = i + 1 < CHAIN ? xhat[i + 1] : u - xhat[0];
    dz[i] = f;
    dz[CHAIN + i] = copied - power * G[i] * e;
    power *= theta;
  }
}

/* Contois bioreactor with the standard observer and FHGO II of order 1, 2, 3, measured continuously with noise. */
INLINE void contois_copy(const double *x, double D, const double *p, double *f, double *g1, double *g2) {
  const double mu = p[0], k_c = p[1], s_in = p[2], sum = k_c * x[0] + x[1], g = mu * x[0] * x[1] / sum;
  f[0] = g - D * x[0];
  f[1] = D * (s_in - x[1]) - g;
  *g1 = mu * x[1] * x[1] / (sum * sum); /* the slopes of g: J = (1 0; g1 g2) in canonical coordinates */
  *g2 = mu * k_c * x[0] * x[0] / (sum * sum);
}
INLINE void contois_correct(double *dx, double k1, double k2, double g1, double g2) {
  dx[0] -= k1;
  dx[1] -= (k2 - g1 * k1) / g2;
}
INLINE void contois_flow(double t, const double *restrict z, double *restrict dz, const double *p) {
  double g1, g2;
  const double D = p[0] * (0.75 + sin(t) / 4);
  contois_copy(z, D, p, dz, &g1, &g2);
  const double y = z[0] + p[3] * sin(p[4] * t) + p[3] * sin(p[5] * t);
  { /* SHGO, theta = 1: gains 2, 1 */
    const double theta = p[6], e = z[2] - y;
    contois_copy(z + 2, D, p, dz + 2, &g1, &g2);
    contois_correct(dz + 2, theta * 2 * e, theta * theta * e, g1, g2);
  }
  { /* r = 1: binomial gains of order 3 */
    const double theta = p[7], *eta = z + 4, e = z[5] - y;
    dz[4] = theta * (e - 3 * eta[0]);
    contois_copy(z + 5, D, p, dz + 5, &g1, &g2);
    contois_correct(dz + 5, theta * 3 * eta[0], theta * theta * eta[0], g1, g2);
  }
  { /* r = 2 */
    const double theta = p[7], *eta = z + 7, e = z[9] - y;
    dz[7] = theta * (eta[1] - 4 * eta[0]);
    dz[8] = theta * (e - 6 * eta[0]);
    contois_copy(z + 9, D, p, dz + 9, &g1, &g2);
    contois_correct(dz + 9, theta * 4 * eta[0], theta * theta * eta[0], g1, g2);
  }
  { /* r = 3 */
    const double theta = p[7], *eta = z + 11, e = z[14] - y;
    dz[11] = theta * (eta[1] - 5 * eta[0]);
    dz[12] = theta * (eta[2] - 10 * eta[0]);
    dz[13] = theta * (e - 10 * eta[0]);
    contois_copy(z + 14, D, p, dz + 14, &g1, &g2);
    contois_correct(dz + 14, theta * 5 * eta[0], theta * theta * eta[0], g1, g2);
  }
}

/* Van der Pol oscillator with a standard high-gain observer. */
INLINE void van_der_pol_flow(double t, const double *restrict z, double *restrict dz, const double *p) {
  const double mu = p[0], theta = p[1], e = z[2] - z[0];
  (void)t;
  dz[0] = z[1];
  dz[1] = -z[0] + mu * (1 - z[0] * z[0]) * z[1];
  dz[2] = z[3] - theta * 2 * e;
  dz[3] = -z[2] + mu * (1 - z[2] * z[2]) * z[3] - theta * theta * e;
}

#define RUN(name, n)                                                                                        \
  void name(double h, long steps, long every, const double *z0, const double *p, double *rows) {            \
    double z[n], k1[n], k2[n], k3[n], k4[n], s[n];                                                          \
    memcpy(z, z0, sizeof z);                                                                                \
    for (long step = 0; step < steps; step++) {                                                             \
      if (step % every == 0) {                                                                              \
        memcpy(rows, z, sizeof z);                                                                          \
        rows += n;                                                                                          \
      }                                                                                                     \
      const double t = (double)step * h;                                                                    \
      name##_flow(t, z, k1, p);                                                                             \
      for (int i = 0; i < n; i++) s[i] = z[i] + 0.5 * h * k1[i];                                            \
      name##_flow(t + 0.5 * h, s, k2, p);                                                                   \
      for (int i = 0; i < n; i++) s[i] = z[i] + 0.5 * h * k2[i];                                            \
      name##_flow(t + 0.5 * h, s, k3, p);                                                                   \
      for (int i = 0; i < n; i++) s[i] = z[i] + h * k3[i];                                                  \
      name##_flow(t + h, s, k4, p);                                                                         \
      for (int i = 0; i < n; i++) z[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);            \
    }                                                                                                       \
    memcpy(rows, z, sizeof z);                                                                              \
  }

RUN(chain, 2 * CHAIN)
RUN(contois, 16)
RUN(van_der_pol, 4)

/* The same oscillator, y known a time d later (continuously): z = x, xhat, alpha, and what the observer compares is
 * xhat1(t-d) - y(t-d) + alpha(t) - alpha(t-d). The past is kept as cubic Hermite pieces, one a step. */
enum { LATE = 5, RING = 1 << 12 };
typedef struct {
  double y, s, dy, ds;
} knot;

INLINE void late_flow(const double *restrict z, double y, double s, double *restrict dz, const double *p) {
  const double mu = p[0], theta = p[1], e = s - y + z[4];
  dz[0] = z[1];
  dz[1] = -z[0] + mu * (1 - z[0] * z[0]) * z[1];
  dz[2] = z[3] - theta * 2 * e;
  dz[3] = -z[2] + mu * (1 - z[2] * z[2]) * z[3] - theta * theta * e;
  dz[4] = -theta * 2 * e;
}

INLINE void past(const knot *ring, double t, double h, const double *first, double *y, double *s) {
  if (t <= 0) {
    *y = first[0];
    *s = first[1];
    return;
  }
  const double place = t / h;
  const long i = (long)place;
  const double T = place - (double)i, R = 1 - T;
  const knot *a = ring + (i & (RING - 1)), *b = ring + ((i + 1) & (RING - 1));
  *y = R * a->y + T * b->y - T * R * ((R - T) * (b->y - a->y) - R * h * a->dy + T * h * b->dy);
  *s = R * a->s + T * b->s - T * R * ((R - T) * (b->s - a->s) - R * h * a->ds + T * h * b->ds);
}

void late(double h, long steps, long every, const double *z0, const double *p, double *rows) {
  enum { n = LATE };
  double z[n], k1[n], k2[n], k3[n], k4[n], q[n], y, s;
  const double d = p[2], first[2] = {z0[0], z0[2] - z0[4]};
  knot *ring = malloc(RING * sizeof *ring);
  memcpy(z, z0, sizeof z);
  for (long step = 0; step < steps; step++) {
    if (step % every == 0) {
      memcpy(rows, z, sizeof z);
      rows += n;
    }
    const double t = (double)step * h;
    past(ring, t - d, h, first, &y, &s);
    late_flow(z, y, s, k1, p);
    ring[step & (RING - 1)] = (knot){z[0], z[2] - z[4], k1[0], k1[2] - k1[4]};
    past(ring, t + 0.5 * h - d, h, first, &y, &s);
    for (int i = 0; i < n; i++) q[i] = z[i] + 0.5 * h * k1[i];
    late_flow(q, y, s, k2, p);
    for (int i = 0; i < n; i++) q[i] = z[i] + 0.5 * h * k2[i];
    late_flow(q, y, s, k3, p);
    past(ring, t + h - d, h, first, &y, &s);
    for (int i = 0; i < n; i++) q[i] = z[i] + h * k3[i];
    late_flow(q, y, s, k4, p);
    for (int i = 0; i < n; i++) z[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
  }
  memcpy(rows, z, sizeof z);
  free(ring);
}
