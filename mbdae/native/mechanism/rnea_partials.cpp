// Recursions of the analytical partials of inverse dynamics.
#include "mechanism/rnea_partials.hpp"

#include <algorithm>

namespace mbdae {

RneaPartials::RneaPartials(std::vector<int> parents, std::vector<std::vector<int>> dofs)
    : parents_(std::move(parents)), dofs_(std::move(dofs)), ancestor_dofs_(parents_.size()) {
  size_t nv = 0;
  for (size_t p = 0; p < parents_.size(); ++p) {
    nv += dofs_[p].size();
    for (int b = parents_[p]; b >= 0; b = parents_[b])
      ancestor_dofs_[p].insert(ancestor_dofs_[p].end(), dofs_[b].begin(), dofs_[b].end());
  }
  bodies_.resize(parents_.size()), has_mass_.resize(parents_.size()), columns_.resize(nv);
  for (auto* x : {&V_, &A_, &Aa_, &f_}) x->resize(parents_.size());
}

void RneaPartials::set(int joint, const Body& b) {
  InertiaTerms& c = bodies_[joint];
  has_mass_[joint] = true, c.mass = b.mass;
  for (int i = 0; i < 3; ++i) c.moment[i] = b.mass * b.centre[i];
  const double square = dot(c.moment, b.centre);
  for (int i = 0, at = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j, ++at) c.I[at] = b.I[3 * i + j] - c.moment[i] * b.centre[j] + (i == j ? square : 0);
}

inline void RneaPartials::InertiaTerms::momentum(const double* x, double* out) const {
  for (int i = 0; i < 3; ++i) out[i] = mass * x[i];
  add_cross(x + 3, moment, out);
  symmetric(I, x + 3, out + 3);
  add_cross(moment, x, out + 3);
}

inline void RneaPartials::InertiaTerms::add_D(const double* x, double* out) const {
  double linear[3], angular[3];
  cross(x, h.data(), linear), symmetric(S, x, angular), add_cross(x, h.data() + 3, angular);
  for (int i = 0; i < 3; ++i) out[i] += 2 * linear[i], out[3 + i] += angular[i];
}

inline void RneaPartials::InertiaTerms::D_transposed(const double* x, double* out) const {
  double linear[3];
  cross(h.data(), x, linear), symmetric(S, x + 3, out), add_cross(h.data() + 3, x + 3, out);
  for (int i = 0; i < 3; ++i) out[i] += 2 * linear[i];
}

void RneaPartials::InertiaTerms::set_motion(const double* V, const double* A) {
  const double* w = V + 3;
  double product[6];
  momentum(V, h.data()), momentum(A, f.data()), wrench_cross(V, h.data(), product);
  for (int i = 0; i < 6; ++i) f[i] += product[i];
  // 2 (moment . V) 1 - V moment^T - moment V^T + w x I + (w x I)^T
  const double rows[3][3] = {{I[0], I[1], I[3]}, {I[1], I[2], I[4]}, {I[3], I[4], I[5]}};
  double WI[3][3];  // by columns, as I is symmetric
  for (int i = 0; i < 3; ++i) cross(w, rows[i], WI[i]);
  const double twice_mV = 2 * dot(moment, V);
  for (int i = 0, at = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j, ++at)
      S[at] = WI[j][i] + WI[i][j] - V[i] * moment[j] - moment[i] * V[j] + (i == j ? twice_mV : 0);
}

void RneaPartials::update_motion(int joint, const double* J, const double* v) {
  const int parent = parents_[joint];
  static const Six zero{};
  Six &V = V_[joint], &A = A_[joint];
  const Six& Vp = parent < 0 ? zero : V_[parent];
  V = Vp;
  A = parent < 0 ? base_ : A_[parent];
  for (int k : dofs_[joint]) {
    Column& c = columns_[k];
    std::copy_n(J + 6 * k, 6, c.J.begin());
    motion_cross(Vp.data(), c.J.data(), c.psi_dot.data());
    for (int i = 0; i < 6; ++i) V[i] += c.J[i] * v[k];
  }
  for (int k : dofs_[joint]) {
    Column& c = columns_[k];
    double product[6];
    motion_cross(V.data(), c.J.data(), product);
    for (int i = 0; i < 6; ++i) c.psi_dot_plus_S_dot[i] = c.psi_dot[i] + product[i], A[i] += product[i] * v[k];
  }
}

void RneaPartials::begin(const double* J, const double* gravity, const double* v, double* M, double* nle) {
  const size_t nv = columns_.size();
  const int joints = static_cast<int>(parents_.size());
  subtrees_ = bodies_, base_ = {-gravity[0], -gravity[1], -gravity[2], 0, 0, 0};
  for (int p = 0; p < joints; ++p) {
    update_motion(p, J, v);
    if (has_mass_[p]) subtrees_[p].set_motion(V_[p].data(), A_[p].data());
  }
  std::fill(M, M + nv * nv, 0.0);
  for (int p = joints - 1; p >= 0; --p) {
    const InertiaTerms& c = subtrees_[p];
    for (int k : dofs_[p]) {
      Column& x = columns_[k];
      c.momentum(x.J.data(), x.IJ.data()), c.D_transposed(x.J.data(), x.DJ);
      nle[k] = dot6(x.J.data(), c.f.data());
      for (int j : dofs_[p]) M[k * nv + j] = dot6(x.IJ.data(), columns_[j].J.data());
      for (int j : ancestor_dofs_[p]) M[k * nv + j] = M[j * nv + k] = dot6(x.IJ.data(), columns_[j].J.data());
    }
    if (parents_[p] < 0) continue;
    InertiaTerms& parent = subtrees_[parents_[p]];
    parent.mass += c.mass;
    for (int i = 0; i < 3; ++i) parent.moment[i] += c.moment[i];
    for (int i = 0; i < 6; ++i)
      parent.I[i] += c.I[i], parent.h[i] += c.h[i], parent.f[i] += c.f[i], parent.S[i] += c.S[i];
  }
}

void RneaPartials::complete(const double* a, double* dtau_dq, double* dtau_dv, bool inertia_only) {
  const size_t nv = columns_.size();
  const int joints = static_cast<int>(parents_.size());
  static const Six zero{};
  for (int p = 0; p < joints; ++p) {
    const int parent = parents_[p];
    const Six &V = parent < 0 ? zero : V_[parent], &A = inertia_only ? zero : parent < 0 ? base_ : A_[parent];
    Six Aa = parent < 0 ? zero : Aa_[parent], Ap;
    for (int i = 0; i < 6; ++i) Ap[i] = A[i] + Aa[i];
    for (int k : dofs_[p]) {
      Column& c = columns_[k];
      double product[6];
      motion_cross(Ap.data(), c.J.data(), c.psi_ddot.data()), motion_cross(V.data(), c.psi_dot.data(), product);
      for (int i = 0; i < 6; ++i) c.psi_ddot[i] += product[i], Aa[i] += c.J[i] * a[k];
    }
    Aa_[p] = Aa, f_[p] = zero;
    if (has_mass_[p]) bodies_[p].momentum(Aa.data(), f_[p].data());
  }
  for (double* out : {dtau_dq, dtau_dv}) std::fill(out, out + nv * nv, 0.0);
  for (int p = joints - 1; p >= 0; --p) {
    const InertiaTerms& c = subtrees_[p];
    double F[6];
    for (int i = 0; i < 6; ++i) F[i] = f_[p][i] + (inertia_only ? 0 : c.f[i]);
    for (int k : dofs_[p]) {
      const Column& x = columns_[k];
      const auto set_ancestor_entries = [&](int j) {
        const Column& y = columns_[j];
        dtau_dq[k * nv + j] = dot(x.DJ, y.psi_dot.data() + 3) + dot6(x.IJ.data(), y.psi_ddot.data());
        dtau_dv[k * nv + j] = dot(x.DJ, y.J.data() + 3) + dot6(x.IJ.data(), y.psi_dot_plus_S_dot.data());
      };
      for (int j : dofs_[p]) set_ancestor_entries(j);
      if (ancestor_dofs_[p].empty()) continue;
      double F_q[6], F_v[6], product[6];  // partials of the subtree's wrench
      c.momentum(x.psi_ddot.data(), F_q), c.add_D(x.psi_dot.data() + 3, F_q);
      wrench_cross(x.J.data(), F, product);
      for (int i = 0; i < 6; ++i) F_q[i] += product[i];
      c.momentum(x.psi_dot_plus_S_dot.data(), F_v), c.add_D(x.J.data() + 3, F_v);
      for (int j : ancestor_dofs_[p]) {
        set_ancestor_entries(j);
        dtau_dq[j * nv + k] = dot6(F_q, columns_[j].J.data()), dtau_dv[j * nv + k] = dot6(F_v, columns_[j].J.data());
      }
    }
    if (parents_[p] < 0) continue;
    for (int i = 0; i < 6; ++i) f_[parents_[p]][i] += f_[p][i];
  }
}

}  // namespace mbdae
