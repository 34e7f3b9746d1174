/* The benchmark's yardstick: the academic plant with its FHGO II (r = 2, reduced Riccati gain) by RK4.
 *
 * Plain C with libm, written by hand from the equations (Robles Magdaleno 2023, (3.97)-(3.103), (3.133),
 * (3.135)). z holds x (3), xhat (3), eta (2), U (2 x 3) and P (3 x 3), matrices by rows. P' is computed above
 * the diagonal and mirrored: left to itself the antisymmetric rounding part of P grows like exp(theta t).
 */
#include <math.h>
#include <string.h>

enum { STATES = 23 };

typedef struct {
  double theta, a1, omega1, a2, omega2;
} parameters;

static inline __attribute__((always_inline)) void
flow(double t, const double *restrict z, double *restrict dz, const parameters *restrict p) {
  const double *x = z, *xhat = z + 3, *eta = z + 6, *U = z + 8, *P = z + 14;
  double *dx = dz, *dxhat = dz + 3, *deta = dz + 6, *dU = dz + 8, *dP = dz + 14;
  const double theta = p->theta;
  const double f1 = sin(0.5 * t), f2 = sin(2.7 * t), u = 5.0 * sin(0.5 * 3.141592653589793 * t);

  const double coupling = tanh(x[0] * x[1]);
  dx[0] = f1 * x[1] - 0.1 * x[0];
  dx[1] = f2 * x[2] - 0.1 * x[1] + coupling;
  dx[2] = -0.1 * x[2] + coupling + u + 0.1 * sin(0.1 * t);
  const double y = x[0] + p->a1 * sin(p->omega1 * t) + p->a2 * sin(p->omega2 * t);

  /* K_n = P U^T C_r^T, K_r = b + U K_n */
  double K_n[3], K_r[2];
  for (int i = 0; i < 3; i++) K_n[i] = P[3 * i] * U[0] + P[3 * i + 1] * U[1] + P[3 * i + 2] * U[2];
  K_r[0] = 2.0 + (U[0] * K_n[0] + U[1] * K_n[1] + U[2] * K_n[2]);
  K_r[1] = 1.0 + (U[3] * K_n[0] + U[4] * K_n[1] + U[5] * K_n[2]);

  deta[0] = theta * (eta[1] - K_r[0] * eta[0]);
  deta[1] = theta * (xhat[0] - y - K_r[1] * eta[0]);

  const double copied = tanh(xhat[0] * xhat[1]);
  dxhat[0] = f1 * xhat[1] - 0.1 * xhat[0] - theta * K_n[0] * eta[0];
  dxhat[1] = f2 * xhat[2] - 0.1 * xhat[1] + copied - theta * theta * K_n[1] * eta[0];
  dxhat[2] = -0.1 * xhat[2] + copied + u - theta * theta * theta * K_n[2] * eta[0];

  /* U' = theta ((A_r - b C_r) U - U F + B_r C_n) */
  dU[0] = theta * (U[3] - 2.0 * U[0]);
  dU[1] = theta * (U[4] - 2.0 * U[1] - f1 * U[0]);
  dU[2] = theta * (U[5] - 2.0 * U[2] - f2 * U[1]);
  dU[3] = theta * (1.0 - U[0]);
  dU[4] = theta * (-U[1] - f1 * U[3]);
  dU[5] = theta * (-U[2] - f2 * U[4]);

  /* P' = theta (P + F P + P F^T - K_n K_n^T) */
  dP[0] = theta * (P[0] + 2.0 * f1 * P[1] - K_n[0] * K_n[0]);
  dP[1] = theta * (P[1] + (f1 * P[4] + f2 * P[2]) - K_n[0] * K_n[1]);
  dP[2] = theta * (P[2] + f1 * P[5] - K_n[0] * K_n[2]);
  dP[4] = theta * (P[4] + 2.0 * f2 * P[5] - K_n[1] * K_n[1]);
  dP[5] = theta * (P[5] + f2 * P[8] - K_n[1] * K_n[2]);
  dP[8] = theta * (P[8] - K_n[2] * K_n[2]);
  dP[3] = dP[1];
  dP[6] = dP[2];
  dP[7] = dP[5];
}

/* n steps of size h from t0; z in and out; every `every`-th state into rows, and the last one. */
void run(double t0, double h, long n, long every, double *z_io, const parameters *p, double *rows) {
  double z[STATES], k1[STATES], k2[STATES], k3[STATES], k4[STATES], stage[STATES];
  memcpy(z, z_io, sizeof z);
  for (long step = 0; step < n; step++) {
    if (step % every == 0) {
      memcpy(rows, z, sizeof z);
      rows += STATES;
    }
    const double t = t0 + (double)step * h;
    flow(t, z, k1, p);
    for (int i = 0; i < STATES; i++) stage[i] = z[i] + 0.5 * h * k1[i];
    flow(t + 0.5 * h, stage, k2, p);
    for (int i = 0; i < STATES; i++) stage[i] = z[i] + 0.5 * h * k2[i];
    flow(t + 0.5 * h, stage, k3, p);
    for (int i = 0; i < STATES; i++) stage[i] = z[i] + h * k3[i];
    flow(t + h, stage, k4, p);
    for (int i = 0; i < STATES; i++) z[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
  }
  memcpy(rows, z, sizeof z);
  memcpy(z_io, z, sizeof z);
}
