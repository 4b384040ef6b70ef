// A mechanism from exported data: advanced by steps (co-simulation), or an ordinary differential equation in local
// coordinates (model exchange).
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
  bool linear = false;   // varies linearly over a step; otherwise it jumps
  bool by_rate = false;  // its rate affects the accelerations

  FIELDS(value, linear, by_rate)
};

// A value in the data that depends on a parameter: its path, and its derivative.
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

struct StartData {  // a consistent state, and its rows in use, see `Index2System::use_rows`
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
  void start(double t, bool steps);  // with the current parameters; steps: for `advance`, otherwise for `rate`
  void reset();                      // to the state before `start`

  double time() const { return run_.interval.t; }
  double input(int i) const;
  void set_input(int i, double value);
  double parameter(int i) const { return values_[i]; }
  void set_parameter(int i, double value);  // requires another `start`
  double output(int i);

  // Take steps to t; std::runtime_error: a step failed. after_step: called after each step, with its time and whether
  // it ends at t; returns true to stop.
  using AfterStep = std::function<bool(double time, bool finished)>;
  void advance(double t, const AfterStep& after_step = nullptr, bool stop_at_impacts = false);
  bool before_impact() const { return !after_impact_.y.empty(); }  // `advance` has stopped at an impact
  void pass_impact();
  double coincident() const { return run_.grid.coincident * run_.grid.step; }  // s: tolerance for a time on the grid

  // The equation x' = F(t, x, u) in local coordinates. In a mode with fewer degrees of freedom, the superfluous states
  // are zero.
  int states() const { return states_; }
  const Vector& x() const { return x_; }
  const Vector& rate();
  void set_time(double t) { run_.interval.t = t, current_ = false; }
  void set_x(const double* x) { x_.assign(x, x + states_), current_ = false; }
  double margin();  // distance from the limit of the coordinates, see `LocalCoordinates::margin`
  double restart_margin() const { return limits_.restart_margin; }  // a smaller margin requires `restart`
  void restart();     // in new coordinates, with their origin at x
  struct Derivatives {
    Vector rates, outputs;  // (states, states + inputs), (outputs, states + inputs)
  };
  const Derivatives& derivatives();

  // Event indicators: the guards of the mode (run/mode_guards.hpp), positive while it lasts, in slots reserved for each
  // switch; 1 in unused slots.
  size_t indicators() const;
  Vector indicator_values();
  bool complete_step();       // after a solver's step to the current state; returns whether an event is due
  bool update_mode();         // apply impacts and enter the next mode if guards are not positive; false: nothing to do
  double next_event() const;  // s: time of the next time event; inf: none

  Vector state();  // the complete state; the mechanism continues as after `set_state`
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
  void set_guards(const Vector& guards);  // set the guards of the current mode
  void build();
  void clear_core();
  [[noreturn]] void fail(const char* what) const;
  void use_inputs();
  bool apply_inputs(double t1);  // until t1; returns whether an input jumps
  void begin_interval(double t1, bool jumped, bool samples);
  Vector& y() { return run_.state.y; }
  void evaluate();  // y and x' at (t, x)
  void begin_coordinates();  // with the origin at y
  GuardMonitor::Values guard_values(const double* y, bool advances);
  void end_short_flights(const std::vector<int>& fired, Vector& y);
  // Move y back to the zero of the first negative guard; return the guards that are zero there.
  std::vector<int> correct_overshoot(Vector& y);
  void require_determinate(const std::vector<int>& rows);
  double output_partial(const SignalValue& signal, const LocalCoordinates::Partials& p, size_t column, size_t width);
  Index2System& system() { return core_->system; }

  Json document_;
  TreeData tree_, expanded_;
  TreeModel model_, expanded_model_;
  std::unique_ptr<Core> core_;
  std::vector<std::uint8_t> friction_active_;
  Vector slip_directions_;
  Tableau tableau_;
  Run run_, initial_run_;
  State after_impact_;
  ModeData modes_;
  StartData start_;
  CoordinateLimits limits_;
  Vector values_, next_inputs_;  // parameters; linear inputs at the end of the next step, nan: unchanged
  std::vector<Setting> settings_;
  bool jumped_ = false, by_steps_ = true, current_ = false, derivatives_current_ = false;
  std::optional<Configuration> other_;
  std::optional<GuardMonitor> monitor_;
  std::unique_ptr<LocalCoordinates> coordinates_;
  Vector origin_, x_, rate_;
  double origin_t_ = 0;
  int states_ = 0, dependent_rows_ = 0;  // number of dependent rows in the initial mode
  std::vector<int> indeterminate_rows_;  // rows whose multipliers are not unique
  Derivatives derivatives_;
};

}  // namespace mbdae
