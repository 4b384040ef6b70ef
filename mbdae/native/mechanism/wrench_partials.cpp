#include "mechanism/wrench_partials.hpp"

#include <algorithm>

#include "math/eigen_types.hpp"

namespace mbdae {

// Not by string instructions, which compilers choose for constant sizes: the next addition would wait for them.
void WrenchPartials::clear() {
  using Eigen::Map, Eigen::Vector;
  Map<Vector<double, 6>>(F).setZero();
  for (double* D : {Da, Db}) Map<Vector<double, 36>>(D).setZero();
  damped = false;
}

void WrenchPartials::add(double factor, const WrenchPartials& other) {
  for (int i = 0; i < 6; ++i) F[i] += factor * other.F[i];
  for (int i = 0; i < 36; ++i) Da[i] += factor * other.Da[i], Db[i] += factor * other.Db[i];
}

void WrenchPartials::damp() {
  Eigen::Map<Eigen::Vector<double, 36>>(C).setZero();
  damped = true;
}

void WrenchPartials::complete(const double* V) {
  matrix_of_wrench(F, Da);
  for (int j = 0; j < 6; ++j) {
    double column[6] = {0, 0, 0, 0, 0, 0};
    if (damped) {
      double e[6] = {0, 0, 0, 0, 0, 0}, dV[6];
      e[j] = 1, motion_cross(V, e, dV), times6(C, dV, column);
    }
    for (int i = 0; i < 6; ++i) Da[6 * i + j] += column[i] - Db[6 * i + j];
  }
}

void times6(const double* D, const double* x, double* out) {
  for (int i = 0; i < 6; ++i) out[i] = dot6(D + 6 * i, x);
}

void matrix_of_wrench(const double* F, double* out) {
  double f[9], m[9];
  skew(F, f), skew(F + 3, m);
  std::fill(out, out + 36, 0.0);
  add_block(out, 0, 3, f, -1), add_block(out, 3, 0, f, -1), add_block(out, 3, 3, m, -1);
}

void moved_line_partials(const double* p, const double* n, double* D) {
  double N[9], NP[9];
  skew(n, N), skew_product(n, p, NP);
  add_block(D, 3, 0, N, -1), add_block(D, 3, 3, NP, 1);
}

void distance_partials(const Pair& pair, double factor, WrenchPartials& t) {
  double n[3], N[9], A[9], B[9], NA[9], NB[9], out[9];
  const double d = unit_gap(pair, n);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) N[3 * i + j] = ((i == j) - n[i] * n[j]) / d * factor;
  skew(pair.pa, A), skew(pair.pb, B), product(N, A, NA), product(N, B, NB);
  add_block(t.Da, 0, 0, N, -1), add_block(t.Da, 0, 3, NA, 1), add_block(t.Db, 0, 0, N, 1),
      add_block(t.Db, 0, 3, NB, -1);
  product(B, N, out), add_block(t.Da, 3, 0, out, -1), add_block(t.Db, 3, 0, out, 1);
  product(B, NA, out), add_block(t.Da, 3, 3, out, 1);
  product(B, NB, out), add_block(t.Db, 3, 3, out, -1);
  for (double& x : n) x *= factor;
  moved_line_partials(pair.pb, n, t.Db);
}

PairPartials::PairPartials(const MultibodyTree& m, const Pair& pair_, const double* v) : pair(pair_), nv(m.nv) {
  columns_.reserve(pair.columns.size());
  for (size_t k = 0; k < pair.columns.size(); ++k) {
    const int at = pair.columns[k];
    if (pair.sign[k] != 0 && pair.sources[k] < m.nv)
      columns_.push_back({at, m.expanded_joints[at], pair.sign[k], m.J() + 6 * at, {}});
  }
  add_node(m, pair.a.joint, -1, v), add_node(m, pair.b.joint, 1, v);
  if (!v) return;
  double W[2][6] = {};  // of frames a and b, relative to the parent of the joint
  for (size_t first, end = columns_.size(); end > 0; end = first) {
    const Column& last = columns_[end - 1];
    double* w = W[last.sign > 0];
    for (first = end; first > 0 && columns_[first - 1].joint == last.joint; --first)
      for (int i = 0; i < 6; ++i) w[i] += columns_[first - 1].J[i] * v[columns_[first - 1].at];
    for (size_t k = first; k < end; ++k) {
      double product[6];
      motion_cross(columns_[k].J, w, product);
      for (int i = 0; i < 6; ++i) columns_[k].dV[i] += product[i];
    }
  }
  for (int i = 0; i < 6; ++i) V[i] = W[1][i] - W[0][i];
}

