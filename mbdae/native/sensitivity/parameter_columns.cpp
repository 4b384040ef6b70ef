// Partials at a point with respect to each parameter: columns of P and Q, from the directions of the parameter.
#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

namespace {

// dI V of ten inertial parameters, in the body's axes.
void inertial_momentum(const double* x, const double* V, double* out) {
  const double *m = x + 1, *I = x + 4, *w = V + 3;
  double arm[3];
  cross(w, m, arm), cross(m, V, out + 3);
  for (int i = 0; i < 3; ++i) out[i] = x[0] * V[i] + arm[i];
  out[3] += I[0] * w[0] + I[1] * w[1] + I[3] * w[2];
  out[4] += I[1] * w[0] + I[2] * w[1] + I[4] * w[2];
  out[5] += I[3] * w[0] + I[4] * w[1] + I[5] * w[2];
}

}  // namespace

void ParameterPartials::forces(const LinearizationPoint& point, Vector& P) {
  const size_t n = n_;
  P.assign(count_ * n, 0.0);
  evaluate_terms(point);
  for (int i = 0; i < static_cast<int>(components_.size()); ++i) {
    const ModelComponent::Kind kind = components_[i].kind;
    if (kind == ModelComponent::inertia) inertia_columns(i, P);
    if (kind == ModelComponent::placement) placement_columns(i, P);
    if (kind == ModelComponent::gravity && point.has_applied_forces) gravity_columns(i, P);
    if (kind != ModelComponent::armature) continue;
    for (const Direction* d : directions_of_[i])
      for (int k = 0; k < s_.nv; ++k) P[d->parameter * n + k] -= d->x[k] * point.vdot[k];
  }
  for (const LawWrench& w : point.wrenches) pair_columns(w, P);
  for (size_t i = 0; i < changed_.size(); ++i)
    for (size_t e = 0; e < n; ++e) P[changed_[i].parameter * n + e] += changed_P_[i * n + e];
}

void ParameterPartials::rows(const LinearizationPoint& point, Vector& Q, const Vector& q) {
  const IndependentRows& rows = point.rows ? *point.rows : s_.rows;
  const std::vector<int>& position = rows.position();
  const size_t r = rows.in_use().size();
  Q.assign(count_ * r, 0.0);
  for_constraint_points(point, q, [&](const LinearizationPoint::ConstraintPoint& constrained, const Pair& pair) {
    row_columns(constrained, pair, r, Q);
  });
  for (size_t i = 0; i < changed_.size(); ++i)
    for (int row : rows.in_use()) Q[changed_[i].parameter * r + position[row]] += changed_Q_[i * s_.ng + row];
}

void ParameterPartials::subtract_wrench(int joint, const double* W, double* P) const {
  const double* J = s_.tree.J();
  for (int j = joint; j; j = s_.tree.parents[j])
    for (int c : columns_[j]) P[c] -= dot6(J + 6 * c, W);
}

void ParameterPartials::subtract_subtree_wrenches(int joint, double* P) {
  const double* J = s_.tree.J();
  const std::vector<int>& subtree = subtree_[joint];
  for (size_t l = subtree.size(); l-- > 0;) {
    const int j = subtree[l];
    for (int c : columns_[j]) P[c] -= dot6(J + 6 * c, W_[j].data());
    if (j == joint) continue;
    Six& parent_W = W_[s_.tree.parents[j]];
    for (int i = 0; i < 6; ++i) parent_W[i] += W_[j][i];
  }
}

void ParameterPartials::inertia_columns(int component, Vector& P) const {
  const int j = components_[component].id;
  double V[6], A[6], W[6], h[6], rotated[6];
  world_poses_[component].to_local(V_[j].data(), V), world_poses_[component].to_local(A_[j].data(), A);
  for (const Direction* d : directions_of_[component]) {
    inertial_momentum(d->x.data(), A, W), inertial_momentum(d->x.data(), V, h), wrench_cross(V, h, rotated);
    for (int i = 0; i < 6; ++i) W[i] += rotated[i];
    world_poses_[component].wrench_to_world(W, h);
    subtract_wrench(j, h, &P[d->parameter * n_]);
  }
}

void ParameterPartials::gravity_columns(int component, Vector& P) {
  for (const Direction* d : directions_of_[component]) {
    const double A[6] = {-d->x[0], -d->x[1], -d->x[2], 0, 0, 0};
    W_[0] = Six{};
    for (int j : subtree_[0]) momentum(body_[j], A, W_[j].data());
    subtract_subtree_wrenches(0, &P[d->parameter * n_]);
  }
}

