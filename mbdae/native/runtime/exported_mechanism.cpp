// Construction, inputs, parameters and co-simulation steps of an exported mechanism.
#include "runtime/exported_mechanism.hpp"

#include <algorithm>
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
T read_key(const Json& document, const char* key) {
  return JsonReader().read<T>(&document.at(key));
}

}  // namespace

void ExportedMechanism::fail(const char* what) const {
  throw std::runtime_error(std::string(what) + " at t = " + std::to_string(time()) + " s");
}

ExportedMechanism::ExportedMechanism(const std::string& json)
    : document_(parse_json(json)) {
  inputs = read_key<std::vector<InputData>>(document_, "inputs");
  parameters = read_key<std::vector<ParameterData>>(document_, "parameters");
  outputs = read_key<std::vector<SignalValue>>(document_, "outputs");
  tableau_ = read_key<Tableau>(document_, "tableau"), complete_tableau(tableau_);
  JsonReader().read_fields(&document_.at("run"), initial_run_, false), initial_run_.monitor.by_mode = true;
  modes_ = read_key<ModeData>(document_, "modes"), initial_run_.modes.switches = modes_.switches;
  start_ = read_key<StartData>(document_, "start"), limits_ = read_key<CoordinateLimits>(document_, "coordinates");
  states_ = read_key<int>(document_, "states"), dependent_rows_ = read_key<int>(document_, "dependent");
  indeterminate_rows_ = read_key<std::vector<int>>(document_, "indeterminate");
  reset();
}

void ExportedMechanism::clear_core() { coordinates_.reset(), monitor_.reset(), other_.reset(), core_.reset(); }

void ExportedMechanism::reset() {
  values_.clear(), settings_.clear(), clear_core();
  for (const ParameterData& p : parameters) values_.push_back(p.value);
  for (const InputData& u : inputs) settings_.push_back({start_.t, u.value, 0});
  next_inputs_.assign(inputs.size(), NAN), x_.assign(states_, 0.0), rate_ = x_;
  run_ = initial_run_, run_.interval.t = start_.t, run_.state.y = start_.y, after_impact_ = State();
  set_guards(modes_.guards);
  jumped_ = current_ = derivatives_current_ = false;
}

void ExportedMechanism::set_parameter(int i, double value) {
  if (!std::isfinite(value)) reject("a parameter must be a finite number");
  values_[i] = value, clear_core();
}

void ExportedMechanism::build() {
  Json document = document_;
  for (size_t i = 0; i < parameters.size(); ++i)
    for (const ParameterEffect& e : parameters[i].effects)
      document.number_at(e.path) += (values_[i] - parameters[i].value) * e.by;
  clear_core();
  tree_ = read_key<TreeData>(document, "tree"), model_ = model_of(tree_);
  expanded_ = read_key<TreeData>(document, "expanded"), expanded_model_ = model_of(expanded_);
  const auto tolerances = read_key<Tolerances>(document, "tolerances");
  const Sizes n{model_.nq, model_.nv, static_cast<int>(model_.joints.size())};
  const int ns = read_key<int>(document.at("description"), "ns");
  DescriptionReader<const Json*> reader(n, ns);
  auto description = reader.read<Description>(&document.at("description"));
  check(description, n, tolerances);
  auto samplers = reader.read<std::vector<SampledController>>(&document.at("samplers"));
  auto interfaces = reader.read<std::vector<FrictionInterface>>(&document.at("interfaces"));
  core_ = std::make_unique<Core>(&model_, tolerances, std::move(description));
  Index2System& s = system();
  if (static_cast<int>(start_.y.size()) != s.length) reject("the start has the wrong length");
  for (const SignalValue& x : outputs)
    if (!x.is_valid(s)) reject("an output is not valid for the mechanism");
  s.tree.expand(&expanded_model_), s.samplers = std::move(samplers);
  check_and_complete_interfaces(interfaces, s.constraints.rows);
  const auto active = read_key<std::vector<int>>(document, "friction_active");
  friction_active_.assign(active.begin(), active.end()),
      slip_directions_ = read_key<Vector>(document, "slip_directions");
  if (active.size() != interfaces.size() || slip_directions_.size() != 2 * interfaces.size())
    reject("closure friction needs one state and two slip directions for each interface");
  s.friction.use(std::move(interfaces), friction_active_.data(), slip_directions_.data());
  s.friction.smallest_slip = read_key<double>(document, "smallest_slip");
  check(run_.modes, s), set_mode(s, run_.modes.switches, run_.modes.mode);
  other_.emplace(s.tree, s.constraints, s.counts), monitor_.emplace(s, run_.modes);
}

