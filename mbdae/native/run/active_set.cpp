// Active-set selection of the mode after an event: which unilateral rows are active, separate or slip
// (mbdae/mechanism/hybrid/active_set.py).
#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"
#include "run/mode_transition.hpp"
#include "system/projection.hpp"

namespace mbdae {

Transition ModeTransition::resolve(double t, double* y, const std::vector<int>& separated,
                                   const std::vector<int>& resting) {
  Transition out;
  evaluate(t, y);
  resolve_impact(y, resting, out);
  select(y, separated);
  if (entered_ || mode_ != modes_.mode) enter_mode(s_, modes_.switches, mode_, y, modes_.initial_rank(tolerances_));
  out.mode = mode_;
  return out;
}

NextMode enter_next_mode(Index2System& s, Modes& modes, GuardMonitor& monitor, bool project, double t, const Vector& y,
                         const std::vector<int>& fired, bool immediate,
                         const std::function<void(const NextMode&)>& check) {
  const ModeSettings settings(s, modes.switches, modes.mode);
  const Mode mode = modes.mode;
  const std::vector<Guard> guards = modes.guards;
  const IndependentRows::Freeze freeze(s.rows);
  NextMode out;
  std::vector<int> separated, resting, elements;
  for (int i : fired) {
    elements.push_back(guards[i].element);
    if (guards[i].kind == Guard::separation) separated.push_back(guards[i].element);
    if (guards[i].kind == Guard::contact && immediate) resting.push_back(guards[i].element);
  }
  out.state.y = y, out.F.resize(s.ny), out.z.resize(s.nz);
  try {
    out.transition = ModeTransition(s, modes).resolve(t, out.state.y.data(), separated, resting);
    if (project) project_state(s, t, out.state.y.data());
    s.update_independent_rows(t, out.state);
    s.derivative(t, out.state.y.data(), out.F.data(), out.z.data());
    out.state.carry = s.carry(out.F);
    if (check) check(out);
    modes.mode = out.transition.mode, monitor.track(t, out.state.y.data(), out.F, out.z);
  } catch (const FallBackToPython&) {
    modes.mode = mode, modes.guards = guards, settings.restore();
    throw;
  }
  for (int i : out.transition.contacts) modes.last_impact[i] = t;
  out.transition.fired = std::move(elements);
  return out;
}

bool ModeTransition::is_sliding(const Switch& x) const {
  return std::fabs(rate_[x.rows[1]]) > modes_.transverse * rest_speed(x.rows[1]);
}

double ModeTransition::slip_direction(const Switch& x) const {
  return is_sliding(x) ? std::copysign(1.0, rate_[x.rows[1]]) : s_.friction.direction(x.interface);
}

std::vector<ModeTransition::Candidate> ModeTransition::candidates(int i) {
  const Switch& x = modes_.switches[i];
  const int state = modes_.mode[i];
  const Multiplier unilateral = x.sign > 0 ? Multiplier{0, INFINITY} : Multiplier{-INFINITY, 0};
  std::vector<Candidate> out;
  switch (x.kind) {
    case Switch::Kind::contact:
      if (!in_contact(i)) break;
      out.push_back({x.rows[0], unilateral});
      for (size_t k = 1; k < x.rows.size(); ++k) {
        Multiplier m;
        if (x.frictional()) {
          if (!(x.sign > 0)) fall_back_to_python();
          m.normal = x.rows[0], m.friction = x.friction;
          if (is_sliding(x)) m.sliding_ratio = -x.friction * slip_direction(x);
        }
        out.push_back({x.rows[k], m});
      }
      break;
    case Switch::Kind::ratchet:
      if (state != active && !in_tooth(x)) break;
      [[fallthrough]];
    case Switch::Kind::clutch:
      out.push_back({x.rows[0], unilateral});
      break;
    case Switch::Kind::stiction: {
      double limit = x.limit;
      if (state == active) evaluate_forces();
      if (state == active &&
          1 - std::fabs(stiction_utilization(s_, modes_.switches, modes_.mode, i, lam_before_)) < modes_.coincident)
        limit = std::min(x.friction, (1 - tolerances_.visible) * limit);
      out.push_back({x.rows[0], {-limit, limit}});
      break;
    }
    case Switch::Kind::range:
      break;
  }
  return out;
}

int ModeTransition::next_state(int i, const std::vector<Candidate>& selected, bool in_active_set) {
  const Switch& x = modes_.switches[i];
  const int k = x.rows[0];
  switch (x.kind) {
    case Switch::Kind::contact: {
      if (!in_active_set || !x.frictional()) return in_active_set ? active : released;
      double& direction = s_.friction.direction(x.interface);
      if (is_sliding(x)) {
        direction = slip_direction(x);
        return sliding;
      }
      const double tangential = lam_[x.rows[1]];
      if (std::fabs(tangential) < (1 - modes_.at_limit) * x.friction * std::fabs(lam_[k])) return active;
      direction = tangential > 0 ? -1 : tangential < 0 ? 1 : 0;
      return sliding;
    }
    case Switch::Kind::ratchet: {
      if (in_active_set) return active;
      const double speed = x.sign * rate_[k];
      if (std::fabs(speed) > rest_speed(k)) return speed > 0 ? released : runs_back;
      if (!selected.empty() || modes_.mode[i] == active) return released;
      evaluate_forces();
      return x.sign * (dot(row(k), F_.data() + s_.nv, s_.nv) + gamma_[k]) >= 0 ? released : runs_back;
    }
    case Switch::Kind::stiction:
      if (in_active_set) return active;
      return (selected.empty() ? y_[s_.nq + x.column] : acceleration_[k]) > 0 ? slips_forwards : slips_backwards;
    case Switch::Kind::range:
      return inside(x) ? active : released;
    default:
      return in_active_set ? active : released;
  }
}

// Evaluate y' and lam in the mode before the event, and gamma of all rows.
void ModeTransition::evaluate_forces() {
  if (!F_.empty()) return;
  const double* y = y_;
  F_.resize(s_.ny), lam_before_.resize(s_.ng);
  s_.derivative(t_, y, F_.data(), lam_before_.data());
  force_rounding_ = tolerances_.solution_rounding * largest_force(s_, y, F_.data(), lam_before_.data());
  {
    const AllRowsActive all_active(s_.constraints);
    s_.tree.motions(y, y + s_.nq);
    s_.constraints.bias(s_.tree, y, y + s_.nq, s_.constraints.all, gamma_.data());
    Vector g_tt(s_.ng, 0.0);
    s_.constraints.evaluate_g_tt(t_, g_tt.data());
    for (int k : s_.constraints.all) gamma_[k] += g_tt[k];
  }
}

void ModeTransition::select(const double* y, const std::vector<int>& separated) {
  Candidates remaining;
  const int n = static_cast<int>(modes_.switches.size());
  for (int i = 0; i < n; ++i) {
    std::vector<Candidate> rows = candidates(i);
    if (!rows.empty() && std::fabs(rate_[rows[0].row]) <= rest_speed(rows[0].row)) remaining[i] = std::move(rows);
  }
  for (int i = 0; i < n; ++i)
    if (!remaining.count(i)) mode_[i] = next_state(i, {}, false);
  for (int i : separated)
    if (remaining.count(i)) separating_.push_back(i);
  if (!remaining.empty()) evaluate_forces();
  Candidates tested;
  std::map<int, bool> in_active_set;
  for (bool changed = true; changed;) {
    tested = remaining;
    for (int i : separating_) tested.erase(i);
    if (tested.empty() && separating_.empty()) return;
    solve(y, tested);
    for (int k : s_.constraints.all) largest_ = std::max(largest_, std::fabs(lam_[k]));
    if ((changed = retain_approaching(remaining))) continue;
    std::vector<int> inactive;
    for (const auto& [i, c] : tested) {
      in_active_set[i] = is_active(c[0]);
      if (!in_active_set[i] && (c.size() > 1 || c[0].multiplier.bounded())) inactive.push_back(i);
    }
    for (int i : inactive) {
      remaining.erase(i);
      mode_[i] = next_state(i, tested[i][0].multiplier.bounded() ? tested[i] : std::vector<Candidate>(), false);
    }
    changed = !inactive.empty();
  }
  for (const auto& [i, c] : tested) {
    if (c.size() == 1 && !c[0].multiplier.bounded() && is_undecided(c[0])) fall_back_to_python();
    mode_[i] = next_state(i, c, in_active_set[i]);
  }
  for (int i : separating_) mode_[i] = next_state(i, {}, false);
}

void ModeTransition::solve(const double* y, const Candidates& tested) {
  const int nv = s_.nv;
  Mode base_mode(mode_);
  for (const auto& [i, c] : tested) base_mode[i] = released;
  Vector F(s_.ny), lam(s_.ng);
  if (entered_ || base_mode != modes_.mode)
    enter_mode(s_, modes_.switches, base_mode, y, modes_.initial_rank(tolerances_)), entered_ = true;
  s_.derivative(t_, y, F.data(), lam.data());
  acceleration_.resize(s_.ng), lam_.assign(s_.ng, 0.0);
  for (int k : s_.constraints.all) acceleration_[k] = dot(row(k), F.data() + nv, nv) + gamma_[k];
  scale_ = acceleration_;
  for (double& x : scale_) x = std::fabs(x);
  if (tested.empty()) return;
  std::vector<int> active_rows(modes_.unswitched);
  for (size_t i = 0; i < base_mode.size(); ++i) {
    const std::vector<int>& rows = modes_.switches[i].rows;
    active_rows.insert(active_rows.end(), rows.begin(), rows.begin() + modes_.switches[i].active_rows(base_mode[i]));
  }
  const RowSpace space(s_, Z_, active_rows);
  std::vector<Candidate> selected;
  std::vector<Multiplier> multipliers;
  std::vector<Vector> roots;
  Vector c, x, w;
  for (const auto& [i, rows] : tested) {
    const int first = static_cast<int>(selected.size());
    for (const Candidate& candidate : rows) {
      Vector z = root(candidate.row);
      const double full_norm = norm(z.data(), nv);
      space.project_out(z);
      // dependent: its multiplier does not change its acceleration
      if (!(norm(z.data(), nv) > tolerances_.truncation * full_norm)) {
        if (!candidate.multiplier.bounded()) fall_back_to_python();
        continue;
      }
      selected.push_back(candidate), multipliers.push_back(candidate.multiplier), roots.push_back(std::move(z));
      if (multipliers.back().normal >= 0) multipliers.back().normal = first;
      c.push_back(acceleration_[candidate.row]);
    }
  }
  const size_t m = selected.size();
  Vector W(m * m), force(nv, 0.0);
  for (size_t i = 0; i < m; ++i)
    for (size_t j = 0; j < m; ++j) W[i * m + j] = dot(roots[i].data(), roots[j].data(), nv);
  Vector noise(m, tolerances_.solution_rounding * largest_scaled(acceleration_.data(), tolerances_.row_scales));
  for (size_t i = 0; i < m; ++i) noise[i] *= tolerances_.row_scales[selected[i].row];
  if (!solve_complementarity(W, c, noise, multipliers, tolerances_, modes_.max_states, x, w)) fall_back_to_python();
  for (size_t i = 0; i < m; ++i) {
    lam_[selected[i].row] = x[i];
    if (selected[i].multiplier.bounded())
      scale_[selected[i].row] += W[i * m + i] * (selected[i].multiplier.upper - selected[i].multiplier.lower);
    for (int k = 0; k < nv; ++k) force[k] += x[i] * roots[i][k];
  }
  for (int k : s_.constraints.all) {
    Vector z = root(k);
    space.project_out(z);
    acceleration_[k] += dot(z.data(), force.data(), nv);
  }
}

bool ModeTransition::retain_approaching(const Candidates& remaining) {
  const auto approaching =
      std::find_if(separating_.begin(), separating_.end(), [&](int i) { return approaches(remaining.at(i)[0]); });
  if (approaching == separating_.end()) return false;
  separating_.erase(approaching);
  return true;
}

bool ModeTransition::approaches(const Candidate& c) const {
  const double inward = std::isfinite(c.multiplier.lower) ? -acceleration_[c.row] : acceleration_[c.row];
  const double rate = modes_.characteristic_rate;
  const double largest = rate * rate + largest_scaled(acceleration_.data(), tolerances_.row_scales);
  return inward > tolerances_.zero_speed * largest * tolerances_.row_scales[c.row];
}

bool ModeTransition::is_active(const Candidate& c) const {
  if (c.multiplier.bounded()) return std::fabs(acceleration_[c.row]) <= tolerances_.zero_speed * scale_[c.row];
  const double margin = modes_.mode_rounding * largest_;
  return c.multiplier.lower + margin < lam_[c.row] && lam_[c.row] < c.multiplier.upper - margin;
}

bool ModeTransition::is_undecided(const Candidate& c) const {
  const Vector z = root(c.row);
  const double largest_entry = largest(row(c.row), s_.nv);
  const double error = force_rounding_ / (largest_entry > 0 ? largest_entry : 1) * dot(z.data(), z.data(), s_.nv);
  const double zero = std::max(modes_.mode_rounding * largest_, force_rounding_);
  return std::fabs(lam_[c.row]) <= zero &&
         std::fabs(acceleration_[c.row]) <= tolerances_.zero_speed / tolerances_.solution_rounding * error;
}

}  // namespace mbdae
