// The sweep of tree_sweep.hpp for a tree whose bodies move in parallel planes: two coordinates and an angle per body.
#pragma once

#include <memory>
#include <vector>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

// The sweep of joints that rotate about one direction and translate perpendicular to it, where `tolerance` is that of
// the axes; null for other joints. `Sweep::refresh` reads the data of the model.
std::unique_ptr<Sweep> planar_sweep(const std::vector<TreeJoint>& joints,
                                    const InertiaPattern& pattern, const double* gravity,
                                    const double* armature, double tolerance);

}  // namespace mbdae
