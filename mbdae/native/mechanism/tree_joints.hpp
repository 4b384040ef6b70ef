// Joints of a Pinocchio model for the sweep through its tree.
#pragma once

#include <pinocchio/multibody/fwd.hpp>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

// All joints, the world first; empty if the sweep does not support one of them. They point into the model.
std::vector<TreeJoint> tree_joints(const pinocchio::Model& model);

}  // namespace mbdae
