// A spring with the restoring torque c(q - rest), c a signal, and a damper; rows: of v, columns: of q, a: rest, damping.
#include "../laws.hpp"

namespace mbdae::laws {

namespace {

bool fits(Law& law, const Sizes& n) {
  auto within = [](const std::vector<int>& x, int size) {
    for (int i : x)
      if (i < 0 || i >= size) return false;
    return true;
  };
  return law.a.size() == 2 && law.signals.size() == 1 && law.rows.size() == law.columns.size() &&
         within(law.rows, n.nv) && within(law.columns, n.nq);
}

void add(const Law& law, const Point& p, const Forces& f) {
  for (size_t i = 0; i < law.rows.size(); ++i) {
    const int k = law.rows[i];
    f.conservative[k] -= law.signals[0].at(p.q[law.columns[i]] - law.a[0]);
    f.other[k] -= law.a[1] * p.v[k];
  }
}

}  // namespace

extern const LawKind curve{fits, add};

}  // namespace mbdae::laws
