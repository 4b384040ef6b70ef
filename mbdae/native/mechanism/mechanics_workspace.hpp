// What Mechanics keeps of Pinocchio, for the files that call it.
#pragma once

#include <memory>

#include <pinocchio/multibody.hpp>

#include "mechanism/mechanics.hpp"
#include "mechanism/tree_sweep.hpp"

namespace mbdae {

using Eigen::VectorXd;
using Vector = Eigen::Ref<const VectorXd>;  // the type for which the library compiles its algorithms
using In = Eigen::Map<const VectorXd>;
using Out = Eigen::Map<VectorXd>;

struct Mechanics::Workspace {
  Workspace(const pinocchio::Model& m, std::vector<FlexibleBody> flexible);

  // R by columns and p of each joint
  double* poses() {
    static_assert(sizeof(pinocchio::SE3) == 12 * sizeof(double));
    return data.oMi[0].rotation().data();
  }
  double* J() { return data.J.data(); }

  const pinocchio::Model& model;
  std::vector<FlexibleBody> flexible;
  std::unique_ptr<TreeSweep> sweep;
  pinocchio::Data data;
  decltype(data.oMi) saved_poses;
  VectorXd q, v, a, rate, end;  // a stays 0
  struct Begun {  // partials at (q, v): terms known so far
    VectorXd q, v;
    pinocchio::Data::Matrix6x J, about;  // about the world's origin, and about the reference point of the partials
    Eigen::MatrixXd M;
    decltype(pinocchio::Data::oMi) oMi;
  } begun;
  VectorXd nle;
  std::unique_ptr<RneaPartials> partials;
};

}  // namespace mbdae
