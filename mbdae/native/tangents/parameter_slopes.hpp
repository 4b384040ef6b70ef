// How a stage moves with numbers of a mechanism (mbdae/mechanism/variations/parameters.py): each is a direction in what
// the mechanism is made of, or a change of laws and rows.
#pragma once

#include <array>
#include <map>
#include <memory>

#include "system/index2.hpp"
#include "tangents/stage_slopes.hpp"

namespace mbdae {

// What a mechanism is made of, as far as parameters change it.
struct Stuff {
  enum Of { inertia, place, frame, gravity, armature } of;
  int at = 0;           // the joint behind which the body is, or whose place it is; or the number of a pair
  bool of_law = false;  // a pair of a law's
  bool b = false;       // the pair's second frame
};

inline int size_of(Stuff::Of of, int nv) {  // mass, moment, inertia; a motion; a vector; one for each velocity
  return of == Stuff::inertia ? 1 + 3 + 6 : of == Stuff::gravity ? 3 : of == Stuff::armature ? nv : 6;
}

struct Direction {  // of a parameter in some stuff
  int parameter, stuff;
  Numbers x;
};

// Laws, or rows, that a parameter changes, with another value of it: their difference is a sum of them with weights.
struct NearLaws {
  NearLaws(std::vector<Pair> pairs, std::vector<Law> laws, const std::vector<int>& pair_of_law);
  double weight = 0;
  std::vector<Pair> pairs;
  std::vector<Law> laws;
};

struct NearRows {
  double weight;
  std::unique_ptr<Constraints> rows;
};

struct Changed {
  int parameter;
  std::vector<int> at;  // numbers of the laws' states, or of the rows
  std::vector<NearLaws> laws;
  std::vector<NearRows> rows;
};

class ParameterSlopes {
 public:
  ParameterSlopes(Index2System& system, int count, std::vector<Stuff> stuff, std::vector<Direction> directions,
                  std::vector<Changed> changed);

  size_t count() const { return count_; }
  bool moving() const { return moving_; }  // places or frames do

  void begin();                      // of a sum of cotangents
  void add(const VariedPoint& point, const double* above, const double* nu);  // P^T above + Q^T nu, (n,) and (r,)
  void end(double* p);               // adds the sum to p (k,)
  void columns(const VariedPoint& point, Numbers& P, Numbers& Q);  // (k, n) and (k, r)

 private:
  using Six = std::array<double, 6>;
  struct Placed {  // a body, a joint's place, or a frame, in the world; R by rows
    double R[9], p[3];
  };

  struct Moving {  // stuff that moves one frame of a pair alone
    int stuff;
    bool b;  // the second one
  };

  void stand(const VariedPoint& point);
  void change(const VariedPoint& point);                                  // own_P_ and own_Q_
  void contract(const VariedPoint& point, const double* above, const double* nu);  // into sums_
  void momenta();                                                         // of V_ and A_
  void bodies();                                                          // of U_
  // What motions of places and frames do to F . (X_b - X_a), in the world; velocities V for a damped wrench.
  void moved(const Pair& pair, const Turning& t, const std::vector<Six>& X);
  void shifted(const Pair& pair, const double* F);    // to F . d_b - F . d_a
  void pulled(const std::vector<Placed>& placed);     // the same in their own axes, into sums_
  void collect(double* p) const;  // adds sums_ along the directions
  void clear();
  void twists(const double* J, const double* v, std::vector<Six>& out) const;
  void locate(std::vector<Placed>& out) const;

  Index2System& s_;
  const size_t count_;
  const int n_;  // nv + ns + 1
  const std::vector<Stuff> stuff_;
  const std::vector<Direction> directions_;
  std::vector<Changed> changed_;
  std::map<const Pair*, std::vector<Moving>> ends_;  // of all pairs
  bool moving_ = false, placing_ = false, kinematic_ = false, meeting_ = false;
  std::vector<std::vector<int>> columns_;  // of J, of each joint
  std::vector<std::vector<bool>> above_;   // (joints, joints) is the second one the first, or before it?
  std::vector<Numbers> sums_;              // the cotangent of all stuff
  Numbers own_P_, own_Q_, own_;            // of changed laws and rows: (changed, n), (changed, ng); (changed,)
  struct Met {
    VariedPoint::Met::Kind kind;
    double weight;
    std::vector<Six> V;                                                              // by joint
    std::vector<Placed> placed;                                                      // of all stuff
    std::vector<std::pair<const Pair*, std::vector<std::pair<int, Turning>>>> rows;  // with their positions
  };

  std::vector<Six> V_, A_, U_, X_;  // by joint; A less gravity
  std::vector<Six> F_, H_, C_, h_;  // by joint, of all that is behind it; of the body alone
  std::vector<Body> body_;
  std::vector<Placed> here_;        // of all stuff
  std::vector<Six> pull_;           // alike: by a motion in the world
  std::vector<Met> met_;
  Numbers J_;
};

}  // namespace mbdae
