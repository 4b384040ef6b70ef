// Impact at an event, and the mode after it (mbdae/mechanism/hybrid/impact.py, impact_law.py, active_set.py).
#pragma once

#include <functional>
#include <map>

#include "run/complementarity.hpp"
#include "run/mode_guards.hpp"
#include "run/row_space.hpp"

namespace mbdae {

// The impact and the mode transition at an event of a run. FallBackToPython in rare cases, and if a complementarity
// problem has no or several solutions.
class ModeTransition {
 public:
  ModeTransition(Index2System& s, const Modes& modes);

  // At y (length,), where `s.point` is current and these switches separate: y becomes the state after an impact, and
  // the system enters the next mode. resting: contacts that come to rest although they separate, see `resolve_impact`
  // in Python.
  Transition resolve(double t, double* y, const std::vector<int>& separated, const std::vector<int>& resting);

 private:
  // A row that takes part in an impact.
  struct ImpactRow {
    int element, row;
    double sign;  // sign of the separation speed; 0: bilateral, or tangential
    double restitution = 0;
    double friction = NAN;  // friction coefficient of a tangential row
  };
  struct Candidate {
    int row;
    Multiplier multiplier;
  };
  using Candidates = std::map<int, std::vector<Candidate>>;  // by switch

  // Kinematics at the event.
  void evaluate(double t, const double* y);  // all rows, and their rates
  void update_rates();                       // G v + g_t for other velocities
  double rest_speed(int row) const { return modes_.mode_rounding * speed_ * tolerances_.row_scales[row]; }
  const double* row(int k) const { return &G_[static_cast<size_t>(k) * s_.nv]; }
  Vector root(int k) const { return Vector(&Z_[static_cast<size_t>(k) * s_.nv], &Z_[static_cast<size_t>(k + 1) * s_.nv]); }
  double gap_limit(const Switch& x) const { return tolerances_.solution_rounding * tolerances_.row_scales[x.rows[0]]; }
  bool in_contact(int i) const;
  bool in_tooth(const Switch& x) const;
  bool inside(const Switch& x) const;  // inside the range, `lookahead` in the direction of motion
  bool is_sliding(const Switch& x) const;
  double slip_direction(const Switch& x) const;

  // Impact.
  std::vector<ImpactRow> impact_rows(int i) const;
  bool resolve_impact(double* y, const std::vector<int>& resting, Transition& out);
  // conditional: bilateral rows of separating contacts, which act if their contact approaches.
  void apply_impulses(const std::vector<ImpactRow>& contacts, const std::vector<ImpactRow>& frictional,
                      const std::vector<int>& bilateral, const std::vector<ImpactRow>& conditional, double* y,
                      Transition& out);

  // Mode after the impact.
  void evaluate_forces();
  void select(const double* y, const std::vector<int>& separated);
  std::vector<Candidate> candidates(int i);
  int next_state(int i, const std::vector<Candidate>& selected, bool in_active_set);
  void solve(const double* y, const Candidates& tested);
  bool retain_approaching(const Candidates& remaining);
  bool approaches(const Candidate& c) const;
  bool is_active(const Candidate& c) const;
  bool is_undecided(const Candidate& c) const;
  [[noreturn]] void fall_back_to_python() const { throw FallBackToPython(); }

  Index2System& s_;
  const Modes& modes_;
  const Tolerances& tolerances_;
  Vector G_, Z_, g_, g_t_, rate_, gamma_;  // (ng, nv), (ng, nv), then (ng,) of all rows
  double t_ = 0, speed_ = 0;               // speed_: largest scaled velocity plus the characteristic rate
  const double* y_ = nullptr;
  Mode mode_;
  bool entered_ = false;  // the system has entered another mode than that of the run
  std::vector<int> separating_;
  Vector F_, lam_before_;              // (ny,), (ng,) y' and lam in the previous mode
  double force_rounding_ = 0;          // rounding error of multipliers
  Vector lam_, acceleration_, scale_;  // (ng,) with the multipliers of candidates, see `_ActiveSet` in Python
  double largest_ = 0;                 // largest multiplier
};

// The state and carry after an event, in the next mode, and y' (ny,) and lam (nz,) at this state.
struct NextMode {
  State state;
  Vector F, z;
  Transition transition;
};

// Enter the mode after an event at y (length,), where the guards `fired` are zero. immediate: at the start of a step,
// so that contacts among them would separate by less than the rounding of their gaps, and come to rest. `check` may
// reject the mode. A FallBackToPython leaves everything unchanged.
NextMode enter_next_mode(Index2System& s, Modes& modes, GuardMonitor& monitor, bool project, double t, const Vector& y,
                         const std::vector<int>& fired, bool immediate = false,
                         const std::function<void(const NextMode&)>& check = nullptr);

}  // namespace mbdae
