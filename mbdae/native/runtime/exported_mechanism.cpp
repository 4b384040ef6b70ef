#include "runtime/exported_mechanism.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "run/method_checks.hpp"
#include "system/description_reader.hpp"
#include "system/projection.hpp"

namespace mbdae {

TreeModel tree_model(const void* model) { return *static_cast<const TreeModel*>(model); }

std::unique_ptr<TreeAlgorithms> tree_algorithms(const void*) { reject("a joint is not supported by this runtime"); }

namespace {

using JsonReader = DataReader<const Json*>;

template <class T>
T part(const Json& document, const char* key) {
  return JsonReader().read<T>(&document.at(key));
}

[[noreturn]] void fail(const char* what, double t) {
  throw std::runtime_error(std::string(what) + " at t = " + std::to_string(t) + " s");
}

}  // namespace

ExportedMechanism::ExportedMechanism(const std::string& json)
    : document_(parse_json(json)) {
  inputs = part<std::vector<InputData>>(document_, "inputs");
  parameters = part<std::vector<ParameterData>>(document_, "parameters");
  outputs = part<std::vector<SignalValue>>(document_, "outputs");
  tableau_ = part<Tableau>(document_, "tableau"), complete_tableau(tableau_);
  JsonReader().read_fields(&document_.at("run"), fresh_run_, false);
  modes_ = part<ModeData>(document_, "modes"), fresh_run_.modes.switches = modes_.switches;
  start_ = part<StartData>(document_, "start"), limits_ = part<CoordinateLimits>(document_, "coordinates");
  states_ = part<int>(document_, "states");
  reset();
}

void ExportedMechanism::reset() {
  values_.clear(), settings_.clear(), coordinates_.reset(), other_.reset(), core_.reset();
  for (const ParameterData& p : parameters) values_.push_back(p.value);
  for (const InputData& u : inputs) settings_.push_back({start_.t, u.value, 0});
  wanted_.assign(inputs.size(), NAN), x_.assign(states_, 0.0), rate_ = x_;
  run_ = fresh_run_, run_.interval.t = start_.t, run_.state.y = start_.y, after_impact_ = State();
  set_guards(modes_.guards);
  jumped_ = current_ = derivatives_current_ = false;
}

void ExportedMechanism::set_parameter(int i, double value) {
  if (!std::isfinite(value)) reject("a parameter is a finite number");
  values_[i] = value, coordinates_.reset(), other_.reset(), core_.reset();
}

void ExportedMechanism::build() {
  Json now = document_;
  for (size_t i = 0; i < parameters.size(); ++i)
    for (const ParameterEffect& e : parameters[i].effects)
      now.number_at(e.path) += (values_[i] - parameters[i].value) * e.by;
  coordinates_.reset(), other_.reset(), core_.reset();
  tree_ = part<TreeData>(now, "tree"), model_ = model_of(tree_);
  expanded_ = part<TreeData>(now, "expanded"), expanded_model_ = model_of(expanded_);
  const auto tolerances = part<Tolerances>(now, "tolerances");
  const Sizes n{model_.nq, model_.nv, static_cast<int>(model_.joints.size())};
  const int ns = part<int>(now.at("description"), "ns");
  DescriptionReader<const Json*> reader(n, ns);
  auto description = reader.read<Description>(&now.at("description"));
  check(description, n, tolerances);
  auto samplers = reader.read<std::vector<SampledController>>(&now.at("samplers"));
  auto interfaces = reader.read<std::vector<FrictionInterface>>(&now.at("interfaces"));
  core_ = std::make_unique<Core>(&model_, tolerances, std::move(description));
  Index2System& s = system();
  if (static_cast<int>(start_.y.size()) != s.length) reject("the start has the wrong length");
  for (const SignalValue& x : outputs)
    if (!x.is_valid(s)) reject("an output does not fit the mechanism");
  s.mechanics.expand(&expanded_model_), s.samplers = std::move(samplers);
  complete_interfaces(interfaces, s.constraints.rows);
  const auto active = part<std::vector<int>>(now, "friction_active");
  friction_active_.assign(active.begin(), active.end()), slip_directions_ = part<Numbers>(now, "slip_directions");
  if (active.size() != interfaces.size() || slip_directions_.size() != 2 * interfaces.size())
    reject("as many numbers as friction interfaces");
  s.friction.use(std::move(interfaces), friction_active_.data(), slip_directions_.data());
  s.friction.smallest_slip = part<double>(now, "smallest_slip");
  check(run_.modes, s), set_mode(s, run_.modes.switches, run_.modes.mode);
  other_.emplace(s.mechanics, s.constraints, s.counts);
}

Numbers ExportedMechanism::guards() const {
  Numbers out;
  for (const Guard& x : run_.modes.guards) out.insert(out.end(), {x.size, x.level, x.return_time, x.unit});
  return out;
}

void ExportedMechanism::set_guards(const Numbers& guards) {
  Modes& modes = run_.modes;
  if (modes.mode.size() != modes.switches.size() || modes.last_impact.size() != modes.switches.size())
    reject("the state is not one of this mechanism");
  modes.guards = guards_of(modes.switches, modes.mode);
  if (guards.size() != 4 * modes.guards.size()) reject("the state is not one of this mechanism");
  const double* at = guards.data();
  for (Guard& x : modes.guards) x.size = at[0], x.level = at[1], x.return_time = at[2], x.unit = at[3], at += 4;
}

void ExportedMechanism::start(double t, bool steps) {
  build();
  Index2System& s = system();
  bool moved = false;
  for (size_t i = 0; i < parameters.size(); ++i) moved = moved || values_[i] != parameters[i].value;
  by_steps_ = steps, run_.interval.t = run_.grid.t0 = t, run_.state = State(), y() = start_.y;
  for (Setting& u : settings_) u.t = t;
  use_inputs();
  try {
    s.use_rows(start_.rows, static_cast<int>(start_.rows.size()), start_.floor, true);
    if (moved || (steps && run_.project)) project_state(s, t, y().data());
    steps ? begin_interval(t + 1, true) : restart();
  } catch (const FallBackToPython&) {
    fail("the mechanism cannot start: it is singular, or not finite,", t);
  }
}

void ExportedMechanism::use_inputs() {
  for (size_t i = 0; i < settings_.size(); ++i)
    system().set_input(static_cast<int>(i), settings_[i].t, settings_[i].value, settings_[i].rate);
}

double ExportedMechanism::input(int i) const {
  if (!std::isnan(wanted_[i])) return wanted_[i];
  return settings_[i].value + settings_[i].rate * (time() - settings_[i].t);
}

void ExportedMechanism::set_input(int i, double value) {
  if (!std::isfinite(value)) reject("an input is a finite number");
  if (started() && by_steps_ && inputs[i].linear) {
    wanted_[i] = value;
  } else if (input(i) != value) {
    settings_[i] = {time(), value, 0}, jumped_ = true, current_ = derivatives_current_ = false;
    if (started()) system().set_input(i, time(), value, 0), system().point.invalidate();
  }
}

bool ExportedMechanism::apply_inputs(double t1) {
  bool jumps = jumped_;
  jumped_ = false;
  for (size_t i = 0; i < inputs.size(); ++i) {
    if (!inputs[i].linear) continue;
    Setting& u = settings_[i];
    const double t = time(), now = u.value + u.rate * (t - u.t), to = std::isnan(wanted_[i]) ? now : wanted_[i];
    const double rate = (to - now) / (t1 - t);
    if (now == u.value && rate == u.rate) continue;
    jumps = jumps || u.value != now || (inputs[i].by_rate && rate != u.rate);
    u = {t, now, rate}, system().set_input(static_cast<int>(i), t, now, rate);
  }
  wanted_.assign(inputs.size(), NAN);
  return jumps;
}

void ExportedMechanism::begin_interval(double t1, bool jumped) {
  Index2System& s = system();
  SmoothInterval& interval = run_.interval;
  interval.t1 = t1;
  if (jumped) {
    Numbers F(s.ny), z(s.ng);
    State next;
    next.y = y();
    s.apply_jumps(time(), next.y.data());
    s.update_independent_rows(time(), next);
    s.derivative(time(), next.y.data(), F.data(), z.data());
    next.carry = s.carry(F), run_.state = std::move(next), run_.monitor.last_ratio = INFINITY;
  }
  if (!run_.jumps.next_interval(s.samplers, time(), interval)) fail("jumps follow one another too closely", time());
}

void ExportedMechanism::pass_impact() {
  if (before_impact()) run_.state = std::exchange(after_impact_, State());
}

void ExportedMechanism::advance(double t, const AfterStep& after_step, bool stop_at_impacts) {
  if (!started() || !by_steps_) reject("steps follow the initialization of a co-simulation");
  pass_impact();
  const double step = run_.grid.step;
  if (!run_.adaptive) {
    const double on_grid = run_.grid.t0 + std::round((t - run_.grid.t0) / step) * step;
    if (std::fabs(on_grid - t) <= run_.grid.coincident * step) t = on_grid;
  }
  if (!(t > time())) reject("a step leads forwards");
  try {
    const bool after_jump = run_.interval.stop != run_.interval.end;
    begin_interval(t, apply_inputs(t) || after_jump);
  } catch (const FallBackToPython&) {
    fail("the accelerations are singular, or not finite,", time());
  }
  auto method = core_->method(tableau_);
  run_.seconds = INFINITY, run_.max_steps = after_step || stop_at_impacts ? 1 : std::numeric_limits<long>::max();
  for (bool stopped = false; time() != t && !stopped;) {
    run_.steps = Steps(), run_.taken = run_.rejected = 0, run_.needs_python = run_.monitor.suspicious = false;
    const double before = time();
    Modes& modes = run_.modes;
    modes.transitions.clear(), modes.undecided = false;
    TimeLoop(method, system(), run_).advance();
    if (modes.undecided) fail("the mode after an event is not unique, or next to a singular configuration,", time());
    if (run_.needs_python || (time() == before && !run_.rejected))
      fail("no step of the method is possible: the mechanism is singular, or not finite,", time());
    if (run_.monitor.suspicious) fail("the mechanism may pass a singular configuration", time());
    if (stop_at_impacts && !modes.transitions.empty() && modes.transitions.back().impact) {
      const size_t length = system().length, node = modes.transitions.back().node - 1;
      after_impact_ = run_.state;
      std::copy_n(&run_.steps.y[node * length], length, y().data());
      stopped = true;
    }
    stopped = (after_step && after_step(time(), time() == t)) || stopped;
  }
}

double ExportedMechanism::output(int i) {
  const SignalValue& signal = outputs[i];
  Index2System& s = system();
  if (!by_steps_) evaluate();
  try {
    PointValues values(s, &*other_);
    values.set_point(time(), y().data());
    return signal.at(values, time(), y().data());
  } catch (const FallBackToPython&) {
    fail("the accelerations are singular, or not finite,", time());
  }
}

Numbers ExportedMechanism::state() {
  if (!started()) reject("there is no state before the initialization");
  pass_impact();
  const IndependentRows& rows = system().rows;
  const SmoothInterval& i = run_.interval;
  Numbers out{i.t, i.stop, i.end, i.t1, run_.jumps.restart, run_.grid.t0, double(run_.grid.i),
              double(run_.grid.on_grid), run_.control.h, run_.control.uncut_size, run_.control.last,
              double(run_.control.rejected), run_.monitor.largest_ratio, run_.monitor.last_ratio,
              double(run_.monitor.entered), double(jumped_), double(by_steps_), origin_t_, double(rows.rank), rows.floor,
              double(rows.frozen)};
  const auto add = [&](const Numbers& x) { out.push_back(double(x.size())), out.insert(out.end(), x.begin(), x.end()); };
  add(y()), add(run_.state.carry), add(run_.state.low), add(values_), add(wanted_), add(origin_), add(x_);
  add(Numbers(rows.in_use().begin(), rows.in_use().end()));
  add(slip_directions_), add(Numbers(run_.modes.mode.begin(), run_.modes.mode.end()));
  add(run_.modes.last_impact), add(guards());
  for (const Setting& u : settings_) add({u.t, u.value, u.rate});
  set_state(out);  // without what the core has found so far
  return out;
}

void ExportedMechanism::set_state(const Numbers& state) {
  size_t at = 0;
  const auto next = [&] {
    if (at >= state.size()) reject("the state is not one of this mechanism");
    return state[at++];
  };
  const auto list = [&] {
    const double size = next();
    if (!(size >= 0 && size <= double(state.size() - at))) reject("the state is not one of this mechanism");
    Numbers out(state.begin() + at, state.begin() + at + static_cast<size_t>(size));
    return at += out.size(), out;
  };
  Run run = fresh_run_;
  SmoothInterval& i = run.interval;
  i.t = next(), i.stop = next(), i.end = next(), i.t1 = next(), run.jumps.restart = next(), run.grid.t0 = next();
  run.grid.i = static_cast<long>(next()), run.grid.on_grid = next(), run.control.h = next();
  run.control.uncut_size = next(), run.control.last = next(), run.control.rejected = next();
  run.monitor.largest_ratio = next(), run.monitor.last_ratio = next(), run.monitor.entered = next();
  const bool jumped = next(), by_steps = next();
  const double origin_t = next(), rank = next(), floor = next(), frozen = next();
  run.state.y = list(), run.state.carry = list(), run.state.low = list();
  const Numbers values = list(), wanted = list(), origin = list(), x = list(), rows = list(), slips = list(), mode = list();
  run.modes.mode.assign(mode.begin(), mode.end()), run.modes.last_impact = list();
  const Numbers guards = list();
  if (run.state.y.size() != start_.y.size() || values.size() != values_.size() || wanted.size() != wanted_.size() ||
      static_cast<int>(x.size()) != states_)
    reject("the state is not one of this mechanism");
  std::vector<Setting> settings;
  for (size_t k = 0; k < inputs.size(); ++k) {
    const Numbers u = list();
    if (u.size() != 3) reject("the state is not one of this mechanism");
    settings.push_back({u[0], u[1], u[2]});
  }
  const bool rebuild = !started() || values != values_;
  values_ = values, wanted_ = wanted, settings_ = std::move(settings), run_ = std::move(run), jumped_ = jumped;
  set_guards(guards), after_impact_ = State();
  by_steps_ = by_steps, current_ = derivatives_current_ = false;
  if (rebuild) build();
  Index2System& s = system();
  set_mode(s, run_.modes.switches, run_.modes.mode);
  s.reset(), s.use_rows(std::vector<int>(rows.begin(), rows.end()), static_cast<int>(rank), floor, frozen);
  if (slips.size() == slip_directions_.size()) std::copy(slips.begin(), slips.end(), slip_directions_.begin());
  use_inputs();
  if (by_steps_) return;
  x_ = x, origin_ = origin, origin_t_ = origin_t;
  coordinates_ = std::make_unique<LocalCoordinates>(s, limits_, origin_t_, origin_.data());
}

}  // namespace mbdae
