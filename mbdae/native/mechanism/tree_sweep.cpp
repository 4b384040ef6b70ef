// The outward and inward pass through the tree: poses, motions, composite inertias, wrenches.
#include "mechanism/tree_sweep.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace mbdae {

namespace {

inline void copy_rotation(const double* R, double* out) { std::memcpy(out, R, 9 * sizeof(double)); }

inline void rotate_columns(const double* R, const double* X, double* __restrict out) {
  for (int j = 0; j < 3; ++j) rotate_by_columns(R, X + 3 * j, out + 3 * j);
}

inline void rotated_about_frame_axis(int i, double c, double s, const double* R,
                                     double* out) {  // out = R Rot(e_i, angle)
  const int j = 3 * ((i + 1) % 3), k = 3 * ((i + 2) % 3);
  for (int l = 0; l < 3; ++l) {
    const double y = R[j + l], z = R[k + l];
    out[3 * i + l] = R[3 * i + l], out[j + l] = c * y + s * z, out[k + l] = c * z - s * y;
  }
}

inline void rotate_symmetric(const double* R, const double* S, double* __restrict out) {  // R S R^T
  double RS[9];  // by columns
  const double columns[9] = {S[0], S[1], S[3], S[1], S[2], S[4], S[3], S[4], S[5]};
  rotate_columns(R, columns, RS);
  for (int i = 0, at = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j, ++at) out[at] = RS[i] * R[j] + RS[3 + i] * R[3 + j] + RS[6 + i] * R[6 + j];
}

}  // namespace

TreeSweep::TreeSweep(std::vector<TreeJoint> joints, const InertiaPattern& pattern, const double* gravity,
                     const double* armature, std::vector<FlexibleBody>* flexible)
    : joints_(std::move(joints)),
      flexible_(flexible),
      pattern_(pattern),
      gravity_(gravity),
      armature_(armature),
      J_root_(pattern.starts.size() - 1) {
  for (size_t i = 0; i < joints_.size(); ++i)
    if (joints_[i].joint >= 0) index_of_frame_.push_back(static_cast<int>(i));
  links_.resize(12 * joints_.size());
  std::vector<bool> of_mode(J_root_.size());
  for (const FlexibleBody& body : *flexible_)
    for (int i = 0; i < body.data.modes; ++i) of_mode[body.data.iv + i] = true;
  for (int j = 1; j < static_cast<int>(joints_.size()); ++j)
    if (!joints_[j].nv || !of_mode[joints_[j].v]) swept_.push_back(j);
  size_t size = joints_.size();
  for (const FlexibleBody& body : *flexible_)
    for (size_t i = 0; i < body.data.nodes.size(); ++i) index_of_frame_.push_back(static_cast<int>(size++));
  V_.resize(size), A_.resize(size), references_.resize(size), arms_.resize(joints_.size());
  subtrees_.resize(joints_.size());
}

inline void TreeSweep::update_pose(int j, const double* q, const double* parent_pose, double* pose) {
  const TreeJoint& x = joints_[j];
  const double* qj = q + x.q;
  double R[9], step[3];
  if (x.parent)
    rotate_columns(parent_pose, x.R, R), rotate_by_columns(parent_pose, x.p, step);
  else
    copy_rotation(x.R, R), std::memcpy(step, x.p, sizeof(step));
  if (x.translations == 1 || x.pitch != 0) {
    const double distance = x.translations ? qj[0] : x.pitch * qj[0];
    double axis[3];
    rotate_by_columns(R, x.axis, axis);
    for (int i = 0; i < 3; ++i) step[i] += distance * axis[i];
  } else {
    for (int k = 0; k < x.translations; ++k)
      for (int i = 0; i < 3; ++i) step[i] += qj[k] * R[3 * k + i];
  }
  for (int i = 0; i < 3; ++i) {  // arms are summed separately: differences of positions far from the origin lose digits
    pose[9 + i] = x.parent ? parent_pose[9 + i] + step[i] : step[i];
    arms_[j][i] = x.parent ? arms_[x.parent][i] + step[i] : 0;
  }
  qj += x.translations;
  if (x.rotation == TreeJoint::none) return copy_rotation(R, pose);
  double local[9];
  if (x.rotation == TreeJoint::quaternion) {
    rotation_of_quaternion(qj, local);
  } else {
    const bool angle = x.rotation == TreeJoint::angle;
    const double c = angle ? std::cos(qj[0]) : qj[0], s = angle ? std::sin(qj[0]) : qj[1];
    if (x.frame_axis >= 0) return rotated_about_frame_axis(x.frame_axis, c, x.axis_sign * s, R, pose);
    rotation_about(x.axis, c, s, local);
  }
  rotate_columns(R, local, pose);
}

