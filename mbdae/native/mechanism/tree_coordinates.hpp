// Coordinates of joints with fixed axes: q (+) x and q1 (-) q0, joint by joint, neutral configuration, normalization.
#pragma once

#include <vector>

#include "mechanism/tree_sweep.hpp"

namespace mbdae {

using TreeJoints = std::vector<TreeJoint>;

void integrate(const TreeJoints& joints, const double* q, const double* x, double* out);  // q (+) x; out may be q
void difference(const TreeJoints& joints, const double* q0, const double* q1, double* out);  // q1 (-) q0
void neutral(const TreeJoints& joints, double* q);
void normalize(const TreeJoints& joints, double* q);
void tangent_map(const TreeJoints& joints, const double* q, const double* v, double* dq);  // dq/dt of raw coordinates

}  // namespace mbdae
