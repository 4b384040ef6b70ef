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
  // Rotation about an axis of a, rotation about any axis, sliding along an axis of a, on a surface, along no-slip rows.
  NAMED_ENUM(enum, Kind, revolute, spherical, prismatic, surface, rolling)
  Kind kind = revolute;
  int row = 0, components = 1;        // first row of the force F, and number of its components
  std::vector<int> no_slip_rows;      // rows along which it may slide
  double axis[3] = {0, 0, 0};         // in a
  double coefficient = 0, width = 0;  // mu, or mu r in m; regularization width in m/s or rad/s
  int pair = 0;                       // frame pair of its rows

  FIELDS(kind, row, components, no_slip_rows, axis, coefficient, width)
};

class ClosureFriction {
 public:
  ClosureFriction(const MultibodyTree& m, Constraints& constraints, const IndependentRows& rows);

  // active (k,): whether interfaces slide; directions (k, 2): slip directions of rolling contacts. The arrays must
  // outlive this object.
  void use(std::vector<FrictionInterface> interfaces, std::uint8_t* active, double* directions);
  explicit operator bool() const {  // whether any interface slides
    return std::any_of(active_, active_ + interfaces_.size(), [](std::uint8_t x) { return x != 0; });
  }
  double smallest_slip;  // m/s: slips at lower speeds have no direction
  size_t size() const { return interfaces_.size(); }
  void set_active(int k, bool on) { active_[k] = on; }
  double& direction(int k) { return directions_[2 * k]; }  // sign of the slip along the first no-slip row

  bool has_planar_slip() const;  // whether a slip has two components: its direction changes within a mode
  // Reset slip directions at the start of a step to those of clear slips, at current poses: rejected steps may have
  // changed them.
  void begin_step(const double* v);
  // Update e, e . v and the factors at the current kinematics: -coefficient, times tanh(e . v / width) if the friction
  // is regularized. Within a step, directions are kept when a slip crosses zero, because the mode ends there; at other
  // points they are those of clear slips.
  void update_slips(const double* v, bool within_step = true);
  // Solve with current slips, G (ng, nv) by rows, and factorized S of the saddle-point system: replace rhs (ng,) by lam
  // and f (nv,) by v'; return the power of friction.
  double solve(SaddleSystem& saddle, const double* G, const Vector& Zhat, double* rhs, double* f);
  // Add friction due to lam (ng,) of the rows in use to tau (nv,), and return its power.
  double add(const double* G, const double* lam, double* tau);
  // Write the friction of the last `solve` to lam (ng,), as multipliers of inactive no-slip rows.
  void write_multipliers(double* lam) const;
  // d(tau, power)/dlam of `add`, (r, nv + 1) by rows.
  void partials(const double* G, const double* lam, Vector& out);

 private:
  // Return the slip speed; W: wrenches of the no-slip rows, slip_velocity (2,): components along them.
  double slip(const FrictionInterface& interface, const double* v, double (*W)[6], double* slip_velocity) const;
  void no_slip_wrench(size_t k, const double* v, bool within_step, double* w);  // a unit wrench, (6,)
  void slip_wrench(const FrictionInterface& interface, const double* v, double* w);
  void prepare_minimum_norm(const double* G);               // compute C_ and P_
  void minimum_norm(const double* lam, double* all) const;  // multipliers of all rows, of minimum norm
  double force_magnitude(const FrictionInterface& interface, const double* all,
                         double* gradient) const;                 // |F|, and d|F|/dF
  void solve_forces(const Vector& lam, const Vector& responses);  // set T_; responses (k, ng) by rows

  const MultibodyTree& m_;
  Constraints& constraints_;
  const IndependentRows& rows_;
  std::vector<FrictionInterface> interfaces_;
  std::uint8_t* active_ = nullptr;
  double* directions_ = nullptr;
  // by rows: (k, nv); C (d, r) of dependent rows, and (1 + C C^T)^-1 C
  Vector e_, C_, P_;
  Vector speed_, factor_, T_;  // (k,)
  Vector slips_;               // (k, 2) slip directions along no-slip rows
  Vector all_multipliers_, unit_response_, v_;  // (ng,), (ng,), (nv,)
};

}  // namespace mbdae
