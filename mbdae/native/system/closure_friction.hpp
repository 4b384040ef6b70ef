// Friction proportional to closure forces (mbdae/mechanism/formulations/closure_friction.py): T_k = factor_k |F_k(lam)|
// along e_k, for each friction interface k.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "system/independent_rows.hpp"

namespace mbdae {

class SaddleSystem;

struct FrictionInterface {
  enum Kind { turns, bears, slides, touches, grips } kind = turns;
  int pair = 0, row = 0, carried = 1;  // its frames, the first row, and the number of rows of F
  std::vector<int> grip;               // rows that may slide; friction acts against their slip
  double axis[3] = {0, 0, 0};          // in a
  double coefficient = 0, width = 0;   // mu, or mu r in m; m/s or rad/s
};

// About an axis of a, about any axis, along an axis of a; along a surface; along no-slip rows.
inline const std::map<std::string, FrictionInterface::Kind> SLIDING_KINDS = {
    {"turns", FrictionInterface::turns},     {"bears", FrictionInterface::bears}, {"slides", FrictionInterface::slides},
    {"touches", FrictionInterface::touches}, {"grips", FrictionInterface::grips}};

class ClosureFriction {
 public:
  ClosureFriction(const Mechanics& m, Constraints& constraints, const IndependentRows& rows);

  // active (k,): which interfaces slide, heading (k, 2): slip directions of rolling contacts; arrays of Python that
  // outlive this object.
  void use(std::vector<FrictionInterface> places, const std::uint8_t* active, double* heading);
  explicit operator bool() const;  // does any interface slide?
  double still;                     // m/s: a slower slip has no direction

  // e, e . v and the factors -mu r d at the current kinematics.
  void slips(const double* v);
  // With current slips and G (ng, nv) by rows, and S of the saddle-point system factorized: rhs (ng,) by row becomes
  // lam, f (nv,) v'. Returns the power of friction.
  double solve(SaddleSystem& saddle, const double* G, const Numbers& Zhat, double* rhs, double* f);
  // Adds friction due to lam (ng,) of the rows in use to tau (nv,), and returns its power.
  double add(const double* G, const double* lam, double* tau);
  // Partials of this by lam: of tau and of the power, (r, nv + 1) by rows.
  void partials(const double* G, const double* lam, Numbers& out);

 private:
  void along_grip(size_t k, const double* v, double* w);       // a unit wrench, (6,)
  void along(const FrictionInterface& place, const double* v, double* w);
  void spread(const double* G);                               // prepares `whole`
  void whole(const double* lam, double* all) const;            // multipliers of all rows, of minimum norm
  double carried(const FrictionInterface& place, const double* all, double* gradient) const;  // |F|, its partials
  void forces(const Numbers& lam, const Numbers& responses);  // T; responses (k, ng) by rows

  const Mechanics& m_;
  Constraints& constraints_;
  const IndependentRows& rows_;
  std::vector<FrictionInterface> places_;
  const std::uint8_t* active_ = nullptr;
  double* heading_ = nullptr;
  // By rows (k, nv); (d, r) of rows that depend on those in use, and (1 + C C^T)^-1 C
  Numbers e_, C_, P_;
  Numbers speed_, factor_, T_;  // (k,)
  Numbers all_, one_, v_;              // (ng,), (ng,), (nv,)
};

}  // namespace mbdae
