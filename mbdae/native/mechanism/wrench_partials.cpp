// Partials of wrenches between two frames, in joint and modal coordinates.
#include "mechanism/wrench_partials.hpp"

#include <algorithm>

#include "math/eigen_types.hpp"

namespace mbdae {

// Eigen, not std::fill: for constant sizes compilers emit string instructions, which delay the next addition.
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

void line_point_partials(const double* p, const double* n, double* D) {
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
  line_point_partials(pair.pb, n, t.Db);
}

PairPartials::PairPartials(const MultibodyTree& m, const Pair& pair_, const double* v) : pair(pair_), nv(m.nv) {
  columns_.reserve(pair.columns.size());
  for (size_t k = 0; k < pair.columns.size(); ++k) {
    const int velocity = pair.columns[k];
    if (pair.sign[k] != 0 && pair.sources[k] < m.nv)
      columns_.push_back({velocity, m.expanded_joints[velocity], pair.sign[k], m.J() + 6 * velocity, {}});
  }
  add_node(m, pair.a.joint, -1, v), add_node(m, pair.b.joint, 1, v);
  if (!v) return;
  double W[2][6] = {};  // velocities of frames a and b relative to the parent of the joint
  for (size_t first, end = columns_.size(); end > 0; end = first) {
    const Column& last = columns_[end - 1];
    double* w = W[last.sign > 0];
    for (first = end; first > 0 && columns_[first - 1].joint == last.joint; --first)
      for (int i = 0; i < 6; ++i) w[i] += columns_[first - 1].J[i] * v[columns_[first - 1].velocity];
    for (size_t k = first; k < end; ++k) {
      double product[6];
      motion_cross(columns_[k].J, w, product);
      for (int i = 0; i < 6; ++i) columns_[k].dV[i] += product[i];
    }
  }
  for (int i = 0; i < 6; ++i) V[i] = W[1][i] - W[0][i];
}

// Modes move a node like two joints: translations T along axes fixed in the frame, and a rotation vector.
void PairPartials::add_node(const MultibodyTree& m, int frame, double sign, const double* v) {
  const FlexibleBody* body = nullptr;
  int index = 0;
  const FlexibleBody::Node* node = m.node(frame, body, index);
  if (!node) return;
  const ModalBody& data = body->data;
  const int modes = data.modes, node_joint = m.nv + 2 * frame;
  const double *joint_rotation = m.rotation(data.joint), *Phi2 = data.nodes[index].Phi2.data();
  const auto translation_rate = [&](const double* u, int mode, double* out) {  // d(T u)/dq of `mode`
    double local[3] = {};
    for (int i = 0; i < modes; ++i)
      for (int l = 0; l < 3; ++l) local[l] += Phi2[3 * (i * modes + mode) + l] * u[i];
    body->rotate_to_world(joint_rotation, local, out);
  };
  const double *R = m.rotation(frame), *p = m.position(frame), *Psi = data.nodes[index].Psi.data();
  split_.emplace_back(12 * modes);
  double *T = split_.back().data(), *W = T + 6 * modes, s[3] = {};
  for (int k = 0; k < modes; ++k) {
    const double* J = m.J() + 6 * (body->first_column + index * modes + k);
    std::copy(J + 3, J + 6, W + 6 * k + 3), cross(p, J + 3, W + 6 * k);
    for (int i = 0; i < 3; ++i) T[6 * k + i] = J[i] - W[6 * k + i], s[i] += v ? Psi[3 * k + i] * v[data.iv + k] : 0;
    columns_.push_back({data.iv + k, node_joint, sign, T + 6 * k, {}});
    if (v) translation_rate(v + data.iv, k, columns_.back().dV);
  }
  const auto rotation_rate = [&](const double* z, int mode, double* out) {  // d(Jr z)/dq of `mode`
    double local[3];
    rotation_jacobian_rate(*node, z, Psi + 3 * mode, local);
    rotate_by_columns(R, local, out + 3), cross(p, out + 3, out);
  };
  for (int k = 0; k < modes; ++k) {
    columns_.push_back({data.iv + k, node_joint + 1, sign, W + 6 * k, {}});
    if (v) rotation_rate(s, k, columns_.back().dV);
    for (int mode = 0; mode < modes; ++mode) {
      node_changes_.push_back({data.iv + k, data.iv + mode, sign, {}});
      double *out = node_changes_.back().change, translation[3];
      rotation_rate(Psi + 3 * k, mode, out),
          body->rotate_to_world(joint_rotation, Phi2 + 3 * (k * modes + mode), translation);
      for (int l = 0; l < 3; ++l) out[l] += translation[l];
    }
  }
}

void PairPartials::generalized_force(const WrenchPartials& t, double* K, size_t width) const {
  for (const Column& m : columns_) {
    double dF[6], parent_dF[6], product[6];  // parent_dF = dF - J x* F
    times6(m.sign > 0 ? t.Db : t.Da, m.J, dF);
    if (t.damped) {
      times6(t.C, m.dV, product);
      for (int i = 0; i < 6; ++i) dF[i] += m.sign * product[i];
    }
    cross(m.J + 3, t.F, parent_dF), cross(m.J + 3, t.F + 3, parent_dF + 3), cross(m.J, t.F, product);
    for (int i = 0; i < 3; ++i)
      parent_dF[i] = dF[i] - parent_dF[i], parent_dF[3 + i] = dF[3 + i] - parent_dF[3 + i] - product[i];
    for (const Column& k : columns_)
      K[k.velocity * width + m.velocity] += k.sign * dot6(k.J, k.sign == m.sign && m.joint <= k.joint ? parent_dF : dF);
  }
  for (const NodeChange& x : node_changes_) K[x.k * width + x.m] += x.sign * dot6(x.change, t.F);
}

void PairPartials::damping(const double* C, double* D, size_t width) const {
  for (const Column& m : columns_) {
    double dF[6];
    times6(C, m.J, dF);
    for (const Column& k : columns_) D[k.velocity * width + m.velocity] += k.sign * m.sign * dot6(k.J, dF);
  }
}

void PairPartials::power(const double* w, const WrenchPartials& t, double* B) const {
  double VD[2][6] = {};  // V^T Da, V^T Db
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) VD[0][j] += V[i] * t.Da[6 * i + j], VD[1][j] += V[i] * t.Db[6 * i + j];
  for (const Column& m : columns_) B[m.velocity] += dot6(VD[m.sign > 0], m.J) + m.sign * dot6(w, m.dV);
}

}  // namespace mbdae
