// Joints of a Pinocchio model for the sweep through its tree.
#pragma once

#include <pinocchio/multibody/fwd.hpp>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

// All joints, that of the world first; empty where the sweep does not know one of them. They point into the model.
std::vector<TreeJoint> tree_joints(const pinocchio::Model& model);

}  // namespace mbdae
