// Signals of a mechanism at a single point (mbdae/solution/signal_value.py).
#pragma once

#include <map>
#include <string>

#include "index2.hpp"

namespace mbdae {

struct SignalValue {
  enum Kind { time, number, angle, lam, force, torque, kinetic, potential, energy, gap, speed } kind = time;
  int i = 0, rate = -1;   // its number in y, of an angle that of its cosine; that of its rate in y', -1: none
  std::vector<int> rows;  // of closures

  // At a point y; an angle between -pi and pi. Nothing is counted.
  double at(Index2System& s, double t, const double* y) const;
  bool fits(const Index2System& s) const;  // whether its numbers do
};

inline const std::map<std::string, SignalValue::Kind> SIGNAL_KINDS = {
    {"t", SignalValue::time},         {"y", SignalValue::number},          {"angle", SignalValue::angle},
    {"lam", SignalValue::lam},        {"force", SignalValue::force},       {"torque", SignalValue::torque},
    {"kinetic", SignalValue::kinetic}, {"potential", SignalValue::potential}, {"energy", SignalValue::energy},
    {"g", SignalValue::gap},          {"Gv", SignalValue::speed}};

}  // namespace mbdae
