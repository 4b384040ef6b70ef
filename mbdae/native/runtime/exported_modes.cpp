// Modes of contacts, clutches and stiction in FMI model exchange: guards are event indicators; impacts and mode changes
// happen at events.
#include <algorithm>
#include <cmath>

#include "runtime/exported_mechanism.hpp"
#include "system/projection.hpp"

namespace mbdae {

namespace {

int guards_of_switch(const Switch& x) { return 1 + (x.frictional() || x.kind == Switch::Kind::ratchet); }  // at most

}  // namespace

size_t ExportedMechanism::indicators() const {
  size_t out = 0;
  for (const Switch& x : modes_.switches) out += guards_of_switch(x);
  return states_ ? out : 0;
}

GuardMonitor::Values ExportedMechanism::guard_values(const double* at, bool advances) {
  evaluate();
  return monitor_->values(time(), at, coordinates_->F(), coordinates_->multipliers(), advances);
}

// An event at a quarter of each flight after an impact: large steps of the solver do not miss short flights.
double ExportedMechanism::next_event() const {
  double out = INFINITY;
  for (size_t i = 0; i < run_.modes.guards.size(); ++i) {
    const double end = monitor_->takeoff_end(static_cast<int>(i));
    const double impact = run_.modes.last_impact[run_.modes.guards[i].element];
    if (end - time() > run_.modes.coincident * (end - impact)) out = std::min(out, end);
  }
  return out;
}

Vector ExportedMechanism::indicator_values() {
  evaluate();
  const GuardMonitor::Values now = guard_values(y().data(), false);
  Vector out(indicators(), 1.0);
  std::vector<int> at;
  int next = 0;
  for (const Switch& x : modes_.switches) at.push_back(next), next += guards_of_switch(x);
  for (size_t i = 0; i < now.guards.size(); ++i) {
    double& place = out[at[run_.modes.guards[i].element]++];
    place = now.guards[i].f + now.tolerances[i];
  }
  return out;
}

bool ExportedMechanism::complete_step() {
  bool due = margin() < restart_margin();
  const GuardMonitor::Values now = guard_values(y().data(), true);
  for (size_t i = 0; i < now.guards.size(); ++i)
    due = due || now.guards[i].f < -now.tolerances[i];
  return due;
}

// A solver that has located the zero to rounding keeps its state. Others have overshot it, with a velocity that the
// mode after the event does not have, or through a contact.
std::vector<int> ExportedMechanism::correct_overshoot(Vector& at) {
  GuardMonitor::Values now = guard_values(at.data(), false);
  std::vector<int> out;
  int first = -1;
  double back = 0;
  for (size_t i = 0; i < now.guards.size(); ++i) {
    const auto& [f, rate] = now.guards[i];
    if (f <= -now.tolerances[i] / 2) out.push_back(static_cast<int>(i));
    if (f < -now.tolerances[i] && rate < 0 && f / rate > back) first = static_cast<int>(i), back = f / rate;
  }
  if (first < 0) return out;
  const Vector end(at), F(coordinates_->F());
  for (int k = 0; k < limits_.iterations; ++k) {
    Vector move(F);
    for (double& x : move) x *= -back;
    system().add(end.data(), move.data(), at.data());
    project_state(system(), time(), at.data());
    now = guard_values(at.data(), false);
    const auto& [f, rate] = now.guards[first];
    if (!(std::fabs(f) > now.tolerances[first] / 2) || !(rate < 0)) break;
    back += f / rate;
  }
  return {first};
}

// A contact whose gap is negative while it separates: the flight is below the resolution of the solver, and rest
// replaces it.
void ExportedMechanism::end_flights(const std::vector<int>& fired, Vector& at) {
  const Modes& modes = run_.modes;
  const GuardMonitor::Values now = guard_values(at.data(), false);
  Mode closed(modes.mode);
  for (int i : fired)
    if (!std::isnan(modes.guards[i].return_time) && now.guards[i].rate > 0) closed[modes.guards[i].element] = active;
  if (closed == modes.mode) return;
  const ModeSettings settings(system(), modes.switches, modes.mode);
  enter_mode(system(), modes.switches, closed, at.data(), modes.initial_rank(system().tree.limits));
  project_state(system(), time(), at.data()), settings.restore();
}

bool ExportedMechanism::update_mode() {
  evaluate();
  try {
    Vector at(y());
    const std::vector<int> fired = correct_overshoot(at);
    if (fired.empty()) return false;
    end_flights(fired, at);
    y() = enter_next_mode(system(), run_.modes, *monitor_, true, time(), at, fired).state.y;
    begin_coordinates();
    const GuardMonitor::Values now = guard_values(y().data(), false);
    for (size_t i = 0; i < now.guards.size(); ++i)
      if (now.guards[i].f < -now.tolerances[i]) throw FallBackToPython();
  } catch (const FallBackToPython&) {
    fail("the mode after an event is not unique, or next to a singular configuration,");
  }
  return true;
}

}  // namespace mbdae
