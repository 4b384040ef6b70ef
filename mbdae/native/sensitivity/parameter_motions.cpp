// Cotangents of all model components at a point: inertias, motions of placements and frames, gravity, armatures.
#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

namespace {

// Adds the partials of U . I A with respect to the ten inertial parameters, in the body's axes, times a factor.
void add_inertial_gradient(const double* U, const double* A, double factor, double* out) {
  double first[3], second[3];
  cross(A + 3, U, first), cross(A, U + 3, second);
  const double *w = U + 3, *a = A + 3;
  out[0] += factor * dot(U, A);
  for (int i = 0; i < 3; ++i) out[1 + i] += factor * (second[i] - first[i]);
  out[4] += factor * w[0] * a[0], out[5] += factor * (w[0] * a[1] + w[1] * a[0]), out[6] += factor * w[1] * a[1];
  out[7] += factor * (w[0] * a[2] + w[2] * a[0]), out[8] += factor * (w[1] * a[2] + w[2] * a[1]);
  out[9] += factor * w[2] * a[2];
}

void add_frame_gradient(const WorldPose& pose, const double* g, double* out) {  // d/d(motion), for a wrench g
  double rotated[3], local[6];
  cross(g, pose.p, rotated);
  for (int i = 0; i < 3; ++i) rotated[i] += g[3 + i];
  rotate_by_columns(pose.R, g, local), rotate_by_columns(pose.R, rotated, local + 3);
  for (int i = 0; i < 6; ++i) out[i] += local[i];
}

}  // namespace

void ParameterPartials::update_virtual_velocities(const double* v) {
  const double* J = s_.tree.J();
  for (int j = 1; j < s_.tree.joints; ++j) {
    U_[j] = U_[s_.tree.parents[j]];
    for (int c : columns_[j])
      for (int i = 0; i < 6; ++i) U_[j][i] += J[6 * c + i] * v[c];
  }
}

void ParameterPartials::add_wrench_gradient(const Pair& pair, const WrenchPartials& t, const std::vector<Six>& X,
                                            std::vector<Vector>& sums) {
  const int a = pair.a.joint, b = pair.b.joint;
  Six relative, a_gradient{}, b_gradient{}, damping{};
  for (int i = 0; i < 6; ++i) relative[i] = X[b][i] - X[a][i];
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) {
      a_gradient[j] += relative[i] * t.Da[6 * i + j], b_gradient[j] += relative[i] * t.Db[6 * i + j];
      if (t.damped) damping[j] += relative[i] * t.C[6 * i + j];
    }
  for (const MovedFrame& m : moved_frames_.at(&pair)) {
    const ModelComponent& x = components_[m.component];
    Six g = m.second ? b_gradient : a_gradient;
    if (x.kind == ModelComponent::placement) {
      const int end = m.second ? b : a, parent = s_.tree.parents[x.id];
      double Y[6], rotated[6];
      for (int i = 0; i < 6; ++i) Y[i] = X[end][i] - X[parent][i];
      wrench_cross(Y, t.F, rotated);
      for (int i = 0; i < 6; ++i) g[i] += m.second ? rotated[i] : -rotated[i];
      if (t.damped) {
        for (int i = 0; i < 6; ++i) Y[i] = V_[end][i] - V_[parent][i];
        wrench_cross(Y, damping.data(), rotated);
        for (int i = 0; i < 6; ++i) g[i] += m.second ? rotated[i] : -rotated[i];
      }
    }
    add_frame_gradient(world_poses_[m.component], g.data(), sums[m.component].data());
  }
}

void ParameterPartials::add_gap_gradient(const Pair& pair, const double* F, std::vector<Vector>& sums) {
  for (const MovedFrame& m : moved_frames_.at(&pair)) {
    Six g;
    for (int i = 0; i < 6; ++i) g[i] = m.second ? F[i] : -F[i];
    add_frame_gradient(world_poses_[m.component], g.data(), sums[m.component].data());
  }
}

// The subtree of a joint is fixed, and the remaining tree is displaced by -xi, which changes its U, V, A by U x xi, ...
void ParameterPartials::update_virtual_momenta() {
  const int joints = s_.tree.joints;
  for (int j = 1; j < joints; ++j) {
    double VU[6], IVU[6], rotated[6];
    const double *V = V_[j].data(), *U = U_[j].data();
    H_[j] = C_[j] = Six{};
    if (is_zero(U_[j])) continue;
    momentum(body_[j], U, H_[j].data());
    if (!has_placement_) continue;
    motion_cross(V, U, VU), momentum(body_[j], VU, IVU);
    wrench_cross(V, H_[j].data(), C_[j].data()), wrench_cross(U, h_[j].data(), rotated);
    for (int i = 0; i < 6; ++i) C_[j][i] -= rotated[i] + IVU[i];
  }
  H_[0] = C_[0] = Six{};
  for (int j = joints - 1; j > 0; --j) {
    const int p = s_.tree.parents[j];
    for (int i = 0; i < 6; ++i) H_[p][i] += H_[j][i], C_[p][i] += C_[j][i];
  }
}

void ParameterPartials::contract(const LinearizationPoint& point, const double* cotangent, std::vector<Vector>& sums) {
  const MultibodyTree& m = s_.tree;
  const int nv = s_.nv;
  if (needs_kinematics_) {
    update_virtual_velocities(cotangent);
    if (!inertial_joints_.empty()) update_virtual_momenta();
    for (const LawWrench& w : point.wrenches) {
      if (moved_frames_.at(w.pair).empty()) continue;
      const double power = w.conservative ? 0 : cotangent[n_ - 1];
      for (int j = 0; j < m.joints; ++j)
        for (int i = 0; i < 6; ++i) X_[j][i] = U_[j][i] + power * V_[j][i];
      add_wrench_gradient(*w.pair, w.partials, X_, sums);
    }
  }
  for (size_t i = 0; i < components_.size(); ++i) {
    const ModelComponent& x = components_[i];
    double* sum = sums[i].data();
    if (x.kind == ModelComponent::armature)
      for (int k = 0; k < nv; ++k) sum[k] -= cotangent[k] * point.vdot[k];
    if (x.kind == ModelComponent::gravity && point.has_applied_forces)
      for (int k = 0; k < 3; ++k) sum[k] += H_[0][k];
    if (x.kind == ModelComponent::inertia && !is_zero(U_[x.id])) {
      double U[6], V[6], A[6], VU[6];
      world_poses_[i].to_local(U_[x.id].data(), U), world_poses_[i].to_local(V_[x.id].data(), V),
          world_poses_[i].to_local(A_[x.id].data(), A);
      motion_cross(V, U, VU);
      add_inertial_gradient(U, A, -1, sum), add_inertial_gradient(VU, V, 1, sum);
    }
    if (x.kind == ModelComponent::placement) {
      const int p = m.parents[x.id];
      if (is_zero(U_[p]) && is_zero(H_[x.id]) && is_zero(C_[x.id])) continue;
      double rotated[6], difference[6];
      Six g;
      wrench_cross(V_[p].data(), H_[x.id].data(), difference);
      for (int k = 0; k < 6; ++k) difference[k] = C_[x.id][k] - difference[k];
      wrench_cross(V_[p].data(), difference, g.data());
      wrench_cross(U_[p].data(), F_[x.id].data(), rotated);
      for (int k = 0; k < 6; ++k) g[k] += rotated[k];
      wrench_cross(A_[p].data(), H_[x.id].data(), rotated);
      for (int k = 0; k < 6; ++k) g[k] += rotated[k];
      add_frame_gradient(world_poses_[i], g.data(), sum);
    }
  }
}

}  // namespace mbdae
