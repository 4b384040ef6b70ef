// An elastic joint between two frames; a: stiffness (6,), damping (6,), largest rotation in rad.
#include <algorithm>
#include <cmath>

#include "mechanism/laws.hpp"
#include "mechanism/manifold.hpp"
#include "mechanism/wrench_partials.hpp"
#include "math/vec3.hpp"

namespace mbdae::laws {

static void turn_back(const double* R, const double* x, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

// Generalised force of a force and a moment in axes of a, at the origin of b.
static void on_b(const Mechanics& m, const Pair& p, const double* force, const double* moment, double* tau) {
  double w[6], arm[3];
  turn(p.Ra, force, w), turn(p.Ra, moment, w + 3);
  cross(p.pb, w, arm);
  for (int i = 0; i < 3; ++i) w[3 + i] += arm[i];
  p.torque(m, w, 1, tau);
}

static void rotation_vector(const double* A, const double* B, double* theta) {  // log(A^T B)
  double R[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) R[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
  theta[0] = 0.5 * (R[7] - R[5]), theta[1] = 0.5 * (R[2] - R[6]), theta[2] = 0.5 * (R[3] - R[1]);
  const double sine = std::sqrt(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]);
  const double angle = std::atan2(sine, 0.5 * (R[0] + R[4] + R[8] - 1));
  if (sine > 0)
    for (int i = 0; i < 3; ++i) theta[i] *= angle / sine;
}

static bool fits(Law& law, const Sizes&) { return law.paired && law.a.size() == 12 + 1; }

// Gap and rotation vector in axes of a; the pair is located.
static void deflection(const Law& law, double* gap, double* theta) {
  const Pair& pair = *law.pair;
  double moved[3];
  for (int i = 0; i < 3; ++i) moved[i] = pair.pb[i] - pair.pa[i];
  turn_back(pair.Ra, moved, gap);
  rotation_vector(pair.Ra, pair.Rb, theta);
  if (!(norm(theta, 3) <= law.a.back())) throw FallBackToPython();
}

static bool damped(const Law& law) {
  return std::any_of(law.a.begin() + 6, law.a.end() - 1, [](double x) { return x != 0; });
}

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  double gap[3], theta[3], moved[3], force[3], moment[3], ad[9];
  Pair& pair = *law.pair;
  const double *k = law.a.data(), *d = k + 6;
  pair.locate(p.m);
  deflection(law, gap, theta);
  skew(theta, ad);
  for (int i = 0; i < 3; ++i) moved[i] = -k[3 + i] * theta[i], force[i] = -k[i] * gap[i];
  inverse_jacobian(p.m.limits, 3, ad, moved, moment);
  on_b(p.m, pair, force, moment, f.conservative);
  if (!damped(law)) return;
  double twist[6], arm[3], velocity[3], spin[3];
  pair.relative(p.m, p.v, twist);
  cross(twist + 3, pair.pb, arm);
  for (int i = 0; i < 3; ++i) arm[i] += twist[i];
  turn_back(pair.Ra, arm, velocity), turn_back(pair.Ra, twist + 3, spin);
  for (int i = 0; i < 3; ++i) force[i] = -d[i] * velocity[i], moment[i] = -d[3 + i] * spin[i];
  on_b(p.m, pair, force, moment, f.other);
}

// R diag(k) R^T.
static void turned(const double* R, const double* k, double* out) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out[3 * i + j] = 0;
      for (int l = 0; l < 3; ++l) out[3 * i + j] += R[3 * i + l] * k[l] * R[3 * j + l];
    }
}

// D += factor S^T A T, where S d = d_lin + d_ang x p is the velocity of p, and T the same.
static void at_point(double* D, const double* A, const double* P, double factor) {
  double AP[9], PA[9], PAP[9];
  product(A, P, AP), product(P, A, PA), product(P, AP, PAP);
  block(D, 0, 0, A, factor), block(D, 0, 3, AP, -factor), block(D, 3, 0, PA, factor), block(D, 3, 3, PAP, -factor);
}