// A node moves by its modes like by two joints: translations T along axes fixed in the frame, and a rotation vector.
void PairPartials::add_node(const MultibodyTree& m, int frame, double sign, const double* v) {
  const FlexibleBody* body = nullptr;
  int number = 0;
  const FlexibleBody::Node* node = m.node(frame, body, number);
  if (!node) return;
  const ModalBody& data = body->data;
  const int modes = data.modes, part = m.nv + 2 * frame;
  const double *carrier = m.rotation(data.joint), *Phi2 = data.nodes[number].Phi2.data();
  const auto translate = [&](const double* u, int by, double* out) {  // the change of the translation T u, by mode `by`
    double local[3] = {};
    for (int i = 0; i < modes; ++i)
      for (int l = 0; l < 3; ++l) local[l] += Phi2[3 * (i * modes + by) + l] * u[i];
    body->rotate_to_world(carrier, local, out);
  };
  const double *R = m.rotation(frame), *p = m.position(frame), *Psi = data.nodes[number].Psi.data();
  split_.emplace_back(12 * modes);
  double *T = split_.back().data(), *W = T + 6 * modes, s[3] = {};
  for (int k = 0; k < modes; ++k) {
    const double* J = m.J() + 6 * (body->first_column + number * modes + k);
    std::copy(J + 3, J + 6, W + 6 * k + 3), cross(p, J + 3, W + 6 * k);
    for (int i = 0; i < 3; ++i) T[6 * k + i] = J[i] - W[6 * k + i], s[i] += v ? Psi[3 * k + i] * v[data.iv + k] : 0;
    columns_.push_back({data.iv + k, part, sign, T + 6 * k, {}});
    if (v) translate(v + data.iv, k, columns_.back().dV);
  }
  const auto change = [&](const double* z, int by, double* out) {  // of the rotation z, by mode `by`
    double local[3];
    rotation_jacobian_rate(*node, z, Psi + 3 * by, local);
    rotate_by_columns(R, local, out + 3), cross(p, out + 3, out);
  };
  for (int k = 0; k < modes; ++k) {
    columns_.push_back({data.iv + k, part + 1, sign, W + 6 * k, {}});
    if (v) change(s, k, columns_.back().dV);
    for (int by = 0; by < modes; ++by) {
      node_changes_.push_back({data.iv + k, data.iv + by, sign, {}});
      double *out = node_changes_.back().change, moved[3];
      change(Psi + 3 * k, by, out), body->rotate_to_world(carrier, Phi2 + 3 * (k * modes + by), moved);
      for (int l = 0; l < 3; ++l) out[l] += moved[l];
    }
  }
}

void PairPartials::torque(const WrenchPartials& t, double* K, size_t width) const {
  for (const Column& m : columns_) {
    double dF[6], within[6], more[6];  // within = dF - J x* F
    times6(m.sign > 0 ? t.Db : t.Da, m.J, dF);
    if (t.damped) {
      times6(t.C, m.dV, more);
      for (int i = 0; i < 6; ++i) dF[i] += m.sign * more[i];
    }
    cross(m.J + 3, t.F, within), cross(m.J + 3, t.F + 3, within + 3), cross(m.J, t.F, more);
    for (int i = 0; i < 3; ++i) within[i] = dF[i] - within[i], within[3 + i] = dF[3 + i] - within[3 + i] - more[i];
    for (const Column& k : columns_)
      K[k.at * width + m.at] += k.sign * dot6(k.J, k.sign == m.sign && m.joint <= k.joint ? within : dF);
  }
  for (const Turn& x : node_changes_) K[x.k * width + x.m] += x.sign * dot6(x.change, t.F);
}

void PairPartials::damping(const double* C, double* D, size_t width) const {
  for (const Column& m : columns_) {
    double dF[6];
    times6(C, m.J, dF);
    for (const Column& k : columns_) D[k.at * width + m.at] += k.sign * m.sign * dot6(k.J, dF);
  }
}

void PairPartials::power(const double* w, const WrenchPartials& t, double* B) const {
  double by[2][6] = {};  // V^T Da, V^T Db
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) by[0][j] += V[i] * t.Da[6 * i + j], by[1][j] += V[i] * t.Db[6 * i + j];
  for (const Column& m : columns_) B[m.at] += dot6(by[m.sign > 0], m.J) + m.sign * dot6(w, m.dV);
}

}  // namespace mbdae
