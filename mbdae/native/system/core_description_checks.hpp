// Checks of the description of a mechanism for the core: indices, and sizes of arrays.
#pragma once

#include "system/index2.hpp"

namespace mbdae {

using Anchors = std::vector<std::pair<Anchor, Anchor>>;
void check_indices(const std::vector<int>& x, int n, const char* name);
void check_anchors(const Anchors& pairs, int joints);
void check_rows(const std::vector<Row>& rows, size_t pairs);
void check_row_joints(const Row& row, const Sizes& n);
void check_laws(const std::vector<Law>& laws, size_t pairs);
void check_bodies(const std::vector<ModalBody>& bodies, int nq, int nv, int joints);
void check_drivers(const std::vector<Driver>& drivers, size_t rows);
void check(const Description& d, const Sizes& n, const Tolerances& tolerances);

// Check friction interfaces of these rows, and set their frame pairs.
void check_and_complete_interfaces(std::vector<FrictionInterface>& interfaces, const std::vector<Row>& rows);

}  // namespace mbdae
