// Signals of a mechanism at a single point (mbdae/solution/signal_value.py).
#pragma once

#include <map>
#include <string>

#include "system/index2.hpp"
#include "system/residuals.hpp"

namespace mbdae {

// Quantities for signals at a point, computed once for all of them. Not counted.
class PointValues {
 public:
  // kept: storage for the configuration of the run while another one is evaluated; it is restored in the end.
  explicit PointValues(Index2System& s, Configuration* kept = nullptr) : s_(s), kept_(kept) {}
  ~PointValues() {
    if (apart_) s_.point.exchange(*kept_);
  }
  PointValues(const PointValues&) = delete;
  PointValues& operator=(const PointValues&) = delete;

  void part() {  // before another configuration is evaluated
    if (kept_ && !apart_) s_.point.exchange(*kept_), apart_ = true;
  }

  void stand(double t, const double* y);
  const Numbers& F() { return derive(), F_; }        // (ny,) y'
  const Numbers& lam() { return derive(), z_; }      // (ng,) of the hidden constraint
  const Numbers& gaps() { return measure(), g_; }    // (ng,) g
  const Numbers& rates() { return measure(), rate_; }  // (ng,) G v + g_t
  const Energy& energy() { return measure(), energy_; }
  double moment(const std::vector<int>& rows);  // of lam on the body of the second frame, at its origin

 private:
  void derive();
  void measure();

  Index2System& s_;
  Configuration* const kept_;
  bool apart_ = false;
  double t_ = NAN;
  Numbers y_, F_, z_, g_, rate_;
  Energy energy_{};
  bool derived_ = false, measured_ = false;
};

struct SignalValue {
  enum Kind { time, number, rated, angle, lam, force, torque, kinetic, potential, energy, gap, speed } kind = time;
  int i = 0, rate = -1;   // its index in y or y', for an angle that of its cosine; that of its rate in y', -1: none
  std::vector<int> rows;  // of closures

  double at(PointValues& values, double t, const double* y) const;  // at a point y; an angle between -pi and pi
  bool fits(const Index2System& s) const;                           // whether its indices are valid
};

inline const std::map<std::string, SignalValue::Kind> SIGNAL_KINDS = {
    {"t", SignalValue::time},           {"y", SignalValue::number},           {"rate", SignalValue::rated},
    {"angle", SignalValue::angle},      {"lam", SignalValue::lam},            {"force", SignalValue::force},
    {"torque", SignalValue::torque},    {"kinetic", SignalValue::kinetic},    {"potential", SignalValue::potential},
    {"energy", SignalValue::energy},    {"g", SignalValue::gap},              {"Gv", SignalValue::speed}};

}  // namespace mbdae
