// How a stage moves with numbers of a mechanism (mbdae/mechanism/discrete_sensitivity/parameter_partials.py): each is a direction in what
// the mechanism is made of, or a change of laws and rows.
#pragma once

#include <map>
#include <memory>

#include "system/index2.hpp"
#include "sensitivity/world_pose.hpp"
#include "sensitivity/stage_sensitivity.hpp"

namespace mbdae {

// What a mechanism is made of, as far as parameters change it.
struct ModelComponent {
  enum Of { inertia, place, frame, gravity, armature } of;
  int at = 0;           // the joint behind which the body is, or whose place it is; or the number of a pair
  bool of_law = false;  // a pair of a law's
  bool b = false;       // the pair's second frame
};

inline int size_of(ModelComponent::Of of, int nv) {  // mass, moment, inertia; a motion; a vector; one for each velocity
  return of == ModelComponent::inertia ? 1 + 3 + 6 : of == ModelComponent::gravity ? 3 : of == ModelComponent::armature ? nv : 6;
}

struct Direction {  // of a parameter in some stuff
  int parameter, stuff;
  Numbers x;
};

// Laws, or rows, that a parameter changes, with another value of it: their difference is a sum of them with weights.
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
  std::vector<int> at;  // numbers of the laws' states, or of the rows
  std::vector<PerturbedLaws> laws;
  std::vector<PerturbedRows> rows;
};

class Parameters {
 public:
  Parameters(Index2System& system, int count, std::vector<ModelComponent> stuff, std::vector<Direction> directions,
                  std::vector<ChangedElement> changed);

  size_t count() const { return count_; }
  bool moving() const { return moving_; }  // places or frames do

  void begin();                                                               // of a sum of cotangents
  void add(const LinearisationPoint& point, const double* above, const double* nu);  // P^T above + Q^T nu, (n,) and (r,)
  void end(double* p);                                                        // adds the sum to p (k,)
  void forces(const LinearisationPoint& point, Numbers& P);                          // P (k, n), where J and poses stand
  void rows(const LinearisationPoint& point, Numbers& Q, const Numbers& q);          // Q (k, r), where they stand at q

 private:
  struct Moving {  // stuff that moves one frame of a pair alone
    int stuff;
    bool b;  // the second one
  };
  struct Asked {  // a row of a pair
    int at;
    const WrenchPartials* turning;
  };

  void pose(const LinearisationPoint& point);             // J and poses, where they are asked for
  void stand(const LinearisationPoint& point);            // all else that stuff asks for, and own_P_, where poses stand
  void change(const LinearisationPoint& point);           // own_P_
  void meet_changed(const LinearisationPoint::Met& met);  // adds to own_Q_
  template <bool accelerated>
  void motions(const double* v, const double* a);  // V_, and A_
  void momenta();                                  // of V_ and A_
  void locate();                                   // here_
  // Where rows meet, one point after another, own_Q_, and each(met, pair) with asked_ of those that places and frames
  // move; poses stand at q.
  template <class F>
  void meet(const LinearisationPoint& point, const Numbers& q, const F& each);

  void contract(const LinearisationPoint& point, const double* above);  // into sums_
  void twists(const double* v);                                  // U_
  void bodies();                                                 // of U_
  // What motions of places and frames do to F . (X_b - X_a); velocities V_ for a damped wrench.
  void moved(const Pair& pair, const WrenchPartials& t, const std::vector<Six>& X);
  void shifted(const Pair& pair, const double* F);  // to F . d_b - F . d_a

  void inertia_columns(int stuff, Numbers& P) const;
  void place_columns(int stuff, Numbers& P);
  void gravity_columns(int stuff, Numbers& P);
  void pair_columns(const ActingWrench& w, Numbers& P) const;
  void row_columns(const LinearisationPoint::Met& met, const Pair& pair, size_t r, Numbers& Q) const;
  // How a wrench changes where xi moves a frame, or a place and all behind it: dF for what is before the place,
  // `within` for what is behind it. The slope of F . (V_b - V_a).
  double moving(const Pair& pair, const WrenchPartials& t, const Moving& by, const double* xi, double* dF,
                double* within) const;
  void load(int joint, const double* W, double* P) const;  // P -= J^T W with the columns that move a joint
  void load_behind(int joint, double* P);                  // the same of W_ on bodies behind it, by columns there

  Index2System& s_;
  const size_t count_;
  const int n_;  // nv + ns + 1
  const std::vector<ModelComponent> stuff_;
  const std::vector<Direction> directions_;
  std::vector<ChangedElement> changed_;
  std::map<const Pair*, std::vector<Moving>> ends_;  // of all pairs
  bool moving_ = false, placing_ = false, kinematic_ = false, meeting_ = false;
  bool rows_move_ = false;                            // with places and frames
  std::vector<std::vector<int>> columns_;             // of J, of each joint
  std::vector<int> joint_of_;                         // (nv,) of each column
  std::vector<std::vector<bool>> above_;              // (joints, joints) is the second one the first, or before it?
  std::vector<std::vector<int>> behind_;              // a joint and all behind it; of the world: all joints
  std::vector<std::vector<const Direction*>> along_;  // in each stuff
  std::vector<int> used_, heavy_;                     // joints whose motions, and whose bodies are asked for
  std::vector<Numbers> sums_;                         // the cotangent of all stuff
  Numbers own_P_, own_Q_, own_;  // of changed laws and rows: (changed, n), (changed, ng); (changed,)

  std::vector<Six> V_, A_, U_, X_;      // by joint; A less gravity
  std::vector<Six> F_, H_, C_, h_, W_;  // by joint: of all that is behind it, but h_ of the body alone
  std::vector<Body> body_;
  std::vector<WorldPose> here_;  // of all stuff
  std::vector<Asked> asked_;
  std::vector<WrenchPartials> gaps_;  // (ng,) wrenches of rows alone
};

template <class F>
void Parameters::meet(const LinearisationPoint& point, const Numbers& q, const F& each) {
  own_Q_.assign(changed_.size() * s_.ng, 0.0);
  if (!rows_move_ && !meeting_) return;
  Mechanics& m = s_.mechanics;
  const std::vector<int>& position = s_.rows.position();
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
