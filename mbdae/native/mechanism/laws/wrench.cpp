// A force and a moment on a frame; signals: their components.
#include <algorithm>

#include "mechanism/laws.hpp"
#include "mechanism/wrench_partials.hpp"
#include "math/vec3.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes&) { return law.paired && law.signals.size() == 6; }

// The wrench of the force, and that of the moment; the pair is located.
static void wrenches(const Law& law, double t, double* w, double* moment) {
  const Pair& pair = *law.pair;
  std::fill(moment, moment + 3, 0.0);
  for (int i = 0; i < 3; ++i) w[i] = law.signals[i].at(t), moment[3 + i] = law.signals[3 + i].at(t);
  if (law.turning) {
    const double a[3] = {w[0], w[1], w[2]}, b[3] = {moment[3], moment[4], moment[5]};
    turn(pair.Rb, a, w), turn(pair.Rb, b, moment + 3);
  }
  cross(pair.pb, w, w + 3);
}

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  double w[6], moment[6];
  Pair& pair = *law.pair;
  pair.locate(p.m);
  wrenches(law, p.t, w, moment);
  pair.torque(p.m, w, 1, law.steady ? f.conservative : f.other);
  if (moment[3] != 0 || moment[4] != 0 || moment[5] != 0) pair.torque(p.m, moment, 1, f.other);
}

static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
  Pair& pair = *law.pair;
  pair.locate(p.m);
  const PairPartials here(p.m, pair, p.v);
  WrenchPartials force, moment;
  wrenches(law, p.t, force.F, moment.F);
  carried(pair.pb, force.F, force.Db);
  if (law.turning) {
    double N[9], M[9], P[9], PN[9];
    skew(force.F, N), skew(moment.F + 3, M), skew(pair.pb, P), product(P, N, PN);
    block(force.Db, 0, 3, N, -1), block(force.Db, 3, 3, PN, -1), block(moment.Db, 3, 3, M, -1);
  }
  out.add(here, force, law.steady), out.add(here, moment, false);
}

static double potential(const Law& law, const ForcePoint& p) {
  if (!law.steady) return 0;
  law.pair->locate(p.m);
  double out = 0;
  for (int i = 0; i < 3; ++i) out -= law.signals[i].at(0) * law.pair->pb[i];
  return out;
}

extern const LawKind wrench{fits, add, partials, potential};

}  // namespace mbdae::laws