// Columns of translation come first, then those of rotation.
inline void TreeSweep::update_columns(int j, const double* pose, double* J) {
  const TreeJoint& x = joints_[j];
  const double *p = pose + 9, *arm = arms_[j].data();
  int k = x.v;
  const auto add_translation = [&](const double* e) {
    const Six column{e[0], e[1], e[2], 0, 0, 0};
    J_root_[k] = column, std::copy(column.begin(), column.end(), J + 6 * k++);
  };
  const auto add_rotation = [&](const double* e) {
    double *root_column = J_root_[k].data(), *out = J + 6 * k++;
    cross(arm, e, root_column), cross(p, e, out);
    for (int i = 0; i < 3; ++i) root_column[3 + i] = out[3 + i] = e[i];
  };
  if (x.nv != 1) {
    const int rotations = x.nv - x.translations;
    for (int i = 0; i < x.translations; ++i) add_translation(pose + 3 * i);
    for (int i = 3 - rotations; i < 3; ++i) add_rotation(pose + 3 * i);
    return;
  }
  double e[3];
  if (x.frame_axis >= 0)
    for (int i = 0; i < 3; ++i) e[i] = x.axis_sign * pose[3 * x.frame_axis + i];
  else
    rotate_by_columns(pose, x.axis, e);
  x.translations ? add_translation(e) : add_rotation(e);
  if (x.pitch != 0)
    for (int i = 0; i < 3; ++i) J_root_[x.v][i] += x.pitch * e[i], J[6 * x.v + i] += x.pitch * e[i];
}

inline void TreeSweep::update_motion(int j, const double* v, const double* a) {
  const TreeJoint& x = joints_[j];
  const Six& parent_V = V_[x.parent];
  Six V{}, A = A_[x.parent];
  for (int k = x.v; k < x.v + x.nv; ++k)
    for (int i = 0; i < 6; ++i) V[i] += J_root_[k][i] * v[k];
  if (x.parent) {
    double product[6];
    motion_cross(parent_V.data(), V.data(), product);
    for (int i = 0; i < 6; ++i) A[i] += product[i], V[i] += parent_V[i];
  }
  for (int k = x.v; a && k < x.v + x.nv; ++k)
    for (int i = 0; i < 6; ++i) A[i] += J_root_[k][i] * a[k];
  V_[j] = V, A_[j] = A;
}

template <bool with_inertia, bool with_wrench>
inline void TreeSweep::add_body(int j, const double* pose) {
  const TreeJoint& x = joints_[j];
  Subtree& out = subtrees_[j];
  if (x.joint < 0) {
    out = {};
    return;
  }
  const double mass = *x.mass;
  double c[3], I[6];
  rotate_by_columns(pose, x.lever, c), rotate_symmetric(pose, x.I, I);
  for (int i = 0; i < 3; ++i) c[i] += arms_[j][i];
  if (with_wrench) {  // mass times the acceleration of the centre, and Euler's equation
    const double *V = V_[j].data(), *A = A_[j].data(), *w = V + 3;
    double u[3], h[3], *F = out.f.data(), *N = F + 3;
    std::copy(A, A + 3, F), add_cross(A + 3, c, F);
    std::copy(V, V + 3, u), add_cross(w, c, u), add_cross(w, u, F);
    for (int i = 0; i < 3; ++i) F[i] *= mass;
    symmetric(I, A + 3, N), symmetric(I, w, h), add_cross(w, h, N), add_cross(c, F, N);
  }
  if (with_inertia) {
    out.mass = mass;
    for (int i = 0; i < 3; ++i) out.moment[i] = mass * c[i];
    const double square = dot(out.moment, c);
    for (int i = 0, at = 0; i < 3; ++i)
      for (int k = 0; k <= i; ++k, ++at) out.I[at] = I[at] - out.moment[i] * c[k] + (i == k ? square : 0);
  }
}

template <bool with_motion, bool with_inertia, bool with_wrench>
void TreeSweep::outward(const double* q, const double* v, const double* a, double* poses, double* J) {
  for (int j : swept_) {
    const TreeJoint& x = joints_[j];
    double* joint_pose = pose(j, poses);
    update_pose(j, q, pose(x.parent, poses), joint_pose);
    update_columns(j, joint_pose, J);
    if (with_motion) {
      const double* origin = pose(x.root, poses) + 9;
      std::copy(origin, origin + 3, references_[j].begin()), update_motion(j, v, a);
    }
    if (with_inertia || with_wrench) add_body<with_inertia, with_wrench>(j, joint_pose);
  }
  for (FlexibleBody& body : *flexible_) {
    const int j = index_of_frame_[body.data.joint];
    if (with_inertia || with_wrench) body.deform(q);  // also for the potential energy
    update_frame(body, poses), body.update_nodes(q), body.write_node_poses(poses, J);
    if (!with_motion) continue;
    for (int i : body.used()) {
      const int n = index_of_frame_[body.first_pose + i];
      references_[n] = references_[j];
      body.node_motion(i, V_[j].data(), A_[j].data(), v + body.data.iv, a ? a + body.data.iv : nullptr, V_[n].data(),
                       A_[n].data());
    }
  }
}

