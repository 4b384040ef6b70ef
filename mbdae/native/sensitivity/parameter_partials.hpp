// Partials of a stage with respect to parameters of a mechanism
// (mbdae/mechanism/discrete_sensitivity/parameter_partials.py). A parameter is a direction in model components, or a
// perturbation of laws, rows and flexible bodies.
#pragma once

#include <map>
#include <memory>

#include "system/index2.hpp"
#include "sensitivity/world_pose.hpp"
#include "sensitivity/stage_sensitivity.hpp"

namespace mbdae {

// A component of a model that parameters may change.
struct ModelComponent {
  NAMED_ENUM(enum, Kind, inertia, placement, frame, gravity, armature)
  Kind kind;
  int id = 0;           // joint of the body or of the placement, or index of a pair
  bool of_law = false;  // the pair belongs to a law
  bool second = false;  // the second frame of the pair

  FIELDS(kind, id, of_law, second)
};

// Number of entries: mass, first moment and inertia; gravity; armatures; a motion.
inline int size_of(ModelComponent::Kind kind, int nv) {
  return kind == ModelComponent::inertia    ? 1 + 3 + 6
         : kind == ModelComponent::gravity  ? 3
         : kind == ModelComponent::armature ? nv
                                            : 6;
}

struct Direction {  // direction of a parameter in a model component
  int parameter, component;
  Vector x;

  FIELDS(parameter, component, x)
};

// Laws or rows perturbed by a parameter, with their weight in a finite difference.
struct PerturbedLaws {
  PerturbedLaws(double weight, std::vector<Pair> pairs, std::vector<Law> laws);
  double weight;
  std::vector<Pair> pairs;
  std::vector<Law> laws;
};

struct PerturbedRows {
  double weight;
  std::unique_ptr<Constraints> rows;
};

struct ChangedElement {
  int parameter;
  std::vector<int> indices;  // indices of the states of laws, or of rows
  std::vector<PerturbedLaws> laws;
  std::vector<PerturbedRows> rows;
  std::vector<FlexibleBody> bodies;  // whose data are rates of the parameters
  Vector gravity;                    // rate of gravity, which acts on bodies with their actual data; empty: none
};

class ParameterPartials {
 public:
  ParameterPartials(Index2System& system, int count, std::vector<ModelComponent> components,
                    std::vector<Direction> directions, std::vector<ChangedElement> changed);

  size_t count() const { return count_; }
  bool frames_move() const { return frames_move_; }  // placements or frames depend on parameters

  // Partials of friction that depends on multipliers, computed in Python at (q, v, lam): K (n, nv), D (n, n), P (k, n).
  using Friction = std::function<void(const Vector& q, const Vector& v, const Vector& lam, Vector& K, Vector& D,
                                      Vector& P)>;
  Friction friction;

  // Gradients of costs, as sums over points.
  void begin_gradient(size_t costs);
  // Add P^T cotangent + Q^T nu, for cotangent (costs, n) and nu (costs, r).
  void add_point(const LinearizationPoint& point, const Vector& cotangent, const Vector& nu);
  void add_columns(const Vector& P, const Vector& cotangent);  // P (k, n)
  void end_gradient(double* p);                                // add the gradients to p (costs, k)
  // P (k, n); requires current J and poses
  void forces(const LinearizationPoint& point, Vector& P);
  // Q (k, r); requires J and poses at q
  void rows(const LinearizationPoint& point, Vector& Q, const Vector& q);

 private:
  struct MovedFrame {  // components that move only one frame of a pair
    int component;
    bool second;  // whether it is the second frame
  };
  struct RequestedRow {  // a row of a pair
    int position;        // among the rows in use
    const WrenchPartials* partials;
  };

  void update_poses(const LinearizationPoint& point);    // J and poses, if required
  void evaluate_terms(const LinearizationPoint& point);  // all other terms, and changed_P_, at the current poses
  void evaluate_changed(const LinearizationPoint& point);                         // changed_P_
  void add_changed_rows(const LinearizationPoint::ConstraintPoint& constrained);  // add to changed_Q_
  template <bool accelerated>
  void update_motions(const double* v, const double* a);  // V_, and A_
  void update_momenta();                                  // F_ and h_
  void update_world_poses();
  // Update changed_Q_ at each constraint point, set requested_ for each pair that placements and frames move, and call
  // each(constrained, pair); poses must be current at q.
  template <class F>
  void for_constraint_points(const LinearizationPoint& point, const Vector& q, const F& each);

  void contract(const LinearizationPoint& point, const double* cotangent, std::vector<Vector>& sums);
  void update_virtual_velocities(const double* v);  // U_
  void update_virtual_momenta();                    // H_ and C_
  // Add the partials of F . (X_b - X_a) with respect to motions of placements and frames; uses V_ if the wrench is
  // damped.
  void add_wrench_gradient(const Pair& pair, const WrenchPartials& t, const std::vector<Six>& X,
                           std::vector<Vector>& sums);
  // Add the partials of F . d_b - F . d_a.
  void add_gap_gradient(const Pair& pair, const double* F, std::vector<Vector>& sums);

