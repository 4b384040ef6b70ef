// Bindings that evaluate a core at points: time derivatives, partials, residuals, pivot ratios.
#include <cmath>

#include "bindings/py_core.hpp"
#include "system/rank_loss.hpp"
#include "system/residuals.hpp"

namespace mbdae {

namespace {

auto partials(PyCore& c, double t, const Array& q, const Array& u, const Array& vdot, const Array& lam) {
  return attempt(c, [&](Index2System& s) {
    if (!s.tree.expanded()) reject("partials require the expanded tree");
    const size_t nv = s.nv, n = s.ny - s.nv;
    Vector q0 = checked_vector(q, s.nq, "q"), u0 = checked_vector(u, n, "u"), a = checked_vector(vdot, nv, "vdot");
    Vector multipliers = checked_vector(lam, s.ng, "lam");
    EquationPartials out;
    s.partials(t, q0.data(), u0.data(), a.data(), multipliers.data(), out);
    const size_t r = out.g_t.size();
    return std::make_tuple(array(out.M, {nv, nv}), array(out.K, {n, nv}), array(out.D, {n, n}), array(out.G, {r, nv}),
                           array(out.B, {r, nv}), vector(out.g_t));
  });
}

auto derivative(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Vector point_data = checked_vector(y, s.length, "y"), F(s.ny), z(s.ng);
    s.derivative(t, point_data.data(), F.data(), z.data());
    return std::make_tuple(vector(F), vector(z));
  });
}

auto raw_derivative(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Vector point_data = checked_vector(y, s.length, "y"), dy(s.length), z(s.ng);
    s.raw_derivative(t, point_data.data(), dy.data(), z.data());
    return std::make_tuple(vector(dy), vector(z));
  });
}

auto derivatives(PyCore& c, const Array& t, const Array& y) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  const size_t n = t.size(), length = s.length, ng = s.ng, ny = s.ny;
  Vector ts(t.data(), t.data() + n), point_data = checked_vector(y, n * length, "y"), F(n * ny, NAN), z(n * ng, NAN);
  run_unlocked(c, [&] {
    for (size_t i = 0; i < n; ++i) try {
        s.derivative(ts[i], &point_data[i * length], &F[i * ny], z.data() + i * ng);
      } catch (const FallBackToPython&) {
        std::fill_n(F.begin() + i * ny, ny, NAN), std::fill_n(z.begin() + i * ng, ng, NAN);
        if (c.callbacks->interrupted) break;
      }
  });
  return std::make_tuple(array(F, {n, ny}), array(z, {n, ng}));
}

auto residuals(PyCore& c, const Array& t, const Array& y) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  const size_t n = t.size(), length = s.length, ng = s.ng;
  Vector ts(t.data(), t.data() + n), point_data = checked_vector(y, n * length, "y"), g(n * ng), rate(n * ng),
                                     energies(2 * n);
  bool unknown = false;
  run_unlocked(c, [&] {
    for (size_t i = 0; i < n; ++i) try {
        residual(s, ts[i], &point_data[i * length], g.data() + i * ng, rate.data() + i * ng);
        const Energy e = energy(s, &point_data[i * length]);
        energies[2 * i] = e.kinetic, energies[2 * i + 1] = e.potential;
      } catch (const FallBackToPython&) {
        energies[2 * i] = energies[2 * i + 1] = NAN, unknown = true;
        if (c.callbacks->interrupted) break;
      }
  });
  return std::make_tuple(array(g, {n, ng}), array(rate, {n, ng}), array(energies, {n, 2}), unknown);
}

