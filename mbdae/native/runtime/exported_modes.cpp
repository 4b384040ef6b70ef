// Modes of contacts, clutches and stiction in FMI model exchange: guards are event indicators; impacts and mode
// transitions are applied at events.
#include <algorithm>
#include <cmath>

#include "runtime/exported_mechanism.hpp"
#include "system/projection.hpp"

namespace mbdae {

namespace {

// upper bound of the number of guards in any state of a switch
int guards_of_switch(const Switch& x) { return 1 + (x.frictional() || x.kind == Switch::Kind::ratchet); }

}  // namespace

size_t ExportedMechanism::indicators() const {
  size_t out = 0;
  for (const Switch& x : modes_.switches) out += guards_of_switch(x);
  return states_ ? out : 0;
}

GuardMonitor::Values ExportedMechanism::guard_values(const double* y, bool advances) {
  evaluate();
  return monitor_->values(time(), y, coordinates_->F(), coordinates_->multipliers(), advances);
}

// A time event at a quarter of each flight after an impact, so that large steps of the solver do not miss short
// flights.
double ExportedMechanism::next_event() const {
  double out = INFINITY;
  for (size_t i = 0; i < run_.modes.guards.size(); ++i) {
    const double end = monitor_->first_quarter_of_flight(static_cast<int>(i));
    const double impact = run_.modes.last_impact[run_.modes.guards[i].element];
    if (end - time() > run_.modes.coincident * (end - impact)) out = std::min(out, end);
  }
  return out;
}

Vector ExportedMechanism::indicator_values() {
  evaluate();
  const GuardMonitor::Values current = guard_values(y().data(), false);
  Vector out(indicators(), 1.0);
  std::vector<int> slots;
  int next = 0;
  for (const Switch& x : modes_.switches) slots.push_back(next), next += guards_of_switch(x);
  for (size_t i = 0; i < current.guards.size(); ++i) {
    out[slots[run_.modes.guards[i].element]++] = current.guards[i].f + current.tolerances[i];
  }
  return out;
}

bool ExportedMechanism::complete_step() {
  bool due = margin() < restart_margin();
  const GuardMonitor::Values current = guard_values(y().data(), true);
  for (size_t i = 0; i < current.guards.size(); ++i) due = due || current.guards[i].f < -current.tolerances[i];
  return due;
}

// If the solver has located the zero to rounding, its state is kept. Otherwise it has overshot it, with a velocity that
// is inconsistent in the next mode, or with a penetration.
std::vector<int> ExportedMechanism::correct_overshoot(Vector& y) {
  GuardMonitor::Values current = guard_values(y.data(), false);
  std::vector<int> out;
  int first = -1;
  double time_back = 0;
  for (size_t i = 0; i < current.guards.size(); ++i) {
    const auto& [f, rate] = current.guards[i];
    if (f <= -current.tolerances[i] / 2) out.push_back(static_cast<int>(i));
    if (f < -current.tolerances[i] && rate < 0 && f / rate > time_back)
      first = static_cast<int>(i), time_back = f / rate;
  }
  if (first < 0) return out;
  const Vector end(y), F(coordinates_->F());
  for (int k = 0; k < limits_.iterations; ++k) {
    Vector displacement(F);
    for (double& x : displacement) x *= -time_back;
    system().add(end.data(), displacement.data(), y.data());
    project_state(system(), time(), y.data());
    current = guard_values(y.data(), false);
    const auto& [f, rate] = current.guards[first];
    if (!(std::fabs(f) > current.tolerances[first] / 2) || !(rate < 0)) break;
    time_back += f / rate;
  }
  return {first};
}

// A contact whose gap is negative while it separates has a flight shorter than the solver resolves: it comes to rest.
void ExportedMechanism::end_short_flights(const std::vector<int>& fired, Vector& y) {
  const Modes& modes = run_.modes;
  const GuardMonitor::Values current = guard_values(y.data(), false);
  Mode closed(modes.mode);
  for (int i : fired)
    if (!std::isnan(modes.guards[i].return_time) && current.guards[i].rate > 0)
      closed[modes.guards[i].element] = active;
  if (closed == modes.mode) return;
  const ModeSettings settings(system(), modes.switches, modes.mode);
  enter_mode(system(), modes.switches, closed, y.data(), modes.initial_rank(system().tree.tolerances));
  project_state(system(), time(), y.data()), settings.restore();
}

bool ExportedMechanism::update_mode() {
  evaluate();
  try {
    Vector state(y());
    const std::vector<int> fired = correct_overshoot(state);
    if (fired.empty()) return false;
    end_short_flights(fired, state);
    y() = enter_next_mode(system(), run_.modes, *monitor_, true, time(), state, fired).state.y;
    begin_coordinates();
    const GuardMonitor::Values current = guard_values(y().data(), false);
    for (size_t i = 0; i < current.guards.size(); ++i)
      if (current.guards[i].f < -current.tolerances[i]) throw FallBackToPython();
  } catch (const FallBackToPython&) {
    fail("the mode after an event is not unique, or next to a singular configuration,");
  }
  return true;
}

}  // namespace mbdae