void TreeSweep::add_flexible(std::vector<FlexibleBody>& bodies, const double* v, const double* a, double* M, double* nle) {
  for (FlexibleBody& body : bodies) {
    const int j = index_of_frame_[body.data.joint];
    const int first = body.data.iv, end = first + body.data.modes;
    if (M) body.add_inertia(J_root_.data(), pattern_.starts, M);
    for (int k = first; M && k < end; ++k) M[pattern_.starts[k]] += armature_[k];
    if (nle) body.add_force(J_root_.data(), V_[j].data(), A_[j].data(), v + first, a ? a + first : nullptr, nle);
  }
}

void TreeSweep::add_partials(const int* expanded_joints, const double* q, const double* v, const double* a,
                             bool inertia_only, double* dtau_dq, double* dtau_dv) const {
  Six base{};
  for (int i = 0; i < 3 && !inertia_only; ++i) base[i] = -gravity_[i];
  for (const FlexibleBody& body : *flexible_)
    body.add_partials(J_root_.data(), expanded_joints, q, v, a, base, dtau_dq, dtau_dv, J_root_.size());
}

template <bool with_inertia, bool with_wrench>
void TreeSweep::inward(double* M, double* nle) {
  for (const FlexibleBody& body : *flexible_)
    if (with_wrench) std::fill_n(nle + body.data.iv, body.data.modes, 0.0);
  for (size_t i_swept = swept_.size(); i_swept-- > 0;) {
    const int j = swept_[i_swept];
    const TreeJoint& x = joints_[j];
    const Subtree& subtree = subtrees_[j];
    for (int k = x.v; k < x.v + x.nv; ++k) {
      const double* J = J_root_[k].data();
      if (with_wrench) nle[k] = dot6(subtree.f.data(), J);
      if (!with_inertia) continue;
      double F[6];
      for (int i = 0; i < 3; ++i) F[i] = subtree.mass * J[i];
      add_cross(J + 3, subtree.moment, F), symmetric(subtree.I, J + 3, F + 3), add_cross(subtree.moment, J, F + 3);
      for (size_t i = pattern_.starts[k]; i < pattern_.starts[k + 1]; ++i)
        M[i] = dot6(F, J_root_[pattern_.rows[i]].data());
      M[pattern_.starts[k]] += armature_[k];
    }
    if (!x.parent) continue;
    Subtree& parent = subtrees_[x.parent];
    if (with_wrench)
      for (int i = 0; i < 6; ++i) parent.f[i] += subtree.f[i];
    if (!with_inertia) continue;
    parent.mass += subtree.mass;
    for (int i = 0; i < 3; ++i) parent.moment[i] += subtree.moment[i];
    for (int i = 0; i < 6; ++i) parent.I[i] += subtree.I[i];
  }
}

void TreeSweep::poses(const double* q, double* poses, double* J) {
  outward<false, false, false>(q, nullptr, nullptr, poses, J);
}

void TreeSweep::inertia(const double* q, double* poses, double* J, double* M) {
  outward<false, true, false>(q, nullptr, nullptr, poses, J), inward<true, false>(M, nullptr);
  add_flexible(*flexible_, nullptr, nullptr, M, nullptr);
}

void TreeSweep::dynamics(const double* q, const double* v, double* poses, double* J, double* M, double* nle) {
  for (int i = 0; i < 3; ++i) A_[0][i] = -gravity_[i];
  outward<true, true, true>(q, v, nullptr, poses, J), inward<true, true>(M, nle);
  add_flexible(*flexible_, v, nullptr, M, nle);
}

void TreeSweep::inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) {
  for (int i = 0; i < 3; ++i) A_[0][i] = -gravity_[i];
  outward<true, false, true>(q, v, a, poses, J), inward<false, true>(nullptr, out);
  add_flexible(*flexible_, v, a, nullptr, out);
  for (size_t k = 0; a && k < J_root_.size(); ++k) out[k] += armature_[k] * a[k];
}

void TreeSweep::add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a,
                           const double* gravity, double* poses, double* J, double* out) {
  for (int i = 0; i < 3; ++i) A_[0][i] = -gravity[i];
  outward<true, false, false>(q, v, a, poses, J);
  for (FlexibleBody& body : bodies) body.deform(q), update_frame(body, poses);
  add_flexible(bodies, v, a, nullptr, out);
}

void TreeSweep::motions(const double* q, const double* v, const double* a, double* poses, double* J) {
  A_[0] = {};
  outward<true, false, false>(q, v, a, poses, J);
}

void TreeSweep::shift(const std::vector<Six>& motions, int joint, double* out) const {
  const int j = index_of_frame_[joint];
  const Six& x = motions[j];
  std::copy(x.begin(), x.end(), out), add_cross(references_[j].data(), x.data() + 3, out);
}

}  // namespace mbdae
