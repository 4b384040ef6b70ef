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

  void from_motion(const double* V, double* out) const;  // to the axes of the frame, about its origin
  void to_motion(const double* V, double* out) const;    // from the axes of the frame
  void to_wrench(const double* F, double* out) const;
};

class FlexibleBody {
 public:
  // base: the degrees of freedom that move the frame, from the root outward; first_pose, first_column: first pose and
  // column of J of the nodes.
  FlexibleBody(ModalBody data, std::vector<int> base, int first_pose, int first_column);

  const ModalBody data;
  const std::vector<int> base;
  const int first_pose, first_column;

  // Rotation E by theta = Psi q, by rows, with the series a, b, a1, b1; position d and Phi = dd/dq.
  struct Node {
    double theta[3], functions[4], E[9], Jr[9], d[3];
    Vector Phi;
    bool curved = false;  // has displacements of second order
  };
  const Node& node(int i) const { return nodes_[i]; }

  // Only nodes in use have poses, columns and motions: those of pairs of frames.
  void use(const std::vector<bool>& nodes);
  const std::vector<int>& used() const { return used_; }

  // Set the frame from the pose of its joint and the vector from the root's position to the joint; see `FramePose`.
  void set_pose(const double* joint_pose, const double* arm);
  void deform(const double* q);        // update the terms of M and nle, unless q is unchanged
  void update_nodes(const double* q);  // update rotations and positions of nodes, unless q is unchanged
  void write_node_poses(double* poses, double* J) const;
  // Velocity and acceleration of a node about the root's position, from those of the frame; u, du (k,) modal velocities
  // and accelerations, du may be null.
  void node_motion(int number, const double* V, const double* A, const double* u, const double* du, double* V_node,
                   double* A_node) const;
  // Add to the entries of M of the frame, and set those of the modes; `starts`: first entries of the columns of M.
  void add_inertia(const Six* J_root, const std::vector<size_t>& starts, double* M) const;
  // out += contribution to M a + nle; A: acceleration of the frame minus gravity.
  void add_force(const Six* J_root, const double* V, const double* A, const double* u, const double* du,
                 double* out) const;
  // Rotate a vector from the axes of the frame to those of the world.
  void rotate_to_world(const double* joint_rotation, const double* x, double* out) const;
  // Gravitational potential energy due to the deformation, in J; requires `deform`.
  double potential(const double* joint_rotation, const double* gravity) const;
  // Add the partials of these forces with respect to q in the tangent and to v, to dtau_dq and dtau_dv (nv, nv) by
  // rows; expanded_joints (nv,): joint of each degree of freedom in the expanded tree; base_acceleration: -gravity, or
  // 0.
  void add_partials(const Six* J_root, const int* expanded_joints, const double* q, const double* v, const double* a,
                    const Six& base_acceleration, double* dtau_dq, double* dtau_dv, size_t nv) const;

 private:
  std::vector<Node> nodes_;
  FramePose frame_;
  std::vector<int> used_;
  Vector deformation_q_, nodes_q_;  // (k,)
  Deformation<double> deformation_;
  mutable std::vector<double> nu_, F_;
  mutable std::vector<Six> columns_;  // (base,) in the axes of the frame
};

// d(Jr z)/dtheta times x, for constant z.
void rotation_jacobian_rate(const FlexibleBody::Node& n, const double* z, const double* x, double* out);

}  // namespace mbdae
