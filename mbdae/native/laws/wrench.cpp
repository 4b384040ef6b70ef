// A force and a moment on a frame; signals: their components.
#include <algorithm>

#include "../laws.hpp"
#include "../vec3.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes&) { return law.paired && law.signals.size() == 6; }

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  double n[3], w[6], moment[6] = {0, 0, 0, 0, 0, 0};
  Pair& pair = *law.pair;
  pair.locate(p.m);
  for (int i = 0; i < 3; ++i) n[i] = law.signals[i].at(p.t), moment[3 + i] = law.signals[3 + i].at(p.t);
  if (law.turning) {
    const double a[3] = {n[0], n[1], n[2]}, b[3] = {moment[3], moment[4], moment[5]};
    turn(pair.Rb, a, n), turn(pair.Rb, b, moment + 3);
  }
  std::copy(n, n + 3, w);
  cross(pair.pb, n, w + 3);
  pair.torque(p.m, w, 1, law.steady ? f.conservative : f.other);
  if (moment[3] != 0 || moment[4] != 0 || moment[5] != 0) pair.torque(p.m, moment, 1, f.other);
}

extern const LawKind wrench{fits, add};

}  // namespace mbdae::laws
