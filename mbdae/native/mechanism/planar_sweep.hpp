// Poses, joint Jacobian, mass matrix and bias of a tree whose bodies move in parallel planes, as in tree_sweep.hpp: two
// coordinates and an angle for each body.
#pragma once

#include <memory>
#include <vector>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

// For joints that rotate about one direction and translate across it, to this tolerance of their axes; otherwise null.
// The numbers of the model are read by `Sweep::refresh`.
std::unique_ptr<Sweep> planar_sweep(const std::vector<TreeJoint>& joints,
                                    const InertiaPattern& pattern, const double* gravity,
                                    const double* armature, double tolerance);

}  // namespace mbdae
