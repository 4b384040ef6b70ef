// Joint friction: tau = -d tanh(v / v0), or -d if v0 = 0 (Coulomb friction of a slipping joint); a: d (nv,), v0.
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
    const double d = law.a[k], v0 = law.a.back();
    if (d == 0 || v0 == 0) return -d;
    return -d * tanh(v / v0);
  }
};

extern const LawKind friction = joint_law<Friction>();

}  // namespace mbdae::laws
