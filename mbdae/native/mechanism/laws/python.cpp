// A force law in Python: a function (t, q, v, s) -> (tau, s'), and its partials.
#include "mechanism/laws.hpp"

namespace mbdae::laws {

struct Python {
  static bool is_valid(Law& law, const Sizes&) { return law.call && law.partials && law.time_rate; }

  static void add(const Law& law, const ForcePoint& p, const Forces& f) { law.call(p.t, p.q, p.v, p.s, f.other, f.ds); }

  static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
    const size_t nv = p.m.nv, k = law.states, width = 2 * nv + k;
    Vector A((nv + k) * width);
    law.partials(p.t, p.q, p.v, p.s, A);
    for (size_t i = 0; i < nv + k; ++i) {
      double* row = i < nv ? out.other + i * out.width : out.ds + (i - nv) * out.width;
      for (size_t j = 0; j < width; ++j) row[j < 2 * nv ? j : out.states + j - 2 * nv] += A[i * width + j];
    }
  }

  static void time_rate(const Law& law, const ForcePoint& p, const Forces& f) {
    const size_t nv = p.m.nv, k = law.states;
    Vector rate(nv + k);
    law.time_rate(p.t, p.q, p.v, p.s, rate);
    for (size_t i = 0; i < nv; ++i) f.other[i] += rate[i];
    std::copy(rate.begin() + nv, rate.end(), f.ds);
  }
};

extern const LawKind python{Python::is_valid, Python::add, Python::partials, nullptr, Python::time_rate};

}  // namespace mbdae::laws
