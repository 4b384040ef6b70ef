// Null spaces by sparse rows: independent rows by sparse elimination, others by conjugate gradients.
#include "system/rank_loss.hpp"

#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// Uses the independent rows of a configuration instead of the rows in use, for its lifetime.
class IndependentRowsOf {
 public:
  IndependentRowsOf(Index2System& s, const double* q, int rank, double limit)
      : s_(s), rows_(s.rows.in_use()), rank_(s.rows.rank), floor_(s.rows.floor), frozen_(s.rows.frozen) {
    s.point.evaluate(q, false);
    const std::vector<int> independent = s.rows.independent(s.point.Z, rank, limit);
    s.rows.use(independent, static_cast<int>(independent.size()), 0, true);
    if (s.saddle.factorize_symmetric(s.tree.tolerances.smallest_pivot)) return;
    restore();
    throw FallBackToPython();
  }
  ~IndependentRowsOf() { restore(); }
  IndependentRowsOf(const IndependentRowsOf&) = delete;

 private:
  void restore() { s_.rows.use(rows_, rank_, floor_, frozen_); }

  Index2System& s_;
  const std::vector<int> rows_;
  const int rank_;
  const double floor_;
  const bool frozen_;
};

}  // namespace

void admissible_velocities(Index2System& s, const double* q, std::vector<Vector>& vectors) {
  s.point.evaluate(q, false);
  if (!s.saddle.factorize_symmetric(s.tree.tolerances.smallest_pivot)) throw FallBackToPython();
  for (Vector& w : vectors) {
    for (int repeat = 0; repeat < 2; ++repeat) s.saddle.project_onto_null_space(w);  // the second removes rounding
    s.point.solve_root_transposed(w.data());
  }
}

int vanishing_combinations(Index2System& s, const double* q, int rank, double limit, std::vector<Vector>& vectors) {
  const IndependentRowsOf rows(s, q, rank, limit);
  Vector force(s.nv), rhs(s.ng), x(s.nv), lam(s.ng, 0.0), all(s.ng);
  for (Vector& w : vectors) {  // w - lam of smallest norm with G^T lam = G^T w
    std::fill(force.begin(), force.end(), 0.0);
    for (int k : s.constraints.all) s.constraints.add(k, s.point.Z, w[k], force.data());
    for (int k : s.rows.in_use()) rhs[k] = s.constraints.times(k, s.point.Z, force.data());
    s.saddle.minimum_norm_correction(rhs.data(), x.data(), lam.data());
    s.saddle.all_multipliers(lam.data(), all.data());
    for (int k = 0; k < s.ng; ++k) w[k] -= all[k];
  }
  return static_cast<int>(s.rows.in_use().size());
}

double residual_of_dependent_rows(Index2System& s, double t, const double* q, double limit, int steps) {
  Vector from(q, q + s.nq), to(s.nq), g(s.ng), x(s.nv);
  const auto residual = [&] { g = s.point.g, s.constraints.complete_g(t, g.data()); };
  for (int i = 0; i < steps; ++i) {
    const IndependentRowsOf rows(s, from.data(), s.ng, limit);
    residual();
    s.saddle.minimum_norm_correction(g.data(), x.data());
    for (double& c : x) c = -c;
    s.manifold.integrate(from.data(), x.data(), to.data());
    from.swap(to);
  }
  s.point.evaluate(from.data(), false);
  residual();
  return largest(g.data(), s.ng) / largest(s.point.G.data(), static_cast<int>(s.point.G.size()));
}

}  // namespace mbdae
