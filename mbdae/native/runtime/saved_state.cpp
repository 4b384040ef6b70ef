// The complete state of an exported mechanism as an array, to save and restore it.
#include "runtime/exported_mechanism.hpp"

namespace mbdae {

namespace {

void require(bool valid) {
  if (!valid) reject("the state does not belong to this mechanism");
}

}  // namespace

Vector ExportedMechanism::guards() const {
  Vector out;
  for (const Guard& x : run_.modes.guards) out.insert(out.end(), {x.size, x.level, x.return_time, x.unit});
  return out;
}

void ExportedMechanism::set_guards(const Vector& guards) {
  Modes& modes = run_.modes;
  require(modes.mode.size() == modes.switches.size() && modes.last_impact.size() == modes.switches.size());
  modes.guards = guards_of(modes.switches, modes.mode);
  require(guards.size() == 4 * modes.guards.size());
  const double* entry = guards.data();
  for (Guard& x : modes.guards) {
    x.size = entry[0], x.level = entry[1], x.return_time = entry[2], x.unit = entry[3], entry += 4;
  }
}

Vector ExportedMechanism::state() {
  if (!started()) reject("there is no state before the initialization");
  pass_impact();
  const IndependentRows& rows = system().rows;
  const SmoothInterval& i = run_.interval;
  Vector out{i.t, i.stop, i.end, i.t1, run_.jumps.restart, run_.grid.t0, double(run_.grid.i),
              double(run_.grid.on_grid), run_.control.h, run_.control.uncut_size, run_.control.last,
              double(run_.control.rejected), run_.monitor.largest_ratio, run_.monitor.last_ratio,
              run_.monitor.mode_ratio, double(run_.monitor.near_singular), double(jumped_), double(by_steps_), origin_t_,
              double(rows.rank), rows.floor, double(rows.frozen)};
  const auto add = [&](const Vector& x) { out.push_back(double(x.size())), out.insert(out.end(), x.begin(), x.end()); };
  add(y()), add(run_.state.carry), add(run_.state.low), add(values_), add(next_inputs_), add(origin_), add(x_);
  add(Vector(rows.in_use().begin(), rows.in_use().end()));
  add(slip_directions_), add(Vector(run_.modes.mode.begin(), run_.modes.mode.end()));
  add(run_.modes.last_impact), add(guards());
  Vector ratios;
  for (const auto& [mode, largest] : run_.monitor.ratio_by_mode)
    ratios.insert(ratios.end(), mode.begin(), mode.end()), ratios.push_back(largest);
  add(ratios);
  for (const Setting& u : settings_) add({u.t, u.value, u.rate});
  set_state(out);  // the core must continue as after a restoration
  return out;
}

void ExportedMechanism::set_state(const Vector& state) {
  size_t position = 0;
  const auto next = [&] {
    require(position < state.size());
    return state[position++];
  };
  const auto list = [&] {
    const double size = next();
    require(size >= 0 && size <= double(state.size() - position));
    Vector out(state.begin() + position, state.begin() + position + static_cast<size_t>(size));
    return position += out.size(), out;
  };
  Run run = initial_run_;
  SmoothInterval& i = run.interval;
  i.t = next(), i.stop = next(), i.end = next(), i.t1 = next(), run.jumps.restart = next(), run.grid.t0 = next();
  run.grid.i = static_cast<long>(next()), run.grid.on_grid = next(), run.control.h = next();
  run.control.uncut_size = next(), run.control.last = next(), run.control.rejected = next();
  run.monitor.largest_ratio = next(), run.monitor.last_ratio = next(), run.monitor.mode_ratio = next();
  run.monitor.near_singular = next();
  const bool jumped = next(), by_steps = next();
  const double origin_t = next(), rank = next(), floor = next(), frozen = next();
  run.state.y = list(), run.state.carry = list(), run.state.low = list();
  const Vector values = list(), next_inputs = list(), origin = list(), x = list(), rows = list(), slips = list(),
               mode = list();
  run.modes.mode.assign(mode.begin(), mode.end()), run.modes.last_impact = list();
  const Vector guards = list(), ratios = list();
  const size_t switches = run.modes.mode.size();
  require(ratios.size() % (switches + 1) == 0);
  for (auto entry = ratios.begin(); entry != ratios.end(); entry += switches + 1)
    run.monitor.ratio_by_mode[Mode(entry, entry + switches)] = entry[switches];
  require(run.state.y.size() == start_.y.size() && values.size() == values_.size() &&
          next_inputs.size() == next_inputs_.size() && static_cast<int>(x.size()) == states_);
  std::vector<Setting> settings;
  for (size_t k = 0; k < inputs.size(); ++k) {
    const Vector u = list();
    require(u.size() == 3);
    settings.push_back({u[0], u[1], u[2]});
  }
  const bool rebuild = !started() || values != values_;
  values_ = values, next_inputs_ = next_inputs, settings_ = std::move(settings), run_ = std::move(run),
  jumped_ = jumped;
  set_guards(guards), after_impact_ = State();
  by_steps_ = by_steps, current_ = derivatives_current_ = false;
  if (rebuild) build();
  Index2System& s = system();
  monitor_.emplace(s, run_.modes);
  set_mode(s, run_.modes.switches, run_.modes.mode);
  s.reset(), s.use_rows(std::vector<int>(rows.begin(), rows.end()), static_cast<int>(rank), floor, frozen);
  if (slips.size() == slip_directions_.size()) std::copy(slips.begin(), slips.end(), slip_directions_.begin());
  use_inputs();
  if (by_steps_) return;
  x_ = x, rate_.assign(states_, 0.0), origin_ = origin, origin_t_ = origin_t;
  coordinates_ = std::make_unique<LocalCoordinates>(s, limits_, origin_t_, origin_.data());
}

}  // namespace mbdae
