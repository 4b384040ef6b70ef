// A flexible body in the sweep through the tree: its terms of M and nle, poses and motions of its nodes, and exact
// partials of its forces (mbdae/mechanism/flexible/workspace.py, partials.py).
#pragma once

#include <array>
#include <vector>

#include "math/spatial.hpp"
#include "mechanism/modal_body.hpp"

namespace mbdae {

// The frame of a body: its pose, R by columns and p, and the vector from the root's position to p. Columns of J,
// motions and wrenches are about the root's position.
struct FramePose {
  double pose[12], arm[3];

  void from_motion(const double* V, double* out) const;  // into the axes of the frame, about its origin
  void to_motion(const double* V, double* out) const;    // back
  void to_wrench(const double* F, double* out) const;
};

class FlexibleBody {
 public:
  // base: the degrees of freedom that move the frame, outward; the nodes follow `first_pose` entries of poses, their
  // columns `first_column` columns of J.
  FlexibleBody(ModalBody data, std::vector<int> base, int first_pose, int first_column);

  const ModalBody data;
  const std::vector<int> base;
  const int first_pose, first_column;

  // Rotation by theta = Psi q, by rows, with the functions a, b, a1, b1; position d and Phi = dd/dq.
  struct Node {
    double theta[3], functions[4], E[9], Jr[9], d[3];
    Vector Phi;
    bool curved = false;  // are there displacements of second order?
  };
  const Node& node(int i) const { return nodes_[i]; }

  // Only nodes in use have poses, columns and motions: those of pairs of frames.
  void use(const std::vector<bool>& nodes);
  const std::vector<int>& used() const { return used_; }

  // At the pose of the joint and the vector from the root's position to it: what follows is at the last one.
  void set_pose(const double* joint_pose, const double* arm);
  void deform(const double* q);      // for the terms of M and nle; at the last q nothing is to be done
  void turn_nodes(const double* q);  // the same
  void place_nodes(double* poses, double* J) const;
  // Motions of a node about the root's position, from those of the frame; u, du (k,) of the modes, du may be null.
  void move_node(int number, const double* V, const double* A, const double* u, const double* du, double* V_node,
                 double* A_node) const;
  // Entries of M, whose columns begin at `starts`: adds to those of the frame, and sets those of the modes.
  void add_inertia(const Six* about, const std::vector<size_t>& starts, double* M) const;
  // out += the part of M a + nle; A of the frame minus gravity.
  void add_force(const Six* about, const double* V, const double* A, const double* u, const double* du,
                 double* out) const;
  // A vector in the axes of the frame, in those of the world, from the rotation of its joint.
  void rotate_to_world(const double* joint_rotation, const double* x, double* out) const;
  // That the deformation adds, after `deform`.
  double potential(const double* joint_rotation, const double* gravity) const;
  // Partials of these forces with respect to q in the tangent and to v, added to by_q and by_v (nv, nv) by rows;
  // expanded_joints (nv,): joint of each degree of freedom in the expanded tree; base_acceleration: -gravity, or 0.
  void add_partials(const Six* about, const int* expanded_joints, const double* q, const double* v,
                    const double* a, const Six& base_acceleration, double* by_q, double* by_v, size_t nv) const;

 private:
  std::vector<Node> nodes_;
  FramePose at_;
  std::vector<int> used_;
  Vector deformed_at_, turned_at_;  // (k,)
  Deformation<double> now_;
  mutable std::vector<double> nu_, F_;
  mutable std::vector<Six> columns_;  // (base,) in the axes of the frame
};

// d(Jr z)/dtheta times x, for constant z.
void rotation_jacobian_rate(const FlexibleBody::Node& n, const double* z, const double* x, double* out);

}  // namespace mbdae
