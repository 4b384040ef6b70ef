// Friction proportional to closure forces (mbdae/mechanism/formulations/closure_friction.py): T_k = factor_k |F_k(lam)|
// along e_k, for each friction interface k.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "system/independent_rows.hpp"

namespace mbdae {

class SaddleSystem;

struct FrictionInterface {
  // Rotation about an axis of a, about any axis; sliding along an axis of a, on a surface, along no-slip rows.
  NAMED_ENUM(enum, Kind, revolute, spherical, prismatic, surface, rolling)
  Kind kind = revolute;
  int row = 0, components = 1;        // the first row of F, and their number
  std::vector<int> no_slip_rows;      // rows that may slide; friction acts against their slip
  double axis[3] = {0, 0, 0};         // in a
  double coefficient = 0, width = 0;  // mu, or mu r in m; m/s or rad/s
  int pair = 0;                       // its frames, those of the rows

  FIELDS(kind, row, components, no_slip_rows, axis, coefficient, width)
};

class ClosureFriction {
 public:
  ClosureFriction(const MultibodyTree& m, Constraints& constraints, const IndependentRows& rows);

  // active (k,): which interfaces slide, directions (k, 2): slip directions of rolling contacts; arrays of Python that
  // outlive this object.
  void use(std::vector<FrictionInterface> interfaces, std::uint8_t* active, double* directions);
  explicit operator bool() const {  // does any interface slide?
    return std::any_of(active_, active_ + interfaces_.size(), [](std::uint8_t x) { return x != 0; });
  }
  double smallest_slip;            // m/s: a slower slip has no direction
  size_t size() const { return interfaces_.size(); }
  void set_active(int k, bool on) { active_[k] = on; }
  double& direction(int k) { return directions_[2 * k]; }  // of the slip along the first no-slip row

  bool has_planar_slip() const;  // does a slip with two components exist? Its direction changes within a mode
  // Sets their directions to those of clear slips at the start of a step where they differ, at current poses: rejected
  // steps turned them.
  void begin_step(const double* v);
  // e, e . v and the factors -mu r d at the current kinematics. Within a step, directions are continued where a slip
  // passes zero, as the mode ends there; at other points they are those of clear slips.
  void update_slips(const double* v, bool within_step = true);
  // With current slips and G (ng, nv) by rows, and S of the saddle-point system factorized: rhs (ng,) by row becomes
  // lam, f (nv,) v'. Returns the power of friction.
  double solve(SaddleSystem& saddle, const double* G, const Vector& Zhat, double* rhs, double* f);
  // Adds friction due to lam (ng,) of the rows in use to tau (nv,), and returns its power.
  double add(const double* G, const double* lam, double* tau);
  // Writes the friction of the last `solve` as multipliers of inactive no-slip rows into lam (ng,) of all rows.
  void write_multipliers(double* lam) const;
  // d(tau, power)/dlam of this, (r, nv + 1) by rows.
  void partials(const double* G, const double* lam, Vector& out);

 private:
  // The speed of the slip, the wrenches of its rows, and its components along them, (2,).
  double slip(const FrictionInterface& interface, const double* v, double (*W)[6], double* now) const;
  void no_slip_wrench(size_t k, const double* v, bool within_step, double* w);  // a unit wrench, (6,)
  void slip_wrench(const FrictionInterface& interface, const double* v, double* w);
  void prepare_minimum_norm(const double* G);               // prepares `minimum_norm`
  void minimum_norm(const double* lam, double* all) const;  // multipliers of all rows, of minimum norm
  double force_magnitude(const FrictionInterface& interface, const double* all,
                         double* gradient) const;                   // |F|, its partials
  void solve_forces(const Vector& lam, const Vector& responses);    // T; responses (k, ng) by rows

  const MultibodyTree& m_;
  Constraints& constraints_;
  const IndependentRows& rows_;
  std::vector<FrictionInterface> interfaces_;
  std::uint8_t* active_ = nullptr;
  double* directions_ = nullptr;
  // By rows (k, nv); (d, r) of rows that depend on those in use, and (1 + C C^T)^-1 C
  Vector e_, C_, P_;
  Vector speed_, factor_, T_;  // (k,)
  Vector slips_;               // (k, 2) directions along no-slip rows, of e
  Vector all_, one_, v_;       // (ng,), (ng,), (nv,)
};

}  // namespace mbdae
