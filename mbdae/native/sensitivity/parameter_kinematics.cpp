// Poses, velocities and accelerations at a point that the partials with respect to parameters require.
#include "sensitivity/parameter_partials.hpp"

namespace mbdae {

// The axes of a joint are fixed in its parent body: J' v of a joint is V of its parent x J v.
template <bool accelerated>
void ParameterPartials::update_motions(const double* v, const double* a) {
  const MultibodyTree& m = s_.tree;
  const double* J = m.J();
  for (int j : moving_joints_) {
    const std::vector<int>& dofs = columns_[j];
    V_[j] = V_[m.parents[j]];
    if (accelerated) A_[j] = A_[m.parents[j]];
    for (size_t first = 0, end; first < dofs.size(); first = end) {
      double W[6] = {}, rotated[6];
      for (end = first; end < dofs.size() && m.expanded_joints[dofs[end]] == m.expanded_joints[dofs[first]]; ++end) {
        const int c = dofs[end];
        for (int i = 0; i < 6; ++i) W[i] += J[6 * c + i] * v[c];
        for (int i = 0; accelerated && i < 6; ++i) A_[j][i] += J[6 * c + i] * a[c];
      }
      if (accelerated) {
        motion_cross(V_[j].data(), W, rotated);
        for (int i = 0; i < 6; ++i) A_[j][i] += rotated[i];
      }
      for (int i = 0; i < 6; ++i) V_[j][i] += W[i];
    }
  }
}

template void ParameterPartials::update_motions<true>(const double*, const double*);
template void ParameterPartials::update_motions<false>(const double*, const double*);

void ParameterPartials::update_momenta() {
  const std::vector<int>& parents = s_.tree.parents;
  for (int j : inertial_joints_) F_[parents[j]] = Six{};
  for (int j : inertial_joints_) {
    double rotated[6];
    momentum(body_[j], A_[j].data(), F_[j].data()), momentum(body_[j], V_[j].data(), h_[j].data());
    wrench_cross(V_[j].data(), h_[j].data(), rotated);
    for (int i = 0; i < 6; ++i) F_[j][i] += rotated[i];
  }
  for (size_t l = inertial_joints_.size(); l-- > 0;)
    for (int i = 0; i < 6; ++i) F_[parents[inertial_joints_[l]]][i] += F_[inertial_joints_[l]][i];
}

void ParameterPartials::update_world_poses() {
  static const Anchor origin;
  const MultibodyTree& m = s_.tree;
  for (size_t i = 0; i < components_.size(); ++i) {
    const ModelComponent& x = components_[i];
    WorldPose& out = world_poses_[i];
    if (x.kind == ModelComponent::placement) m.placement(x.id, out.R, out.p);
    if (x.kind != ModelComponent::frame && x.kind != ModelComponent::inertia) continue;
    const Anchor* a = &origin;
    if (x.kind == ModelComponent::frame) {
      const Pair& pair = x.of_law ? s_.law_pairs()[x.id] : s_.constraints.pairs[x.id];
      a = x.second ? &pair.b : &pair.a;
    }
    const int joint = x.kind == ModelComponent::frame ? a->joint : x.id;
    const double *o = m.rotation(joint), *origin_of_joint = m.position(joint);  // o by columns
    for (int k = 0; k < 3; ++k) {
      out.p[k] = o[k] * a->p[0] + o[3 + k] * a->p[1] + o[6 + k] * a->p[2] + origin_of_joint[k];
      for (int l = 0; l < 3; ++l) out.R[3 * k + l] = o[k] * a->R[l] + o[3 + k] * a->R[3 + l] + o[6 + k] * a->R[6 + l];
    }
  }
}

}  // namespace mbdae
