// Partials of a stage by parameters of a mechanism (mbdae/mechanism/discrete_sensitivity/parameter_partials.py): each
// is a direction in model components, or a change of laws and rows.
#pragma once

#include <map>
#include <memory>

#include "system/index2.hpp"
#include "sensitivity/world_pose.hpp"
#include "sensitivity/stage_sensitivity.hpp"

namespace mbdae {

// Components of a model that parameters can change.
struct ModelComponent {
  enum Of { inertia, place, frame, gravity, armature } of;
  int at = 0;           // the joint of the body or of the placement; or the index of a pair
  bool of_law = false;  // the pair belongs to a law
  bool b = false;       // the pair's second frame
};

inline int size_of(ModelComponent::Of of, int nv) {  // mass, moment, inertia; a motion; a vector; one for each velocity
  return of == ModelComponent::inertia ? 1 + 3 + 6 : of == ModelComponent::gravity ? 3 : of == ModelComponent::armature ? nv : 6;
}

struct Direction {  // of a parameter in a model component
  int parameter, stuff;
  Numbers x;
};

// Laws, or rows, perturbed by a parameter: differences are sums of them with weights.
struct PerturbedLaws {
  PerturbedLaws(std::vector<Pair> pairs, std::vector<Law> laws, const std::vector<int>& pair_of_law);
  double weight = 0;
  std::vector<Pair> pairs;
  std::vector<Law> laws;
};

struct PerturbedRows {
  double weight;
  std::unique_ptr<Constraints> rows;
};

struct ChangedElement {
  int parameter;
  std::vector<int> at;  // indices of the laws' states, or of the rows
  std::vector<PerturbedLaws> laws;
  std::vector<PerturbedRows> rows;
};

class Parameters {
 public:
  Parameters(Index2System& system, int count, std::vector<ModelComponent> stuff, std::vector<Direction> directions,
                  std::vector<ChangedElement> changed);

  size_t count() const { return count_; }
  bool moving() const { return moving_; }  // of placements or frames

  // Partials of friction that depends on multipliers, computed in Python at (q, v, lam): K (n, nv), D (n, n), P (k, n).
  using Friction = std::function<void(const Numbers& q, const Numbers& v, const Numbers& lam, Numbers& K, Numbers& D,
                                      Numbers& P)>;
  Friction friction;

  void begin();                                                               // of a sum of cotangents
  void add(const LinearisationPoint& point, const double* above, const double* nu);  // P^T above + Q^T nu, (n,) and (r,)
  void add_columns(const Numbers& P, const double* above);                    // P (k, n)
  void end(double* p);                                                        // adds the sum to p (k,)
  void forces(const LinearisationPoint& point, Numbers& P);                          // P (k, n), J and poses current
  void rows(const LinearisationPoint& point, Numbers& Q, const Numbers& q);          // Q (k, r), the same at q

 private:
  struct Moving {  // components that move only one frame of a pair
    int stuff;
    bool b;  // the second one
  };
  struct Asked {  // a row of a pair
    int at;
    const WrenchPartials* turning;
  };

  void pose(const LinearisationPoint& point);             // J and poses, if needed
  void stand(const LinearisationPoint& point);            // all other terms, and own_P_, with current poses
  void change(const LinearisationPoint& point);           // own_P_
  void meet_changed(const LinearisationPoint::Met& met);  // adds to own_Q_
  template <bool accelerated>
  void motions(const double* v, const double* a);  // V_, and A_
  void momenta();                                  // of V_ and A_
  void locate();                                   // here_
  // At each constraint point, computes own_Q_, and calls each(met, pair) with asked_ of the pairs moved by placements
  // and frames; poses are current at q.
  template <class F>
  void meet(const LinearisationPoint& point, const Numbers& q, const F& each);

  void contract(const LinearisationPoint& point, const double* above);  // into sums_
  void twists(const double* v);                                  // U_
  void bodies();                                                 // of U_
  // Partials of F . (X_b - X_a) by motions of placements and frames; velocities V_ for a damped wrench.
  void moved(const Pair& pair, const WrenchPartials& t, const std::vector<Six>& X);
  void shifted(const Pair& pair, const double* F);  // of F . d_b - F . d_a

