// Force laws of single joint coordinates: a formula of (q, v), differentiated by dual numbers.
#pragma once

#include <type_traits>
#include <utility>

#include "math/dual.hpp"
#include "mechanism/laws.hpp"

namespace mbdae {

template <class S>
struct Effort {  // effort of springs, and of everything else
  S conservative, other;
};

template <class S>
Effort<S> effort_of(const Effort<S>& tau) {
  return tau;
}

template <class S>
Effort<S> effort_of(const S& tau) {
  return {0, tau};
}

// F::effort(law, k, q, v) returns the Effort at velocity law.rows[k], or a scalar for a law without a potential; q is
// the coordinate law.columns[k] (0 without columns). F::is_valid checks the data; F::potential(law, point) is in J.
template <class F>
struct JointLaw {
  static constexpr bool conservative =
      !std::is_same_v<decltype(F::effort(std::declval<const Law&>(), size_t(), double(), double())), double>;

  static double coordinate(const Law& law, const ForcePoint& p, size_t k) {
    return law.columns.empty() ? 0 : p.q[law.columns[k]];
  }

  static void add(const Law& law, const ForcePoint& p, const Forces& f) {
    for (size_t k = 0; k < law.rows.size(); ++k) {
      const int i = law.rows[k];
      const Effort<double> tau = effort_of(F::effort(law, k, coordinate(law, p, k), p.v[i]));
      f.conservative[i] += tau.conservative, f.other[i] += tau.other;
    }
  }

  static void partials(const Law& law, const ForcePoint& p, const LawPartials& out) {
    for (size_t k = 0; k < law.rows.size(); ++k) {
      const int i = law.rows[k];
      Dual<2> q(coordinate(law, p, k)), v(p.v[i]);
      q.d[0] = 1, v.d[1] = 1;
      const Effort<Dual<2>> tau = effort_of(F::effort(law, k, q, v));
      double *conservative = out.conservative + i * out.width, *other = out.other + i * out.width;
      if (!law.columns.empty()) {
        const int column = p.m.tangent[law.columns[k]];
        conservative[column] += tau.conservative.d[0], other[column] += tau.other.d[0];
      }
      conservative[p.m.nv + i] += tau.conservative.d[1], other[p.m.nv + i] += tau.other.d[1];
    }
  }
};

template <class F>
constexpr LawKind joint_law() {
  if constexpr (JointLaw<F>::conservative)
    return {F::is_valid, JointLaw<F>::add, JointLaw<F>::partials, F::potential};
  else
    return {F::is_valid, JointLaw<F>::add, JointLaw<F>::partials};
}

}  // namespace mbdae
