#include "mechanism/rnea_partials.hpp"

#include <algorithm>

namespace mbdae {

RneaPartials::RneaPartials(std::vector<int> parents, std::vector<std::vector<int>> own)
    : parents_(std::move(parents)), own_(std::move(own)), before_(parents_.size()) {
  size_t nv = 0;
  for (size_t p = 0; p < parents_.size(); ++p) {
    nv += own_[p].size();
    for (int b = parents_[p]; b >= 0; b = parents_[b])
      before_[p].insert(before_[p].end(), own_[b].begin(), own_[b].end());
  }
  bodies_.resize(parents_.size()), heavy_.resize(parents_.size()), columns_.resize(nv);
  for (auto* x : {&V_, &A_, &more_, &f_}) x->resize(parents_.size());
}

void RneaPartials::set(int part, const Body& b) {
  Carried& c = bodies_[part];
  heavy_[part] = true, c.mass = b.mass;
  for (int i = 0; i < 3; ++i) c.moment[i] = b.mass * b.centre[i];
  const double square = dot(c.moment, b.centre);
  for (int i = 0, at = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j, ++at) c.I[at] = b.I[3 * i + j] - c.moment[i] * b.centre[j] + (i == j ? square : 0);
}

inline void RneaPartials::Carried::momentum(const double* x, double* out) const {
  for (int i = 0; i < 3; ++i) out[i] = mass * x[i];
  add_cross(x + 3, moment, out);
  symmetric(I, x + 3, out + 3);
  add_cross(moment, x, out + 3);
}

inline void RneaPartials::Carried::add_D(const double* x, double* out) const {
  double linear[3], angular[3];
  cross(x, h.data(), linear), symmetric(S, x, angular), add_cross(x, h.data() + 3, angular);
  for (int i = 0; i < 3; ++i) out[i] += 2 * linear[i], out[3 + i] += angular[i];
}

inline void RneaPartials::Carried::D_transposed(const double* x, double* out) const {
  double linear[3];
  cross(h.data(), x, linear), symmetric(S, x + 3, out), add_cross(h.data() + 3, x + 3, out);
  for (int i = 0; i < 3; ++i) out[i] += 2 * linear[i];
}

void RneaPartials::Carried::weigh(const double* V, const double* A) {
  const double* w = V + 3;
  double turned[6];
  momentum(V, h.data()), momentum(A, f.data()), wrench_cross(V, h.data(), turned);
  for (int i = 0; i < 6; ++i) f[i] += turned[i];
  // 2 (moment . V) 1 - V moment^T - moment V^T + w x I + (w x I)^T
  const double rows[3][3] = {{I[0], I[1], I[3]}, {I[1], I[2], I[4]}, {I[3], I[4], I[5]}};
  double WI[3][3];  // by columns, as I is symmetric
  for (int i = 0; i < 3; ++i) cross(w, rows[i], WI[i]);
  const double twice = 2 * dot(moment, V);
  for (int i = 0, at = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j, ++at)
      S[at] = WI[j][i] + WI[i][j] - V[i] * moment[j] - moment[i] * V[j] + (i == j ? twice : 0);
}

void RneaPartials::move(int part, const double* J, const double* v) {
  const int parent = parents_[part];
  static const Six still{};
  Six &V = V_[part], &A = A_[part];
  const Six& before = parent < 0 ? still : V_[parent];
  V = before;
  A = parent < 0 ? base_ : A_[parent];
  for (int k : own_[part]) {
    Column& c = columns_[k];
    std::copy_n(J + 6 * k, 6, c.J.begin());
    motion_cross(before.data(), c.J.data(), c.once.data());
    for (int i = 0; i < 6; ++i) V[i] += c.J[i] * v[k];
  }
  for (int k : own_[part]) {
    Column& c = columns_[k];
    double turned[6];
    motion_cross(V.data(), c.J.data(), turned);
    for (int i = 0; i < 6; ++i) c.both[i] = c.once[i] + turned[i], A[i] += turned[i] * v[k];
  }
}

void RneaPartials::stand(const double* J, const double* gravity, const double* v, double* M, double* nle) {
  const size_t nv = columns_.size();
  const int parts = static_cast<int>(parents_.size());
  carried_ = bodies_, base_ = {-gravity[0], -gravity[1], -gravity[2], 0, 0, 0};
  for (int p = 0; p < parts; ++p) {
    move(p, J, v);
    if (heavy_[p]) carried_[p].weigh(V_[p].data(), A_[p].data());
  }
  std::fill(M, M + nv * nv, 0.0);
  for (int p = parts - 1; p >= 0; --p) {
    const Carried& c = carried_[p];
    for (int k : own_[p]) {
      Column& x = columns_[k];
      c.momentum(x.J.data(), x.IJ.data()), c.D_transposed(x.J.data(), x.DJ);
      nle[k] = dot6(x.J.data(), c.f.data());
      for (int j : own_[p]) M[k * nv + j] = dot6(x.IJ.data(), columns_[j].J.data());
      for (int j : before_[p]) M[k * nv + j] = M[j * nv + k] = dot6(x.IJ.data(), columns_[j].J.data());
    }
    if (parents_[p] < 0) continue;
    Carried& to = carried_[parents_[p]];
    to.mass += c.mass;
    for (int i = 0; i < 3; ++i) to.moment[i] += c.moment[i];
    for (int i = 0; i < 6; ++i) to.I[i] += c.I[i], to.h[i] += c.h[i], to.f[i] += c.f[i], to.S[i] += c.S[i];
  }
}

void RneaPartials::find(const double* a, double* by_q, double* by_v, bool alone) {
  const size_t nv = columns_.size();
  const int parts = static_cast<int>(parents_.size());
  static const Six still{};
  for (int p = 0; p < parts; ++p) {
    const int parent = parents_[p];
    const Six &V = parent < 0 ? still : V_[parent], &A = alone ? still : parent < 0 ? base_ : A_[parent];
    Six more = parent < 0 ? still : more_[parent], before;
    for (int i = 0; i < 6; ++i) before[i] = A[i] + more[i];
    for (int k : own_[p]) {
      Column& c = columns_[k];
      double turned[6];
      motion_cross(before.data(), c.J.data(), c.twice.data()), motion_cross(V.data(), c.once.data(), turned);
      for (int i = 0; i < 6; ++i) c.twice[i] += turned[i], more[i] += c.J[i] * a[k];
    }
    more_[p] = more, f_[p] = still;
    if (heavy_[p]) bodies_[p].momentum(more.data(), f_[p].data());
  }
  for (double* out : {by_q, by_v}) std::fill(out, out + nv * nv, 0.0);
  for (int p = parts - 1; p >= 0; --p) {
    const Carried& c = carried_[p];
    double F[6];
    for (int i = 0; i < 6; ++i) F[i] = f_[p][i] + (alone ? 0 : c.f[i]);
    for (int k : own_[p]) {
      const Column& x = columns_[k];
      const auto by_those_before = [&](int j) {
        const Column& y = columns_[j];
        by_q[k * nv + j] = dot(x.DJ, y.once.data() + 3) + dot6(x.IJ.data(), y.twice.data());
        by_v[k * nv + j] = dot(x.DJ, y.J.data() + 3) + dot6(x.IJ.data(), y.both.data());
      };
      for (int j : own_[p]) by_those_before(j);
      if (before_[p].empty()) continue;
      double by_x[6], by_rate[6], turned[6];  // of F
      c.momentum(x.twice.data(), by_x), c.add_D(x.once.data() + 3, by_x);
      wrench_cross(x.J.data(), F, turned);
      for (int i = 0; i < 6; ++i) by_x[i] += turned[i];
      c.momentum(x.both.data(), by_rate), c.add_D(x.J.data() + 3, by_rate);
      for (int j : before_[p]) {
        by_those_before(j);
        by_q[j * nv + k] = dot6(by_x, columns_[j].J.data()), by_v[j * nv + k] = dot6(by_rate, columns_[j].J.data());
      }
    }
    if (parents_[p] < 0) continue;
    for (int i = 0; i < 6; ++i) f_[parents_[p]][i] += f_[p][i];
  }
}

}  // namespace mbdae
