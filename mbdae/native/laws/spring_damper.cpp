// Spring, damper and thrust between two points; a: stiffness, damping, length; signals: the thrust.
#include "../laws.hpp"
#include "../vec3.hpp"

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

extern const LawKind spring_damper{fits, add};

}  // namespace mbdae::laws
