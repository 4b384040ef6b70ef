// Kinematics and dynamics of a tree of bodies: by a sweep (tree_sweep.hpp), or by other algorithms for joints that the
// sweep does not support (tree_model.hpp).
#pragma once

#include <memory>
#include <vector>

#include "mechanism/rnea_partials.hpp"
#include "mechanism/tree_sweep.hpp"
#include "math/tolerances.hpp"

namespace mbdae {

class MultibodyTree {
 public:
  // model: see `tree_model`; it must outlive this object.
  MultibodyTree(const void* model, const Tolerances& tolerances, std::vector<ModalBody> flexible);
  ~MultibodyTree();

  bool planar() const;  // whether all bodies move in parallel planes, and `planar_sweep` computes them
  // whether flexible bodies have the same joints and numbers of modes and nodes as those of this tree
  bool has_same_structure(const std::vector<ModalBody>& flexible) const;
  // Use another model with the same joints; results of the previous one are discarded.
  void write(const void* model, const Tolerances& tolerances, std::vector<ModalBody> flexible);
  void refresh();  // after changes of the model in place
  double* body_parameter(int joint, int i);  // mass, centre and inertia in the model, see TreeJoint; nullptr: none
  double* gravity_parameter(int i);
  const void* source() const;  // the model of Pinocchio

  Tolerances tolerances;
  int nq, nv, joints, frames;               // frames: joints, then nodes of flexible bodies
  std::vector<std::vector<int>> ancestors;  // ancestors of each degree of freedom, nearest first
  InertiaPattern pattern;
  std::vector<int> tangent;                 // (nq,) the degree of freedom of a joint's first coordinate
  std::vector<int> parents;                 // (joints,)
  std::vector<int> expanded_joints;         // (nv,) joint of each degree of freedom in the expanded tree

  // The degrees of freedom that move a joint or node, and their columns of J.
  struct Support {
    std::vector<int> velocities, columns;
  };
  std::vector<Support> supports() const;
  const FlexibleBody::Node* node(int frame, const FlexibleBody*& body, int& i) const;  // null: a joint

  void inertia(const double* q);                                  // M, J and poses
  void dynamics(const double* q, const double* v);                // M, J, poses, nle and velocities
  void inertia(const double* q, const double* v);                 // M, J and poses; nle and terms of `partials`
  const double* bias() const;                                     // (nv,) nle of the last call
  void poses(const double* q);                                    // J and poses alone
  // for `restore_poses`, before other poses are computed
  void save_poses();
  void restore_poses();
  void motions(const double* q, const double* v);                 // velocities, and accelerations for v' = 0
  void motions(const double* q, const double* v, const double* a);  // velocities, and accelerations for v' = a
  // nle(q, v) and velocities; for `bias_minus_gravity`
  void bias(const double* q, const double* v);
  // out += contribution of flexible bodies to M a + nle under this gravity (3,); updates velocities, J and poses.
  void add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a, const double* gravity,
                  double* out);
  void use_nodes(const std::vector<int>& used);  // compute only those nodes that are in these frames
  std::vector<FlexibleBody> bind(std::vector<ModalBody> bodies) const;
  void inverse(const double* q, const double* v, const double* a, double* out);  // M a + nle(q, v), J and poses

  // model: the expanded tree (mechanism/tree/expanded_tree.py).
  void expand(const void* model);
  bool expanded() const { return !expanded_joints.empty(); }
  // Partials of M a + nle(q, v) with respect to q in the tangent and to v, (nv, nv) by rows; if `inertia_only`, of M a
  // for v = 0. Updates M, J and poses.
  void partials(const double* q, const double* v, const double* a, double* dtau_dq, double* dtau_dv,
                bool inertia_only = false);

  void integrate(const double* q, const double* x, double* out);  // q (+) x
  void difference(const double* q0, const double* q1, double* out);
  void neutral(double* q);
  void normalize(double* q);
  void tangent_map(const double* q, const double* v, double* dq);  // dq/dt of raw coordinates

  double potential() const;                 // potential energy of gravity in J, at the current poses
  const double* M() const;                  // entries of M, see `InertiaPattern`
  void dense_M(double* out) const;          // (nv, nv)
  double kinetic_energy(const double* v) const;                     // in J, of the current M
  void add_inertial_force(const double* a, double* out) const;      // out += M a
  const double* J() const;                  // columns about the world's origin, (6, nv), then those of nodes
  const double* rotation(int joint) const;  // by columns
  const double* position(int joint) const;
  void velocity(int joint, double* out) const;  // spatial, about the world's origin, linear part first
  void acceleration(int joint, double* out) const;
  long motion_stamp() const { return motion_stamp_; }  // changes when velocities or accelerations may change
  long pose_stamp() const { return pose_stamp_; }      // changes when poses may change
  // Bias acceleration (for v' = 0) minus gravity, of the last call of `bias`.
  void bias_minus_gravity(int joint, double* out) const;
  void gravity(double* out) const;                              // (3,)
  // placement of the joint on its parent body, in the world, R by rows
  void placement(int joint, double* R, double* p) const;
  Body body(int joint) const;  // child body of a joint

 private:
  struct Workspace;
  void begin_sweep();
  void set_M(const double* dense);  // from (nv, nv) by columns, above the diagonal
  bool has_partial_terms(const double* q, const double* v) const;  // whether they are current at (q, v)

  std::unique_ptr<Workspace> w;
  long motion_stamp_ = 0, pose_stamp_ = 0;
};

}  // namespace mbdae
