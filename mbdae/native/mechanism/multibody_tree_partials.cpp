// Partial derivatives of the inverse dynamics with respect to positions and velocities.
#include <algorithm>

#include "mechanism/multibody_tree_workspace.hpp"

namespace mbdae {

void MultibodyTree::expand(const void* model) {
  const TreeModel tree = tree_model(model);
  std::vector<int> parent_joints;
  std::vector<std::vector<int>> dofs(tree.joints.size() - 1);
  expanded_joints.resize(nv);
  for (size_t j = 1; j < tree.joints.size(); ++j) {
    const TreeModel::Joint& x = tree.joints[j];
    parent_joints.push_back(x.parent - 1);
    for (int i = 0; i < x.nv; ++i) dofs[j - 1].push_back(x.iv + i), expanded_joints[x.iv + i] = static_cast<int>(j);
  }
  w->partials.reset(new RneaPartials(std::move(parent_joints), std::move(dofs)));
}

bool MultibodyTree::has_partial_terms(const double* q, const double* v) const {
  const auto& terms = w->terms;
  return !terms.q.empty() && std::equal(q, q + nq, terms.q.data()) && std::equal(v, v + nv, terms.v.data());
}

void MultibodyTree::inertia(const double* q, const double* v) {
  auto& terms = w->terms;
  poses(q);
  // About the mean position of the bodies, to avoid cancellation far from the world's origin.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  int bodies = joints - 1;
  for (const FlexibleBody& x : w->flexible) bodies -= x.data.modes;  // joints of modes have no poses: zero
  for (int j = 1; j < joints; ++j) centroid += w->position(j) / std::max(bodies, 1);
  for (int j = 1; j < joints; ++j) {
    Body body_about_centroid = body(j);
    for (int i = 0; i < 3; ++i) body_about_centroid.centre[i] -= centroid[i];
    w->partials->set(expanded_joints[w->model.joints[j].iv + w->model.joints[j].nv - 1] - 1, body_about_centroid);
  }
  terms.J = terms.J_centroid = w->J, terms.poses = w->poses;
  for (int k = 0; k < nv; ++k) add_cross(&terms.J[6 * k + 3], centroid.data(), &terms.J_centroid[6 * k]);
  terms.q.assign(q, q + nq), terms.v.assign(v, v + nv), terms.dense.resize(static_cast<size_t>(nv) * nv);
  w->partials->begin(terms.J_centroid.data(), w->model.gravity, v, terms.dense.data(), w->nle.data());
  if (w->flexible.empty()) {
    set_M(terms.dense.data());
    for (int k = 0; k < nv; ++k) w->M[pattern.starts[k]] += w->model.armature[k];
  } else {
    w->sweep->dynamics(q, v, w->poses.data(), w->J.data(), w->M.data(), w->nle.data());
  }
  terms.M = w->M;
}

const double* MultibodyTree::bias() const { return w->nle.data(); }

void MultibodyTree::partials(const double* q, const double* v, const double* a, double* dtau_dq, double* dtau_dv,
                             bool inertia_only) {
  ++pose_stamp_;
  if (has_partial_terms(q, v) && w->flexible.empty())
    w->M = w->terms.M, w->J = w->terms.J, w->poses = w->terms.poses;
  else
    inertia(q, v);
  w->partials->complete(a, dtau_dq, dtau_dv, inertia_only);
  if (!w->flexible.empty()) w->sweep->add_partials(expanded_joints.data(), q, v, a, inertia_only, dtau_dq, dtau_dv);
}

}  // namespace mbdae
