// Rows, friction and torques of a mode in the system.
#include "run/switches.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

double Switch::coordinate(const double* q) const {
  double out = 0;
  for (size_t k = 0; k < positions.size(); ++k) out += factors[k] * q[positions[k]];
  return out;
}

double Switch::depth(double x) const {
  double deepest = -INFINITY;
  for (const auto& [low, high] : windows) {
    const double half_width = (high - low) / 2;
    double offset = x - low - half_width;
    if (period > 0) offset -= period * std::nearbyint(offset / period);
    deepest = std::max(deepest, half_width - std::fabs(offset));
  }
  return deepest;
}

void set_mode(Index2System& s, const std::vector<Switch>& switches, const Mode& mode) {
  std::vector<bool> inactive(s.ng, false);
  bool has_sticking_joints = false;
  for (size_t i = 0; i < switches.size(); ++i) {
    const Switch& x = switches[i];
    for (size_t k = x.active_rows(mode[i]); k < x.rows.size(); ++k) inactive[x.rows[k]] = true;
    if (x.frictional()) s.friction.set_active(x.interface, mode[i] == sliding);
    if (x.kind != Switch::Kind::stiction) continue;
    has_sticking_joints |= mode[i] == active;
    const double torque = x.friction * (mode[i] == slips_forwards ? 1 : mode[i] == slips_backwards ? -1 : 0);
    *s.law_parameter(x.law, x.column) = torque, s.last_stage.t = NAN;
    s.joint_friction[x.rows[0]] = -torque;
  }
  s.deactivate_rows(std::move(inactive), has_sticking_joints);
}

void enter_mode(Index2System& s, const std::vector<Switch>& switches, const Mode& mode, const double* y,
                const IndependentRows::InitialRank& first) {
  set_mode(s, switches, mode);
  s.rows.reset();
  s.determine_rows(y, first);
}

ModeSettings::ModeSettings(Index2System& s, const std::vector<Switch>& switches, const Mode& mode)
    : s_(s),
      switches_(switches),
      mode_(mode),
      rows_(s.rows.in_use()),
      rank_(s.rows.rank),
      floor_(s.rows.floor),
      frozen_(s.rows.frozen) {
  for (const Switch& x : switches)
    if (x.frictional()) directions_.push_back(s.friction.direction(x.interface));
}

void ModeSettings::restore() const {
  size_t k = 0;
  for (const Switch& x : switches_)
    if (x.frictional()) s_.friction.direction(x.interface) = directions_[k++];
  set_mode(s_, switches_, mode_);
  s_.use_rows(rows_, rank_, floor_, frozen_);
}

}  // namespace mbdae
