// An elastic joint between two frames; a: stiffness (6,), damping (6,), largest turn in rad.
#include <algorithm>
#include <cmath>

#include "../laws.hpp"
#include "../manifold.hpp"
#include "../vec3.hpp"

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

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  double gap[3], theta[3], moved[3], force[3], moment[3];
  Pair& pair = *law.pair;
  const double *k = law.a.data(), *d = k + 6, largest = law.a.back();
  pair.locate(p.m);
  for (int i = 0; i < 3; ++i) moved[i] = pair.pb[i] - pair.pa[i];
  turn_back(pair.Ra, moved, gap);
  rotation_vector(pair.Ra, pair.Rb, theta);
  if (!(norm(theta, 3) <= largest)) throw Trouble();
  const double ad[9] = {0, -theta[2], theta[1], theta[2], 0, -theta[0], -theta[1], theta[0], 0};
  for (int i = 0; i < 3; ++i) moved[i] = -k[3 + i] * theta[i], force[i] = -k[i] * gap[i];
  inverse_jacobian(p.m.limits, 3, ad, moved, moment);
  on_b(p.m, pair, force, moment, f.conservative);
  if (!std::any_of(d, d + 6, [](double x) { return x != 0; })) return;
  double twist[6], arm[3], velocity[3], spin[3];
  pair.relative(p.m, p.v, twist);
  cross(twist + 3, pair.pb, arm);
  for (int i = 0; i < 3; ++i) arm[i] += twist[i];
  turn_back(pair.Ra, arm, velocity), turn_back(pair.Ra, twist + 3, spin);
  for (int i = 0; i < 3; ++i) force[i] = -d[i] * velocity[i], moment[i] = -d[3 + i] * spin[i];
  on_b(p.m, pair, force, moment, f.other);
}

extern const LawKind bushing{fits, add};

}  // namespace mbdae::laws
