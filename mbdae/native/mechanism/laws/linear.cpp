// Linear laws: [tau of springs; other tau; s'] = C [q; v; s; 1; u(t) and u'(t)], C given by its entries (rows, columns,
// a).
#include <algorithm>

#include "mechanism/laws.hpp"

namespace mbdae::laws {

// The one of consecutive blocks of these sizes that contains index i, which becomes relative to it; -1: none.
static int block_of(const std::vector<int>& sizes, int& i) {
  if (i < 0) return -1;
  for (size_t k = 0; k < sizes.size(); i -= sizes[k++])
    if (i < sizes[k]) return static_cast<int>(k);
  return -1;
}

struct Linear {
  static bool is_valid(Law& law, const Sizes& n) {
    const size_t m = law.a.size();
    if (law.rows.size() != m || law.columns.size() != m || law.orders.size() != law.signals.size()) return false;
    for (int k : law.orders)
      if (k < 0 || k > 2) return false;
    law.u.resize(law.signals.size()), law.terms.clear();
    for (size_t i = 0; i < m; ++i) {
      Law::Term x{0, law.rows[i], 0, law.columns[i], law.a[i]};
      x.to = block_of({n.nv, n.nv, law.states}, x.row);
      x.from = block_of({n.nq, n.nv, law.states, 1, static_cast<int>(law.u.size())}, x.column);
      if (x.to < 0 || x.from < 0) return false;
      law.terms.push_back(x);
    }
    return true;
  }

  static void add(const Law& law, const ForcePoint& p, const Forces& f) {
    static const double one = 1;
    for (size_t i = 0; i < law.u.size(); ++i) law.u[i] = law.signals[i].at(p.t, law.orders[i]);
    const double* in[] = {p.q, p.v, p.s, &one, law.u.data()};
    double* const out[] = {f.conservative, f.other, f.ds};
    std::fill(f.ds, f.ds + law.states, 0.0);
    for (const Law::Term& x : law.terms) out[x.to][x.row] += x.value * in[x.from][x.column];
  }

  static void time_rate(const Law& law, const ForcePoint& p, const Forces& f) {
    for (size_t i = 0; i < law.u.size(); ++i) law.u[i] = law.signals[i].at(p.t, law.orders[i] + 1);
    double* const out[] = {f.conservative, f.other, f.ds};
    std::fill(f.ds, f.ds + law.states, 0.0);
    for (const Law::Term& x : law.terms)
      if (x.from == 4) out[x.to][x.row] += x.value * law.u[x.column];
  }

  static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
    double* const to[] = {out.conservative, out.other, out.ds};
    for (const Law::Term& x : law.terms) {
      if (x.from > 2) continue;  // not a function of q, v, s
      const int column = x.from == 0 ? p.m.tangent[x.column] : x.from == 1 ? p.m.nv + x.column : out.states + x.column;
      to[x.to][x.row * out.width + column] += x.value;
    }
  }

  // Springs tau = -k q + c have the potential k q^2/2 - c q + c^2/(2 k), where the last term is the offset.
  static double potential(const Law& law, const ForcePoint& p) {
    double out = law.offset;
    for (const Law::Term& x : law.terms) {
      if (x.to != 0) continue;
      if (x.from == 0) {
        out -= 0.5 * x.value * p.q[x.column] * p.q[x.column];
        continue;
      }
      const auto& tangent = p.m.tangent;
      const auto iq = std::find(tangent.begin(), tangent.end(), x.row) - tangent.begin();
      out -= x.value * p.q[iq];
    }
    return out;
  }
};

extern const LawKind linear{Linear::is_valid, Linear::add, Linear::partials, Linear::potential, Linear::time_rate};

}  // namespace mbdae::laws
