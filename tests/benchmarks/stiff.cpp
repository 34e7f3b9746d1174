// LSODA on a right-hand side that CasADi has written in C, from sample to sample.
#include <cstddef>
#include <vector>

#include "LSODA.h"

typedef long long int casadi_int;
extern "C" int flow(const double **arg, double **res, casadi_int *iw, double *w, int mem);
extern "C" int sample(const double **arg, double **res, casadi_int *iw, double *w, int mem);

struct Numbers {
  const double *p;
  double *held, *room;
  casadi_int *integers;
};

static void rhs(double t, double *z, double *dz, void *data) {
  Numbers *n = static_cast<Numbers *>(data);
  const double *arg[] = {&t, n->p, z, n->held};
  double *res[] = {dz};
  flow(arg, res, n->integers, n->room, 0);
}

// Rows of z at the times that are marked; a new start wherever a sample comes. 0 where LSODA gives up.
extern "C" int drive(int states, int held, const double *p, double *z, int count, const double *times,
                     const char *sampled, const char *shown, double *rows, double rtol, double atol) {
  std::vector<double> w(held, 0.0), w_new(held), y(z, z + states), out(states + 1), y_new(states), room(100000);
  std::vector<casadi_int> integers(1000);
  Numbers numbers = {p, w.data(), room.data(), integers.data()};
  double t = times[0];
  LSODA *solver = nullptr;
  int state = 1;
  for (int i = 0; i < count; i++) {
    if (i > 0) {
      solver->lsoda_update(rhs, states, y, out, &t, times[i], &state, &numbers, rtol, atol);
      if (state <= 0) return delete solver, 0;
      for (int j = 0; j < states; j++) y[j] = out[j + 1];
    }
    if (i == 0 || sampled[i]) {
      if (sampled[i]) {
        const double *arg[] = {&t, p, y.data(), w.data()};
        double *res[] = {y_new.data(), w_new.data()};
        sample(arg, res, integers.data(), room.data(), 0);
        y = y_new;
        for (int j = 0; j < held; j++) w[j] = w_new[j];
      }
      delete solver;
      solver = new LSODA();
      solver->mxstep = 200000;
      state = 1;
    }
    if (shown[i]) {
      for (int j = 0; j < states; j++) *rows++ = y[j];
    }
  }
  delete solver;
  return 1;
}
