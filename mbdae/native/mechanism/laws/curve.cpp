// Spring with a characteristic curve: tau = -c(q - rest) - d v; signals: c and its integral; rows, columns: indices in
// v and q; a: rest, d.
#include "mechanism/joint_law.hpp"

namespace mbdae::laws {

struct Curve {
  static bool is_valid(Law& law, const Sizes& n) {
    bool out = law.a.size() == 2 && law.signals.size() == 2 && law.rows.size() == law.columns.size();
    for (int i : law.rows) out = out && i >= 0 && i < n.nv;
    for (int i : law.columns) out = out && i >= 0 && i < n.nq;
    return out;
  }

  template <class S>
  static Effort<S> effort(const Law& law, size_t, const S& q, const S& v) {
    return {-law.signals[0].at(q - law.a[0]), -law.a[1] * v};
  }

  static double potential(const Law& law, const ForcePoint& p) {
    double out = 0;
    for (int i : law.columns) out += law.signals[1].at(p.q[i] - law.a[0]) - law.signals[1].at(0.0);
    return out;
  }
};

extern const LawKind curve = joint_law<Curve>();

}  // namespace mbdae::laws
