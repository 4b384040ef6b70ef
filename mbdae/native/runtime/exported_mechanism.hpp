// A mechanism from exported data: advanced by steps, or as an ordinary differential equation in local coordinates.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "mechanism/tree_data.hpp"
#include "run/core.hpp"
#include "run/signal_value.hpp"
#include "runtime/json.hpp"
#include "runtime/local_coordinates.hpp"

namespace mbdae {

struct InputData {
  double value = 0;
  bool linear = false;   // over a step, from its value before; otherwise it jumps
  bool by_rate = false;  // its rate enters the accelerations

  FIELDS(value, linear, by_rate)
};

// What a number of the mechanism depends on: its place, and its derivative with respect to the parameter.
struct ParameterEffect {
  std::vector<std::string> path;
  double by = 0;

  FIELDS(path, by)
};

struct ParameterData {
  double value = 0;
  std::vector<ParameterEffect> effects;

  FIELDS(value, effects)
};

struct StartData {  // a point, and its rows in use, see `Index2System::use_rows`
  double t = 0, floor = 0;
  Vector y;
  std::vector<int> rows;

  FIELDS(t, floor, y, rows)
};

class ExportedMechanism {
 public:
  explicit ExportedMechanism(const std::string& json);

  std::vector<InputData> inputs;
  std::vector<ParameterData> parameters;
  std::vector<SignalValue> outputs;

  const std::string& token() const { return document_.at("token").text; }
  bool started() const { return core_ != nullptr; }
  void start(double t, bool steps);  // with the present parameters; steps: by `advance`, otherwise by `rate`
  void reset();                      // to the state before `start`

  double time() const { return run_.interval.t; }
  double input(int i) const;
  void set_input(int i, double value);
  double parameter(int i) const { return values_[i]; }
  void set_parameter(int i, double value);  // `start` is due again
  double output(int i);

  // Steps to t; std::runtime_error where they fail. After each step, with its time and whether it ends at t: true ends.
  using AfterStep = std::function<bool(double now, bool finished)>;
  void advance(double t, const AfterStep& after_step = nullptr, bool stop_at_impacts = false);
  bool before_impact() const { return !after_impact_.y.empty(); }  // where `advance` has stopped
  void pass_impact();
  double coincident() const { return run_.grid.coincident * run_.grid.step; }  // s: tolerance for a time on the grid

  // The equation x' = F(t, x, u) in local coordinates. A mode with fewer degrees of freedom than there are states has
  // fewer coordinates: the other states are zero.
  int states() const { return states_; }
  const Vector& x() const { return x_; }
  const Vector& rate();
  void set_time(double t) { run_.interval.t = t, current_ = false; }
  void set_x(const double* x) { x_.assign(x, x + states_), current_ = false; }
  double margin();    // in the range of the coordinates
  double restart_margin() const { return limits_.restart_margin; }  // below which others are due
  void restart();     // in new coordinates, with their origin at x
  struct Derivatives {
    Vector rates, outputs;  // (states, states + inputs), (outputs, states + inputs)
  };
  const Derivatives& derivatives();

  // Guards of the mode (mbdae/native/run/mode_guards.hpp), positive as long as it lasts, each at a place of its switch; 1
  // where a mode has none.
  size_t indicators() const;
  Vector indicator_values();
  bool complete_step();  // of a solver, to the present state; whether an event is due
  bool update_mode();    // where guards are not positive: impacts, and the next mode; whether there were any
  double next_event() const;  // s: when a solver stops; inf: never

  Vector state();  // all of it; from now on, this continues as a mechanism with this state
  void set_state(const Vector& state);

 private:
  struct Setting {
    double t, value, rate;
  };
  struct ModeData {
    std::vector<Switch> switches;
    Vector guards;  // (guards, 4) size, level, return time and unit at the start

    FIELDS(switches, guards)
  };
  Vector guards() const;
  void set_guards(const Vector& guards);  // of the mode
  void build();
  void clear_core();
  [[noreturn]] void fail(const char* what) const;
  void use_inputs();
  bool apply_inputs(double t1);  // from now on until t1; whether one jumps
  void begin_interval(double t1, bool jumped, bool samples);
  Vector& y() { return run_.state.y; }
  void evaluate();  // y and x' at (t, x)
  void begin_coordinates();  // with their origin at y
  GuardMonitor::Values guard_values(const double* at, bool advances);
  void end_flights(const std::vector<int>& fired, Vector& at);
  // Move back to the first of the guards that are negative; return those that are zero there.
  std::vector<int> correct_overshoot(Vector& at);
  void require_determinate(const std::vector<int>& rows);
  double output_partial(const SignalValue& signal, const LocalCoordinates::Partials& p, size_t column, size_t wide);
  Index2System& system() { return core_->system; }

  Json document_;
  TreeData tree_, expanded_;
  TreeModel model_, expanded_model_;
  std::unique_ptr<Core> core_;
  std::vector<std::uint8_t> friction_active_;
  Vector slip_directions_;
  Tableau tableau_;
  Run run_, fresh_run_;
  State after_impact_;
  ModeData modes_;
  StartData start_;
  CoordinateLimits limits_;
  Vector values_, wanted_;  // of parameters; of linear inputs at the end of the next step, nan: unchanged
  std::vector<Setting> settings_;
  bool jumped_ = false, by_steps_ = true, current_ = false, derivatives_current_ = false;
  std::optional<Configuration> other_;
  std::optional<GuardMonitor> monitor_;
  std::unique_ptr<LocalCoordinates> coordinates_;
  Vector origin_, x_, rate_;
  double origin_t_ = 0;
  int states_ = 0, dependent_ = 0;  // dependent rows in the mode of the start
  std::vector<int> indeterminate_;  // rows whose multipliers are not unique
  Derivatives derivatives_;
};

}  // namespace mbdae
