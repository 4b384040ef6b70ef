// Validation of rows, laws, friction interfaces and flexible bodies before the core is built.
#include "system/core_description_checks.hpp"

#include <algorithm>
#include <cmath>

#include "math/field_reader.hpp"

namespace mbdae {

void check_indices(const std::vector<int>& x, int n, const char* name) {
  for (int i : x)
    if (i < 0 || i >= n) reject(std::string(name) + " out of range");
}

void check_anchors(const Anchors& pairs, int joints) {
  for (const auto& [a, b] : pairs) check_indices({a.joint, b.joint}, joints, "joint of a frame");
}

void check_rows(const std::vector<Row>& rows, size_t pairs) {
  for (const Row& row : rows)
    if (!row.between_joints()) check_indices({row.pair}, static_cast<int>(pairs), "pair");
}

void check_row_joints(const Row& row, const Sizes& sizes) {
  const size_t n = row.joints.size();
  const size_t max_joints = row.kind == Row::sum ? n : row.kind == Row::ratio ? 3 : 2;
  const size_t min_joints =
      row.kind == Row::function ? 0 : row.kind == Row::coordinate || row.kind == Row::ratio ? 1 : 2;
  if (n < min_joints || n > max_joints) reject("a row of this kind cannot have " + std::to_string(n) + " joints");
  for (const RowJoint& j : row.joints) {
    if (j.nq != 1 && j.nq != 2) reject("a joint of a row must have one coordinate or two");
    check_indices({j.iq}, sizes.nq - j.nq + 1, "coordinate"), check_indices({j.iv}, sizes.nv, "velocity");
  }
  if (row.kind == Row::sum && row.c.size() != n) reject("a sum must have a coefficient for each joint");
  if (row.kind == Row::curved && row.law.kind == TimeFunction::python)
    reject("the function of a curved row must consist of polynomials or be harmonic");
}

void check_and_complete_interfaces(std::vector<FrictionInterface>& interfaces, const std::vector<Row>& rows) {
  const int ng = static_cast<int>(rows.size());
  for (FrictionInterface& x : interfaces) {
    const bool rolling = x.kind == FrictionInterface::rolling;
    if (rolling == x.no_slip_rows.empty() || x.no_slip_rows.size() > 2)
      reject("a rolling interface must have one or two no-slip rows, any other none");
    if (!(x.width > 0)) reject("the velocity width of regularized friction must be positive");
    if (!(x.coefficient >= 0) || !std::isfinite(x.coefficient))
      reject("a friction coefficient must be finite and not negative");
    if (x.components < 1 || x.components > 3)
      reject("the force of a friction interface must have one to three components");
    check_indices({x.row}, ng - x.components + 1, "row"), check_indices(x.no_slip_rows, ng, "row");
    x.pair = rows[x.row].pair;
    if (x.pair < 0) reject("the rows of a friction interface must be between two frames");
    for (int k : x.no_slip_rows)
      if (rows[k].pair != x.pair) reject("no-slip rows must be between the frames of the normal force");
  }
}

void check_laws(const std::vector<Law>& laws, size_t pairs) {
  for (const Law& law : laws)
    if (law.pair != -1) check_indices({law.pair}, static_cast<int>(pairs), "pair");
}

void check_drivers(const std::vector<Driver>& drivers, size_t rows) {
  for (const Driver& driver : drivers) check_indices({driver.row}, static_cast<int>(rows), "row");
}

static void check_body(const ModalBody& b, int nq, int nv, int joints) {
  check_indices({b.joint}, joints, "joint of a flexible body");
  if (b.modes < 1 || b.modes > nv) reject("modes out of range");
  check_indices({b.iq}, nq - b.modes + 1, "mode"), check_indices({b.iv}, nv - b.modes + 1, "mode");
  const size_t k = b.modes;
  bool valid = b.C.size() == 3 * k && b.C2.size() == 3 * k * k && b.H0.size() == 3 * k && b.Mq.size() == k * k && b.Hj.size() == 3 * k * k &&
               b.I1.size() == 6 * k && b.I2.size() == 6 * k * k;
  const size_t cube = b.Mq1.size();
  valid = valid && (cube == 0 || cube == k * k * k) && b.H2.size() == 3 * cube && b.Mq2.size() == k * cube;
  for (const ModalNode& x : b.nodes) valid = valid && x.Phi.size() == 3 * k && x.Psi.size() == 3 * k && x.Phi2.size() == 3 * k * k;
  if (!valid) reject("the data of a flexible body do not match its modes");
}

void check_bodies(const std::vector<ModalBody>& bodies, int nq, int nv, int joints) {
  for (const ModalBody& body : bodies) check_body(body, nq, nv, joints);
}

void check(const Description& d, const Sizes& n, const Tolerances& tolerances) {
  if (static_cast<int>(d.angular.size()) != n.nv || d.probe.size() != d.angular.size())
    reject("angular and probe must have an entry for each velocity");
  if (d.flat && n.nq != n.nv) reject("a flat manifold must have nq = nv");
  if (tolerances.row_scales.size() != d.rows.size() || static_cast<int>(tolerances.q_scales.size()) != n.nq ||
      static_cast<int>(tolerances.coordinate_scales.size()) != n.nv)
    reject("scales must be as many as rows, coordinates and velocities");
  if (!std::isfinite(d.alpha) || !std::isfinite(d.beta)) reject("alpha and beta must be finite");
  std::vector<int> order(d.order);
  std::sort(order.begin(), order.end());
  for (size_t i = 0; i < order.size(); ++i)
    if (order[i] != static_cast<int>(i)) reject("the order of elimination must be a permutation of 0, 1, ...");
  if (order.size() != d.rows.size()) reject("the order of elimination must have a position for each row");
  size_t frames = n.joints;
  check_bodies(d.flexible, n.nq, n.nv, n.joints);
  for (const ModalBody& body : d.flexible) frames += body.nodes.size();
  check_anchors(d.pairs, static_cast<int>(frames)), check_anchors(d.law_pairs, static_cast<int>(frames));
  check_rows(d.rows, d.pairs.size()), check_laws(d.laws, d.law_pairs.size());
  check_drivers(d.drivers, d.rows.size());
  for (const GroupJoint& b : d.group_joints) {
    const int size = b.kind == GroupJoint::se3 ? 6 : 3;
    check_indices({b.iv}, n.nv - size + 1, "group_joints"), check_indices({b.iq}, n.nq - size, "group_joints");
  }
}

}  // namespace mbdae