// g, G, g_t and gamma of all rows, including those inactive in the mode.
auto rows_of_all_modes(PyCore& c, double t, const Array& q, const Array& v) {
  return attempt(c, [&](Index2System& s) {
    const AllRowsActive all(s.constraints);
    const size_t ng = s.ng, nv = s.nv;
    Vector point_data = checked_vector(q, s.nq, "q"), u = checked_vector(v, nv, "v");
    Vector g(ng), G(ng * nv, 0.0), g_t(ng, 0.0), gamma(ng), g_tt(ng, 0.0);
    s.tree.poses(point_data.data()), s.tree.motions(point_data.data(), u.data());
    s.constraints.dense_value(s.tree, point_data.data(), s.constraints.all, G, g.data());
    s.constraints.complete_g(t, g.data()), s.constraints.evaluate_g_t(t, g_t.data());
    s.constraints.bias(s.tree, point_data.data(), u.data(), s.constraints.all, gamma.data());
    s.constraints.evaluate_g_tt(t, g_tt.data());
    for (size_t k = 0; k < ng; ++k) gamma[k] += g_tt[k];
    return std::make_tuple(vector(g), array(G, {ng, nv}), vector(g_t), vector(gamma));
  });
}

std::optional<std::pair<double, double>> smallest_pivot(PyCore& c, const Array& q, int rank) {
  Index2System& s = c.core->system;
  Vector point_data = checked_vector(q, s.nq, "q");
  if (rank < 1 || rank > std::min(s.ng, s.nv)) reject("rank out of range");
  try {
    const SmallestPivot pivot = s.smallest_pivot(point_data.data(), rank);
    return std::make_pair(pivot.size, pivot.ratio);
  } catch (const FallBackToPython&) {
    return std::nullopt;
  }
}

// Rows (k, n) as k vectors.
std::vector<Vector> vectors_of(const Array& rows, size_t n) {
  const size_t k = n ? rows.size() / n : 0;
  const Vector entries = checked_vector(rows, k * n, "vectors");
  std::vector<Vector> out;
  for (size_t i = 0; i < k; ++i) out.emplace_back(entries.begin() + i * n, entries.begin() + (i + 1) * n);
  return out;
}

auto as_rows(const std::vector<Vector>& vectors, size_t n) {
  Vector entries;
  for (const Vector& x : vectors) entries.insert(entries.end(), x.begin(), x.end());
  return array(entries, {vectors.size(), n});
}

auto velocities_in_null_space(PyCore& c, const Array& q, const Array& vectors) {
  return attempt(c, [&](Index2System& s) {
    std::vector<Vector> velocities = vectors_of(vectors, s.nv);
    admissible_velocities(s, checked_vector(q, s.nq, "q").data(), velocities);
    return as_rows(velocities, s.nv);
  });
}

auto vanishing_row_combinations(PyCore& c, const Array& q, int rank, double limit, const Array& vectors) {
  return attempt(c, [&](Index2System& s) {
    std::vector<Vector> projections = vectors_of(vectors, s.ng);
    rank = vanishing_combinations(s, checked_vector(q, s.nq, "q").data(), rank, limit, projections);
    return std::make_tuple(rank, as_rows(projections, s.ng));
  });
}

auto dependent_residual(PyCore& c, double t, const Array& q, double limit, int steps) {
  return attempt(c, [&](Index2System& s) {
    return residual_of_dependent_rows(s, t, checked_vector(q, s.nq, "q").data(), limit, steps);
  });
}

// M by rows, nle, J by columns, M a + nle; joint velocities and accelerations for v' = a, (joints, 6).
nb::object dynamics(PyCore& c, const Array& q, const Array& v, const Array& a) {
  const CoreLock lock(c);
  MultibodyTree& m = c.core->system.tree;
  c.core->system.point.invalidate();
  const size_t nv = m.nv, n = m.joints;
  Vector point_data = checked_vector(q, m.nq, "q"), u = checked_vector(v, nv, "v"), vdot = checked_vector(a, nv, "a");
  Vector V(6 * n), A(6 * n), tau(nv);
  m.dynamics(point_data.data(), u.data());
  Vector M(nv * nv), nle(m.bias(), m.bias() + nv), J(m.J(), m.J() + 6 * nv);
  m.dense_M(M.data());
  m.inverse(point_data.data(), u.data(), vdot.data(), tau.data());
  m.motions(point_data.data(), u.data(), vdot.data());
  for (size_t j = 0; j < n; ++j) m.velocity(j, &V[6 * j]), m.acceleration(j, &A[6 * j]);
  return nb::make_tuple(array(M, {nv, nv}), vector(nle), array(J, {nv, 6}), vector(tau), array(V, {n, 6}),
                        array(A, {n, 6}));
}