// A motion d of both frames with all velocities changes a wrench by d x* F, which gives Da.
static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
  double gap[3], theta[3], scaled[3], force[3], moment[3], ad[9], P[9], A[9];
  Pair& pair = *law.pair;
  const double *k = law.a.data(), *d = k + 6;
  pair.locate(p.m);
  const PairPartials here(p.m, pair, p.v);
  deflection(law, gap, theta);
  skew(theta, ad), skew(pair.pb, P);
  for (int i = 0; i < 3; ++i) scaled[i] = k[3 + i] * theta[i], force[i] = -k[i] * gap[i];
  inverse_jacobian(p.m.limits, 3, ad, scaled, moment);
  double by_theta[9], left[9], back[9];  // partials of J_r^-1 K theta, and theta' = left omega in axes of a
  for (int j = 0; j < 3; ++j) {
    double e[3] = {0, 0, 0}, dad[9], rate[3], column[3], minus[9];
    e[j] = 1;
    skew(e, dad);
    inverse_jacobian_rate(p.m.limits, 3, ad, dad, scaled, rate);
    for (int i = 0; i < 9; ++i) minus[i] = -ad[i];
    inverse_jacobian(p.m.limits, 3, minus, e, column);
    for (int i = 0; i < 3; ++i) left[3 * i + j] = column[i], by_theta[3 * i + j] = rate[i];
    e[j] = k[3 + j];
    inverse_jacobian(p.m.limits, 3, ad, e, column);
    for (int i = 0; i < 3; ++i) by_theta[3 * i + j] += column[i];
  }
  WrenchPartials spring, damper;
  turn(pair.Ra, force, spring.F), turn(pair.Ra, moment, spring.F + 3);
  double arm[3];
  cross(pair.pb, spring.F, arm);
  for (int i = 0; i < 3; ++i) spring.F[3 + i] = arm[i] - spring.F[3 + i];
  carried(pair.pb, spring.F, spring.Db);
  turned(pair.Ra, k, A), at_point(spring.Db, A, P, -1);
  double both[9], RT[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) RT[3 * i + j] = pair.Ra[3 * j + i];
  product(by_theta, left, both), product(both, RT, back), product(pair.Ra, back, both);
  block(spring.Db, 3, 3, both, -1);
  matrix_of_wrench(spring.F, spring.Da);
  for (int i = 0; i < 36; ++i) spring.Da[i] -= spring.Db[i];
  out.add(here, spring, true);
  if (!damped(law)) return;
  double spin[9], u[3], velocity[3], W[9], AW[9], more[6];
  const double* w = here.V + 3;
  turned(pair.Ra, d, A), turned(pair.Ra, d + 3, spin);
  cross(w, pair.pb, velocity);
  for (int i = 0; i < 3; ++i) velocity[i] += here.V[i];
  turn(A, velocity, u);
  for (int i = 0; i < 3; ++i) damper.F[i] = -u[i];
  cross(pair.pb, damper.F, damper.F + 3);
  for (int i = 0; i < 3; ++i) damper.F[3 + i] -= dot(spin + 3 * i, w, 3);
  skew(w, W), product(A, W, AW);
  carried(pair.pb, damper.F, damper.Db), at_point(damper.Db, AW, P, -1);
  damper.damp(), at_point(damper.C, A, P, -1), block(damper.C, 3, 3, spin, -1);
  matrix_of_wrench(damper.F, damper.Da);
  for (int j = 0; j < 6; ++j) {
    double e[6] = {0, 0, 0, 0, 0, 0}, column[6];
    e[j] = 1;
    motion_cross(here.V, e, column), times6(damper.C, column, more);
    for (int i = 0; i < 6; ++i) damper.Da[6 * i + j] += more[i] - damper.Db[6 * i + j];
  }
  out.add(here, damper, false);
}

static double potential(const Law& law, const ForcePoint& p) {
  double moved[6], out = 0;
  law.pair->locate(p.m);
  deflection(law, moved, moved + 3);
  for (int i = 0; i < 6; ++i) out += 0.5 * law.a[i] * moved[i] * moved[i];
  return out;
}

extern const LawKind bushing{fits, add, partials, potential};

}  // namespace mbdae::laws