  void inertia_columns(int stuff, Numbers& P) const;
  void place_columns(int stuff, Numbers& P);
  void gravity_columns(int stuff, Numbers& P);
  void pair_columns(const ActingWrench& w, Numbers& P) const;
  void row_columns(const LinearisationPoint::Met& met, const Pair& pair, size_t r, Numbers& Q) const;
  // Change of a wrench due to xi of a frame, or of a placement with its subtree: dF for the rest of the tree, `within`
  // for the subtree. Returns the partial of F . (V_b - V_a).
  double moving(const Pair& pair, const WrenchPartials& t, const Moving& by, const double* xi, double* dF,
                double* within) const;
  void load(int joint, const double* W, double* P) const;  // P -= J^T W with the columns that move a joint
  void load_behind(int joint, double* P);                  // the same of W_ on bodies of its subtree, by columns there

  Index2System& s_;
  const size_t count_;
  const int n_;  // nv + ns + 1
  const std::vector<ModelComponent> stuff_;
  const std::vector<Direction> directions_;
  std::vector<ChangedElement> changed_;
  std::map<const Pair*, std::vector<Moving>> ends_;  // of all pairs
  bool moving_ = false, placing_ = false, kinematic_ = false, meeting_ = false;
  bool rows_move_ = false;                            // with placements and frames
  std::vector<std::vector<int>> columns_;             // of J, of each joint
  std::vector<int> joint_of_;                         // (nv,) of each column
  std::vector<std::vector<bool>> above_;              // (joints, joints) is the second one the first or its ancestor?
  std::vector<std::vector<int>> behind_;              // the subtree of each joint; of the world: all joints
  std::vector<std::vector<const Direction*>> along_;  // in each component
  std::vector<int> used_, heavy_;                     // joints whose motions, and whose bodies are needed
  std::vector<Numbers> sums_;                         // the cotangent of all components
  Numbers extra_;  // (k,) of further columns
  Numbers own_P_, own_Q_, own_;  // of changed laws and rows: (changed, n), (changed, ng); (changed,)

  std::vector<Six> V_, A_, U_, X_;      // by joint; A minus gravity
  std::vector<Six> F_, H_, C_, h_, W_;  // by joint: of its subtree, except h_ of the body alone
  std::vector<Body> body_;
  std::vector<WorldPose> here_;  // of all components
  std::vector<Asked> asked_;
  std::vector<WrenchPartials> gaps_;  // (ng,) wrenches of single rows
};

template <class F>
void Parameters::meet(const LinearisationPoint& point, const Numbers& q, const F& each) {
  own_Q_.assign(changed_.size() * s_.ng, 0.0);
  if (!rows_move_ && !meeting_) return;
  Mechanics& m = s_.mechanics;
  const std::vector<int>& position = (point.rows ? *point.rows : s_.rows).position();
  const Numbers* stands = &q;
  for (const LinearisationPoint::Met& met : point.met) {
    if (met.q != *stands) m.poses(met.q.data());
    stands = &met.q;
    if (meeting_) meet_changed(met);
    if (!rows_move_) continue;
    if (met.kind != LinearisationPoint::Met::gap) motions<false>(met.v.data(), nullptr);
    locate();
    for (size_t p = 0; p < s_.constraints.pairs.size(); ++p) {
      Pair& pair = s_.constraints.pairs[p];
      if (ends_.at(&pair).empty()) continue;
      asked_.clear();
      for (int k : s_.constraints.of_pair[p]) {
        if (position[k] < 0) continue;
        asked_.push_back({position[k], met.kind == LinearisationPoint::Met::gap ? &gaps_[k] : &met.turnings[k]});
        if (met.kind != LinearisationPoint::Met::gap) continue;
        pair.locate(m);
        s_.constraints.rows[k].wrench(pair, gaps_[k].F);
      }
      if (!asked_.empty()) each(met, pair);
    }
  }
}

}  // namespace mbdae
