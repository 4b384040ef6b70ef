// Spring, damper and thrust between two points; a: stiffness, damping, length; signals: the thrust.
#include "mechanism/laws.hpp"
#include "mechanism/wrench_partials.hpp"
#include "math/vec3.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes&) { return law.paired && law.a.size() == 3 && law.signals.size() == 1; }

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  double w[6], twist[6];
  Pair& pair = *law.pair;
  pair.locate(p.m);
  const double d = unit_gap(pair, w);
  cross(pair.pb, w, w + 3);
  double push = law.signals[0].at(p.t);
  if (law.a[1] != 0) {
    pair.relative(p.m, p.v, twist);
    double rate = 0;
    for (int i = 0; i < 6; ++i) rate += w[i] * twist[i];
    push -= law.a[1] * rate;
  }
  pair.torque(p.m, w, -law.a[0] * (d - law.a[2]), f.conservative);
  if (push != 0) pair.torque(p.m, w, push, f.other);
}

static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
  Pair& pair = *law.pair;
  pair.locate(p.m);
  const PairPartials here(p.m, pair, p.v);
  const double k = law.a[0], c = law.a[1];
  double w[6], VDa[6] = {0, 0, 0, 0, 0, 0}, VDb[6] = {0, 0, 0, 0, 0, 0};
  const double d = unit_gap(pair, w), pull = k * (d - law.a[2]);
  cross(pair.pb, w, w + 3);
  const double push = law.signals[0].at(p.t) - c * dot(w, here.V, 6);
  WrenchPartials spring;
  distance_partials(pair, -pull, spring);
  for (int i = 0; i < 6; ++i) {
    spring.F[i] = -pull * w[i];
    for (int j = 0; j < 6; ++j) spring.Da[6 * i + j] += k * w[i] * w[j], spring.Db[6 * i + j] -= k * w[i] * w[j];
  }
  out.add(here, spring, true);
  if (push == 0 && c == 0) return;
  WrenchPartials damper, line;
  distance_partials(pair, push, damper), distance_partials(pair, 1, line);
  damper.damp();
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) VDa[j] += here.V[i] * line.Da[6 * i + j], VDb[j] += here.V[i] * line.Db[6 * i + j];
  for (int i = 0; i < 6; ++i) {
    damper.F[i] = push * w[i];
    for (int j = 0; j < 6; ++j) {
      const int at = 6 * i + j;
      damper.Da[at] -= c * w[i] * VDa[j], damper.Db[at] -= c * w[i] * VDb[j], damper.C[at] = -c * w[i] * w[j];
    }
  }
  out.add(here, damper, false);
}

static double potential(const Law& law, const ForcePoint& p) {
  double n[3];
  law.pair->locate(p.m);
  const double stretch = unit_gap(*law.pair, n) - law.a[2];
  return 0.5 * law.a[0] * stretch * stretch;
}

extern const LawKind spring_damper{fits, add, partials, potential};

}  // namespace mbdae::laws