double minimal_stage_seconds(PyCore& c, const Array& q, const Array& v, int repetitions) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  Vector q0 = checked_vector(q, s.nq, "q"), v0 = checked_vector(v, s.nv, "v");
  try {
    s.point.evaluate(q0.data(), false);
    Vector G;
    for (int k : s.rows.in_use())
      G.resize(G.size() + s.nv), s.constraints.expand(k, s.point.G.data(), G.data() + G.size() - s.nv);
    const int r = static_cast<int>(s.rows.in_use().size());
    return pinocchio_stage_seconds(model_pointer(c.model.ptr()), q0.data(), v0.data(), r, G.data(), repetitions);
  } catch (const FallBackToPython&) {
    reject("the point is singular");
  }
}

}  // namespace

void bind_points(nb::class_<PyCore>& core) {
  using nb::arg;
  core.def("partials", partials, arg("t"), arg("q"), arg("u"), arg("vdot"), arg("lam"),
           "Return M, K, D, G, B and g_t of the rows in use, or None; lam (ng,) is by row.")
      .def("derivative", derivative, arg("t"), arg("y"),
           "Return y' (ny,) and lam (ng,) from the hidden constraint, or None.")
      .def("raw_derivative", raw_derivative, arg("t"), arg("y"),
           "Return dy/dt (length,) of raw coordinates and lam (ng,) from the hidden constraint, or None.")
      .def("derivatives", derivatives, arg("t"), arg("y"),
           "Return y' (n, ny) and lam (n, ng) at many points; nan where they cannot be computed.")
      .def("residuals", residuals, arg("t"), arg("y"),
           "Return g (n, ng), G v + g_t (n, ng), kinetic and potential energy (n, 2) at many points, and whether some "
           "are unknown.")
      .def("rows_of_all_modes", rows_of_all_modes, arg("t"), arg("q"), arg("v"),
           "Return g (ng,), G (ng, nv), g_t and Gdot v + g_tt (ng,), rows inactive in the mode included, or None.")
      .def("smallest_pivot", smallest_pivot, arg("q"), arg("rank"),
           "Return the smallest pivot of independent rows of G M^-1/2, and its ratio to the largest, or None.")
      .def("admissible_velocities", velocities_in_null_space, arg("q"), arg("vectors"),
           "Return velocities (k, nv) with G v = 0, from vectors in general position, or None.")
      .def("vanishing_combinations", vanishing_row_combinations, arg("q"), arg("rank"), arg("limit"), arg("vectors"),
           "Return the number of independent rows, at most `rank`, with pivots above `limit` times the largest, and\n"
           "projections (k, ng) of vectors onto the null space of G^T, or None.")
      .def("residual_of_dependent_rows", dependent_residual, arg("t"), arg("q"), arg("limit"), arg("steps"),
           "Return the largest |g| relative to G after Gauss-Newton steps by the independent rows, or None.")
      .def("dynamics", dynamics, arg("q"), arg("v"), arg("a"),
           "Return M, nle, J^T, M a + nle, and velocities and accelerations of joints in the world, (njoints, 6).")
      .def("minimal_stage_seconds", minimal_stage_seconds, arg("q"), arg("v"), arg("repetitions"),
           "Return the seconds of one mass matrix, nonlinear effects, factorization and solve, for benchmarks.");
}

}  // namespace mbdae
