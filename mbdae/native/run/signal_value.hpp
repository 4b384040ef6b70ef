// Signals of a mechanism at a single point (mbdae/solution/signal_value.py).
#pragma once

#include "system/index2.hpp"
#include "system/residuals.hpp"

namespace mbdae {

// Quantities of signals at a point, computed once for all signals. Their evaluations are not counted.
class PointValues {
 public:
  // other: storage for the configuration of the run while another one is evaluated; the destructor restores it.
  explicit PointValues(Index2System& s, Configuration* other = nullptr) : s_(s), other_(other) {}
  ~PointValues() {
    if (exchanged_) s_.point.exchange(*other_);
  }
  PointValues(const PointValues&) = delete;
  PointValues& operator=(const PointValues&) = delete;

  void exchange() {  // before another configuration is evaluated
    if (other_ && !exchanged_) s_.point.exchange(*other_), exchanged_ = true;
  }

  void set_point(double t, const double* y);
  const Vector& F() { return evaluate_hidden(), F_; }    // (ny,) y'
  // (ng,) from the hidden constraint; with friction of inactive rows
  const Vector& lam() { return evaluate_hidden(), z_; }
  const Vector& g() { return evaluate_residuals(), g_; }        // (ng,) g
  const Vector& rate() { return evaluate_residuals(), rate_; }  // (ng,) G v + g_t
  const Energy& energy() { return evaluate_residuals(), energy_; }
  double moment(const std::vector<int>& rows);  // magnitude of the moment of lam on the second frame, at its origin

 private:
  void evaluate_hidden();
  void evaluate_residuals();

  Index2System& s_;
  Configuration* const other_;
  bool exchanged_ = false;
  double t_ = NAN;
  Vector y_, F_, z_, g_, rate_;
  Energy energy_{};
  bool hidden_current_ = false, residuals_current_ = false;
};

struct SignalValue {
  NAMED_ENUM(enum class, Kind, t, y, rate, angle, lam, force, torque, kinetic, potential, energy, g, Gv)
  Kind kind = Kind::t;
  int i = 0, rate = -1;   // index in y or y', for an angle of its cosine; index of its rate in y', -1: none
  std::vector<int> rows;  // rows of closures

  double at(PointValues& values, double t, const double* y) const;  // value at y; angles are between -pi and pi
  bool is_valid(const Index2System& s) const;                       // whether its indices exist

  FIELDS(kind, i, rate, rows)
};

}  // namespace mbdae
