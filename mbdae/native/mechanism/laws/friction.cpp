// tau = -d tanh(v / v0), or -d where v0 = 0 (dry friction in a mode); a: d (nv,), v0.
#include <numeric>

#include "mechanism/joint_law.hpp"

namespace mbdae::laws {

struct Friction {
  static bool is_valid(Law& law, const Sizes& n) {
    law.rows.resize(n.nv), std::iota(law.rows.begin(), law.rows.end(), 0);
    return law.a.size() == n.nv + 1u;
  }

  template <class S>
  static S effort(const Law& law, size_t k, const S&, const S& v) {
    const double d = law.a[k], width = law.a.back();
    if (d == 0 || width == 0) return -d;
    return -d * tanh(v / width);
  }
};

extern const LawKind friction = joint_law<Friction>();

}  // namespace mbdae::laws
