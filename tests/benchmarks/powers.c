/* A chain of three states with homogeneous, or with the linear correction of shgo (POWERS 0): RK4 in plain C, MEMBERS runs
   side by side in loops that a compiler turns into vector instructions and, with -Ofast, into calls of the C library's
   vector functions. It shows how far from a linear correction six powers a stage are by nature. */
#include <math.h>

#ifndef MEMBERS
#define MEMBERS 1
#endif
#ifndef POWERS
#define POWERS 1
#endif
#define N 6

static inline void flow(const double *gains, const double *a, const double *b, double z[N][MEMBERS], double d[N][MEMBERS]) {
#pragma omp simd
    for (int m = 0; m < MEMBERS; m++) {
        double x1 = z[0][m], x2 = z[1][m], x3 = z[2][m], h1 = z[3][m], h2 = z[4][m], h3 = z[5][m], e = h1 - x1;
        double w1 = e, w2 = e, w3 = e;
        if (POWERS) {
            double s = fabs(e), g1 = (pow(s, a[0]) + pow(s, b[0])) / 2, g2 = (pow(g1, a[1]) + pow(g1, b[1])) / 2;
            double g3 = (pow(g2, a[2]) + pow(g2, b[2])) / 2;
            w1 = copysign(g1, e), w2 = copysign(g2, e), w3 = copysign(g3, e);
        }
        d[0][m] = x2, d[1][m] = x3;
        d[2][m] = -x1 - 2 * x2 + (1 - x1 * x1) * x2 / 2 - 2 * x3;
        d[3][m] = h2 - gains[0] * w1, d[4][m] = h3 - gains[1] * w2;
        d[5][m] = -h1 - 2 * h2 + (1 - h1 * h1) * h2 / 2 - 2 * h3 - gains[2] * w3;
    }
}

void run(long steps, double h, const double *gains, const double *a, const double *b, double z[N][MEMBERS]) {
    double k[4][N][MEMBERS], at[N][MEMBERS];
    const double c[4] = {0, h / 2, h / 2, h};
    for (long step = 0; step < steps; step++) {
        flow(gains, a, b, z, k[0]);
        for (int stage = 1; stage < 4; stage++) {
            for (int i = 0; i < N; i++)
                for (int m = 0; m < MEMBERS; m++) at[i][m] = z[i][m] + c[stage] * k[stage - 1][i][m];
            flow(gains, a, b, at, k[stage]);
        }
        for (int i = 0; i < N; i++)
            for (int m = 0; m < MEMBERS; m++)
                z[i][m] += h / 6 * (k[0][i][m] + 2 * (k[1][i][m] + k[2][i][m]) + k[3][i][m]);
    }
}
