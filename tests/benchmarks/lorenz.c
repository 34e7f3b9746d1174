/* The Lorenz system by the classical Runge-Kutta method, 32 members at a time: four interleaved vectors of eight. */
typedef double vec __attribute__((vector_size(64), aligned(8)));
#define EACH for (int i = 0; i < 4; i++)
void run(long members, long steps, double h, const double *z0, double *z1, double sigma, double rho, double beta) {
  for (long m = 0; m < members; m += 32) {
    vec x[4], y[4], z[4];
    EACH { x[i] = *(const vec *)(z0 + m + 8 * i); y[i] = *(const vec *)(z0 + members + m + 8 * i); z[i] = *(const vec *)(z0 + 2 * members + m + 8 * i); }
    for (long s = 0; s < steps; s++) {
      vec ax[4], ay[4], az[4], sx[4], sy[4], sz[4], kx[4], ky[4], kz[4];
      EACH { kx[i] = sigma * (y[i] - x[i]); ky[i] = x[i] * (rho - z[i]) - y[i]; kz[i] = x[i] * y[i] - beta * z[i]; }
      EACH { ax[i] = kx[i]; ay[i] = ky[i]; az[i] = kz[i]; }
      for (int stage = 1; stage < 4; stage++) {
        const double a = stage == 3 ? h : 0.5 * h, b = stage == 3 ? 1.0 : 2.0;
        EACH { sx[i] = x[i] + a * kx[i]; sy[i] = y[i] + a * ky[i]; sz[i] = z[i] + a * kz[i]; }
        EACH { kx[i] = sigma * (sy[i] - sx[i]); ky[i] = sx[i] * (rho - sz[i]) - sy[i]; kz[i] = sx[i] * sy[i] - beta * sz[i]; }
        EACH { ax[i] += b * kx[i]; ay[i] += b * ky[i]; az[i] += b * kz[i]; }
      }
      const double c = h / 6.0;
      EACH { x[i] += c * ax[i]; y[i] += c * ay[i]; z[i] += c * az[i]; }
    }
    EACH { *(vec *)(z1 + m + 8 * i) = x[i]; *(vec *)(z1 + members + m + 8 * i) = y[i]; *(vec *)(z1 + 2 * members + m + 8 * i) = z[i]; }
  }
}