  void inertia_columns(int component, Vector& P) const;
  void placement_columns(int component, Vector& P);
  void gravity_columns(int component, Vector& P);
  void pair_columns(const LawWrench& w, Vector& P) const;
  void row_columns(const LinearizationPoint::ConstraintPoint& constrained, const Pair& pair, size_t r,
                   Vector& Q) const;
  // Change of a wrench due to a motion xi of a frame, or of a placement with its subtree: subtree_dF in the subtree, dF
  // outside. Returns the partial of F . (V_b - V_a).
  double wrench_change(const Pair& pair, const WrenchPartials& t, const MovedFrame& frame, const double* xi, double* dF,
                       double* subtree_dF) const;
  void subtract_wrench(int joint, const double* W, double* P) const;  // P -= J^T W, by the columns that move the joint
  void subtract_subtree_wrenches(int joint, double* P);               // P -= J^T W_ of the subtree, by its columns

  Index2System& s_;
  const size_t count_;
  const int n_;  // nv + ns + 1
  const std::vector<ModelComponent> components_;
  const std::vector<Direction> directions_;
  std::vector<ChangedElement> changed_;
  std::map<const Pair*, std::vector<MovedFrame>> moved_frames_;  // moved frames of all pairs
  bool frames_move_ = false, has_placement_ = false, needs_kinematics_ = false, has_changed_rows_ = false;
  bool has_moving_rows_ = false;           // rows depend on placements or frames
  std::vector<std::vector<int>> columns_;  // columns of J of each joint
  std::vector<int> joint_of_;              // (nv,) joint of each column
  // (joints, joints): whether the second joint is the first or its ancestor
  std::vector<std::vector<bool>> has_ancestor_;
  std::vector<std::vector<int>> subtree_;             // the subtree of each joint; of the world: all joints
  std::vector<std::vector<const Direction*>> directions_of_;  // directions in each component
  std::vector<int> moving_joints_, inertial_joints_;          // joints whose motions, and whose bodies are required
  struct Sums {
    std::vector<Vector> components;
    Vector columns, changed;  // (k,) from `add_columns`; of perturbed laws and rows
  };
  std::vector<Sums> sums_;        // gradients of each cost
  Vector changed_P_, changed_Q_;  // P and Q of perturbed laws and rows: (changed, n), (changed, ng)

  // By joint: V velocity, A acceleration minus gravity, U virtual velocity, X = U + power V. Sums over its subtree:
  // F = I A + V x* h, H = I U, C = V x* I U - U x* h - I (V x U), W change of the wrench. Of its body: h = I V.
  std::vector<Six> V_, A_, U_, X_, F_, H_, C_, W_, h_;
  std::vector<Body> body_;
  std::vector<WorldPose> world_poses_;  // poses of all components
  std::vector<RequestedRow> requested_;
  std::vector<WrenchPartials> gaps_;  // (ng,) wrenches of single rows
};

template <class F>
void ParameterPartials::for_constraint_points(const LinearizationPoint& point, const Vector& q, const F& each) {
  changed_Q_.assign(changed_.size() * s_.ng, 0.0);
  if (!has_moving_rows_ && !has_changed_rows_) return;
  MultibodyTree& m = s_.tree;
  const std::vector<int>& position = (point.rows ? *point.rows : s_.rows).position();
  const Vector* current_q = &q;
  for (const LinearizationPoint::ConstraintPoint& constrained : point.constraint_points) {
    if (constrained.q != *current_q) m.poses(constrained.q.data());
    current_q = &constrained.q;
    if (has_changed_rows_) add_changed_rows(constrained);
    if (!has_moving_rows_) continue;
    const bool at_position = constrained.kind == LinearizationPoint::ConstraintPoint::g;
    if (!at_position) update_motions<false>(constrained.v.data(), nullptr);
    update_world_poses();
    for (size_t p = 0; p < s_.constraints.pairs.size(); ++p) {
      Pair& pair = s_.constraints.pairs[p];
      if (moved_frames_.at(&pair).empty()) continue;
      requested_.clear();
      for (int k : s_.constraints.rows_of_pair[p]) {
        if (position[k] < 0) continue;
        requested_.push_back({position[k], at_position ? &gaps_[k] : &constrained.wrench_partials[k]});
        if (!at_position) continue;
        pair.update_poses(m);
        s_.constraints.rows[k].wrench(pair, gaps_[k].F);
      }
      if (!requested_.empty()) each(constrained, pair);
    }
  }
}

}  // namespace mbdae
