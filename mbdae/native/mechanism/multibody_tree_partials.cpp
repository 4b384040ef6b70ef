// Partial derivatives of the inverse dynamics by positions and velocities.
#include <algorithm>

#include "mechanism/multibody_tree_workspace.hpp"

namespace mbdae {

void MultibodyTree::expand(const void* model) {
  const TreeModel tree = tree_model(model);
  std::vector<int> before;
  std::vector<std::vector<int>> own(tree.joints.size() - 1);
  expanded_joints.resize(nv);
  for (size_t j = 1; j < tree.joints.size(); ++j) {
    const TreeModel::Joint& x = tree.joints[j];
    before.push_back(x.parent - 1);
    for (int i = 0; i < x.nv; ++i) own[j - 1].push_back(x.iv + i), expanded_joints[x.iv + i] = static_cast<int>(j);
  }
  w->partials.reset(new RneaPartials(std::move(before), std::move(own)));
}

bool MultibodyTree::has_partial_terms(const double* q, const double* v) const {
  const auto& terms = w->terms;
  return !terms.q.empty() && std::equal(q, q + nq, terms.q.data()) && std::equal(v, v + nv, terms.v.data());
}

void MultibodyTree::inertia(const double* q, const double* v) {
  auto& terms = w->terms;
  poses(q);
  // About a point among the bodies: far from the world's origin, digits would cancel.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  int bodies = joints - 1;
  for (const FlexibleBody& x : w->flexible) bodies -= x.data.modes;  // joints of modes have no poses: zero
  for (int j = 1; j < joints; ++j) centroid += w->position(j) / std::max(bodies, 1);
  for (int j = 1; j < joints; ++j) {
    Body here = body(j);
    for (int i = 0; i < 3; ++i) here.centre[i] -= centroid[i];
    w->partials->set(expanded_joints[w->model.joints[j].iv + w->model.joints[j].nv - 1] - 1, here);
  }
  terms.J = terms.about = w->J, terms.poses = w->poses;
  for (int k = 0; k < nv; ++k) add_cross(&terms.J[6 * k + 3], centroid.data(), &terms.about[6 * k]);
  terms.q.assign(q, q + nq), terms.v.assign(v, v + nv), terms.dense.resize(static_cast<size_t>(nv) * nv);
  w->partials->begin(terms.about.data(), w->model.gravity, v, terms.dense.data(), w->nle.data());
  if (w->flexible.empty()) {
    set_M(terms.dense.data());
    for (int k = 0; k < nv; ++k) w->M[pattern.starts[k]] += w->model.armature[k];
  } else {
    w->sweep->dynamics(q, v, w->poses.data(), w->J.data(), w->M.data(), w->nle.data());
  }
  terms.M = w->M;
}

const double* MultibodyTree::bias() const { return w->nle.data(); }

void MultibodyTree::partials(const double* q, const double* v, const double* a, double* by_q, double* by_v, bool alone) {
  ++pose_stamp_;
  if (has_partial_terms(q, v) && w->flexible.empty())
    w->M = w->terms.M, w->J = w->terms.J, w->poses = w->terms.poses;
  else
    inertia(q, v);
  w->partials->complete(a, by_q, by_v, alone);
  if (!w->flexible.empty())
    w->sweep->add_partials(expanded_joints.data(), q, v, a, alone, by_q, by_v);
}

}  // namespace mbdae
