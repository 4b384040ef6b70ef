// tau = -c(q - rest) - d v; signals: c and its integral, rows: of v, columns: of q, a: rest, d.
#include "mechanism/laws.hpp"

namespace mbdae::laws {

static bool fits(Law& law, const Sizes& n) {
  bool out = law.a.size() == 2 && law.signals.size() == 2 && law.rows.size() == law.columns.size();
  for (int i : law.rows) out = out && i >= 0 && i < n.nv;
  for (int i : law.columns) out = out && i >= 0 && i < n.nq;
  return out;
}

static void add(const Law& law, const ForcePoint& p, const Forces& f) {
  for (size_t i = 0; i < law.rows.size(); ++i) {
    const int k = law.rows[i];
    f.conservative[k] -= law.signals[0].at(p.q[law.columns[i]] - law.a[0]);
    f.other[k] -= law.a[1] * p.v[k];
  }
}

static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
  for (size_t i = 0; i < law.rows.size(); ++i) {
    const int k = law.rows[i], from = law.columns[i];
    out.conservative[k * out.width + p.m.tangent[from]] -= law.signals[0].at(p.q[from] - law.a[0], 1);
    out.other[k * out.width + p.m.nv + k] -= law.a[1];
  }
}

static double potential(const Law& law, const ForcePoint& p) {
  double out = 0;
  for (int i : law.columns) out += law.signals[1].at(p.q[i] - law.a[0]) - law.signals[1].at(0);
  return out;
}

extern const LawKind curve{fits, add, partials, potential};

}  // namespace mbdae::laws
