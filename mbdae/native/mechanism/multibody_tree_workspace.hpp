// Workspace of a multibody tree: its model, poses, Jacobian, mass matrix and bias.
#pragma once

#include "math/eigen_types.hpp"
#include "mechanism/multibody_tree.hpp"
#include "mechanism/planar_sweep.hpp"
#include "mechanism/tree_model.hpp"
#include "mechanism/tree_sweep.hpp"

namespace mbdae {

using Matrix3 = Eigen::Map<const Eigen::Matrix3d>;
using Vector3 = Eigen::Map<const Eigen::Vector3d>;

struct MultibodyTree::Workspace {
  Workspace(const void* source_, TreeModel m, std::vector<FlexibleBody> flexible_)
      : source(source_), model(std::move(m)), flexible(std::move(flexible_)) {
    size_t frames = model.joints.size(), columns = model.nv;
    for (const FlexibleBody& x : flexible) {
      const size_t nodes = x.data.nodes.size();
      frames += nodes, columns += nodes * x.data.modes;
    }
    for (size_t i = 0; i < frames; ++i)
      for (int k = 0; k < 12; ++k) poses.push_back(k == 0 || k == 4 || k == 8 ? 1 : 0);
    saved_poses = poses, J.assign(6 * columns, 0.0);
    nle.assign(model.nv, 0.0);
    zero = nle;
  }

  Matrix3 rotation(int j) const { return Matrix3(&poses[12 * j]); }
  Vector3 position(int j) const { return Vector3(&poses[12 * j + 9]); }

  const void* source;
  const TreeModel model;
  std::vector<FlexibleBody> flexible;
  std::unique_ptr<Sweep> sweep;
  std::unique_ptr<TreeAlgorithms> fallback;  // if no sweep supports the joints
  Vector poses, saved_poses;              // (frames, 12) R by columns, and p
  Vector J, M, nle, zero;                 // (6, nv and nodes), see `MultibodyTree::M`, (nv,), (nv,)
  struct PartialTerms {                   // terms at (q, v) that do not depend on the acceleration
    Vector q, v, J, J_centroid, M, poses;  // J about the world's origin, and about the reference point of the partials
    Vector dense;                          // (nv, nv) M
  } terms;
  std::unique_ptr<RneaPartials> partials;
};

}  // namespace mbdae