// The subtree of the joint is fixed, and the remaining tree is displaced by -xi.
void ParameterPartials::placement_columns(int component, Vector& P) {
  const int joint = components_[component].id, parent = s_.tree.parents[joint];
  const double *Vp = V_[parent].data(), *Ap = A_[parent].data();
  for (const Direction* d : directions_of_[component]) {
    double xi[6], dA[6], rotated[6], W[6];
    Six dV;
    world_poses_[component].to_world(d->x.data(), xi);
    motion_cross(Vp, xi, dV.data()), motion_cross(Ap, xi, dA);
    const bool rotates = !is_zero(dV);
    for (int j : subtree_[joint]) {
      double* wrench = W_[j].data();
      if (!rotates) {
        momentum(body_[j], dA, wrench);
        continue;
      }
      double V[6], A[6], h[6];
      for (int i = 0; i < 6; ++i) V[i] = Vp[i] - V_[j][i];
      motion_cross(V, dV.data(), A);
      for (int i = 0; i < 6; ++i) A[i] += dA[i];
      momentum(body_[j], A, wrench), momentum(body_[j], dV.data(), h);
      wrench_cross(V_[j].data(), h, rotated), wrench_cross(dV.data(), h_[j].data(), h);
      for (int i = 0; i < 6; ++i) wrench[i] += rotated[i] + h[i];
    }
    double* out = &P[d->parameter * n_];
    subtract_subtree_wrenches(joint, out);
    wrench_cross(xi, F_[joint].data(), W);
    for (int i = 0; i < 6; ++i) W[i] += W_[joint][i];
    subtract_wrench(parent, W, out);
  }
}

double ParameterPartials::wrench_change(const Pair& pair, const WrenchPartials& t, const MovedFrame& frame,
                                        const double* xi, double* dF, double* subtree_dF) const {
  const int a = pair.a.joint, b = pair.b.joint;
  const ModelComponent& x = components_[frame.component];
  double V[6], rotated[6], power = 0;
  for (int i = 0; i < 6; ++i) V[i] = V_[b][i] - V_[a][i];
  times6(frame.second ? t.Db : t.Da, xi, dF);
  std::fill(rotated, rotated + 6, 0.0);
  if (x.kind == ModelComponent::placement) {
    const int end = frame.second ? b : a, parent = s_.tree.parents[x.id];
    const double sign = frame.second ? 1 : -1;
    double Y[6];
    for (int i = 0; i < 6; ++i) Y[i] = V_[end][i] - V_[parent][i];
    if (t.damped) {
      double dV[6], dF_damping[6];
      motion_cross(xi, Y, dV), times6(t.C, dV, dF_damping);
      for (int i = 0; i < 6; ++i) dF[i] += sign * dF_damping[i];
    }
    wrench_cross(xi, t.F, rotated);
    power = -sign * dot6(Y, rotated);
  }
  for (int i = 0; i < 6; ++i) subtree_dF[i] = dF[i] - rotated[i];
  return power + dot6(V, dF);
}

void ParameterPartials::pair_columns(const LawWrench& w, Vector& P) const {
  const Pair& pair = *w.pair;
  const double* J = s_.tree.J();
  for (const MovedFrame& frame : moved_frames_.at(&pair)) {
    const ModelComponent& x = components_[frame.component];
    for (const Direction* d : directions_of_[frame.component]) {
      double xi[6], dF[6], subtree_dF[6];
      world_poses_[frame.component].to_world(d->x.data(), xi);
      const double power = wrench_change(pair, w.partials, frame, xi, dF, subtree_dF);
      double* out = &P[d->parameter * n_];
      if (!w.conservative) out[n_ - 1] += power;
      for (size_t k = 0; k < pair.columns.size(); ++k) {
        const int c = pair.columns[k];
        if (pair.sign[k] == 0) continue;
        const bool subtree = x.kind == ModelComponent::placement && has_ancestor_[joint_of_[c]][x.id];
        out[c] += pair.sign[k] * dot6(J + 6 * c, subtree ? subtree_dF : dF);
      }
    }
  }
}

void ParameterPartials::row_columns(const LinearizationPoint::ConstraintPoint& constrained, const Pair& pair, size_t r,
                                    Vector& Q) const {
  for (const MovedFrame& frame : moved_frames_.at(&pair))
    for (const Direction* d : directions_of_[frame.component]) {
      double xi[6], dF[6], subtree_dF[6];
      world_poses_[frame.component].to_world(d->x.data(), xi);
      for (const auto& [position, t] : requested_)
        Q[d->parameter * r + position] +=
            constrained.weight * (constrained.kind == LinearizationPoint::ConstraintPoint::g
                                      ? (frame.second ? 1 : -1) * dot6(t->F, xi)
                                      : wrench_change(pair, *t, frame, xi, dF, subtree_dF));
    }
}

}  // namespace mbdae