void ExportedMechanism::start(double t, bool steps) {
  build();
  Index2System& s = system();
  bool changed = false;
  for (size_t i = 0; i < parameters.size(); ++i) changed = changed || values_[i] != parameters[i].value;
  by_steps_ = steps, run_.interval.t = run_.grid.t0 = t, run_.state = State(), y() = start_.y;
  for (Setting& u : settings_) u.t = t;
  use_inputs();
  try {
    s.use_rows(start_.rows, static_cast<int>(start_.rows.size()), start_.floor, true);
    if (changed || (steps && run_.project)) project_state(s, t, y().data());
    steps ? begin_interval(t + 1, true, true) : begin_coordinates();
  } catch (const FallBackToPython&) {
    fail("the mechanism cannot start: it is singular, or not finite,");
  }
}

void ExportedMechanism::use_inputs() {
  for (size_t i = 0; i < settings_.size(); ++i)
    system().set_input(static_cast<int>(i), settings_[i].t, settings_[i].value, settings_[i].rate);
}

double ExportedMechanism::input(int i) const {
  if (!std::isnan(next_inputs_[i])) return next_inputs_[i];
  return settings_[i].value + settings_[i].rate * (time() - settings_[i].t);
}

void ExportedMechanism::set_input(int i, double value) {
  if (!std::isfinite(value)) reject("an input must be a finite number");
  if (started() && by_steps_ && inputs[i].linear) {
    next_inputs_[i] = value;
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
    const double t = time(), value = u.value + u.rate * (t - u.t);
    const double end = std::isnan(next_inputs_[i]) ? value : next_inputs_[i];
    const double rate = (end - value) / (t1 - t);
    if (value == u.value && rate == u.rate) continue;
    jumps = jumps || u.value != value || (inputs[i].by_rate && rate != u.rate);
    u = {t, value, rate}, system().set_input(static_cast<int>(i), t, value, rate);
  }
  next_inputs_.assign(inputs.size(), NAN);
  return jumps;
}

void ExportedMechanism::begin_interval(double t1, bool jumped, bool samples) {
  Index2System& s = system();
  SmoothInterval& interval = run_.interval;
  interval.t1 = t1;
  if (jumped) {
    Vector F(s.ny), z(s.ng);
    State next;
    next.y = y();
    if (samples) s.apply_jumps(time(), next.y.data(), time() == run_.grid.t0 ? run_.jumps.cluster_width() : INFINITY);
    s.update_independent_rows(time(), next);
    s.derivative(time(), next.y.data(), F.data(), z.data());
    next.carry = s.carry(F), run_.state = std::move(next), run_.monitor.last_ratio = INFINITY;
  }
  if (!run_.jumps.next_interval(s.samplers, time(), interval)) fail("jumps follow one another too closely");
}

void ExportedMechanism::pass_impact() {
  if (before_impact()) run_.state = std::exchange(after_impact_, State());
}

void ExportedMechanism::advance(double t, const AfterStep& after_step, bool stop_at_impacts) {
  if (!started() || !by_steps_) reject("a co-simulation must be initialized before its steps");
  pass_impact();
  const double step = run_.grid.step;
  if (!run_.adaptive) {
    const double on_grid = run_.grid.t0 + std::round((t - run_.grid.t0) / step) * step;
    if (std::fabs(on_grid - t) <= run_.grid.coincident * step) t = on_grid;
  }
  if (!(t > time())) reject("a step must end later than it begins");
  try {
    const bool at_jump = time() == run_.interval.end && run_.interval.stop != run_.interval.end;
    const bool restarts = apply_inputs(t) || at_jump, at_start = time() == run_.grid.t0;
    const int states = model_.nq + model_.nv;
    if (restarts && at_start)  // resample controllers with the inputs set since then
      std::copy(start_.y.begin() + states, start_.y.end() - 1, y().begin() + states);
    begin_interval(t, restarts, at_jump || at_start);
  } catch (const FallBackToPython&) {
    fail("the accelerations are singular, or not finite,");
  }
  auto method = core_->method(tableau_);
  run_.seconds = INFINITY, run_.max_steps = after_step || stop_at_impacts ? 1 : std::numeric_limits<long>::max();
  for (bool stopped = false; time() != t && !stopped;) {
    run_.steps = Steps(), run_.taken = run_.rejected = 0, run_.needs_python = run_.monitor.suspicious = false;
    const double previous = time();
    const Vector start = stop_at_impacts ? y() : Vector();
    Modes& modes = run_.modes;
    modes.transitions.clear(), modes.undecided = false;
    TimeLoop(method, system(), run_).advance();
    if (modes.undecided) fail("the mode after an event is not unique, or next to a singular configuration,");
    if (run_.needs_python || (time() == previous && !run_.rejected))
      fail("no step of the method is possible: the mechanism is singular, or not finite,");
    if (run_.monitor.suspicious) fail("the mechanism may pass a singular configuration");
    if (stop_at_impacts && !modes.transitions.empty() && modes.transitions.back().impact) {
      const size_t node = modes.transitions.back().node;  // node 0: an impact at the start of the step
      const double* end = &run_.steps.y[node * system().length];
      after_impact_ = run_.state, y() = node ? Vector(end - system().length, end) : start, stopped = true;
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
    fail("the accelerations are singular, or not finite,");
  }
}

}  // namespace mbdae
