// tau = -d tanh(v / v0), or -d where v0 = 0 (dry friction in a mode); a: d (nv,), v0.
#include <cmath>

#include "mechanism/laws.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes& n) { return law.a.size() == n.nv + 1u; }

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  const int nv = p.m.nv;
  for (int i = 0; i < nv; ++i)
    if (law.a[i] != 0) f.other[i] -= law.a[nv] == 0 ? law.a[i] : law.a[i] * std::tanh(p.v[i] / law.a[nv]);
}

static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
  const int nv = p.m.nv;
  for (int i = 0; i < nv && law.a[nv] != 0; ++i) {
    const double x = std::tanh(p.v[i] / law.a[nv]);
    out.other[i * out.width + nv + i] += law.a[i] / law.a[nv] * (x * x - 1);
  }
}

extern const LawKind friction{fits, add, partials};

}  // namespace mbdae::laws
