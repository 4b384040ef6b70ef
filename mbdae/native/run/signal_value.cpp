// Evaluation of signals: multipliers, reaction forces and moments, residuals, energies.
#include "run/signal_value.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

void PointValues::set_point(double t, const double* y) {
  if (t == t_ && std::equal(y_.begin(), y_.end(), y)) return;
  t_ = t, y_.assign(y, y + s_.length), hidden_current_ = residuals_current_ = false;
}

void PointValues::evaluate_hidden() {
  if (hidden_current_) return;
  if (!s_.point.is_current(y_.data())) exchange();
  const Counts counts = s_.counts;
  F_.resize(s_.ny), z_.resize(s_.ng);
  s_.hidden_derivative(t_, y_.data(), F_.data(), z_.data());
  s_.friction.write_multipliers(z_.data());
  for (int k = 0; k < s_.ng; ++k) z_[k] += s_.joint_friction[k];
  s_.counts = counts, hidden_current_ = true;
}

void PointValues::evaluate_residuals() {
  if (residuals_current_) return;
  if (s_.point.is_exactly_current(y_.data()))
    s_.tree.inertia(y_.data());
  else
    exchange(), s_.point.evaluate(y_.data(), false);
  g_ = s_.point.g, rate_.resize(s_.ng);
  s_.constraints.complete_g(t_, g_.data());
  s_.residual_rate(t_, y_.data() + s_.nq, rate_.data());
  energy_ = mbdae::energy(s_, y_.data()), residuals_current_ = true;
}

double PointValues::moment(const std::vector<int>& rows) {
  evaluate_hidden();
  s_.tree.poses(y_.data());
  double sum[3] = {0, 0, 0};
  for (int k : rows) {
    const Row& row = s_.constraints.rows[k];
    Pair& pair = s_.constraints.pairs[row.pair];
    double w[6], force_moment[3];
    pair.update_poses(s_.tree);
    row.wrench(pair, w);
    cross(pair.pb, w, force_moment);
    for (int i = 0; i < 3; ++i) sum[i] += z_[k] * (w[3 + i] - force_moment[i]);
  }
  return norm(sum, 3);
}

bool SignalValue::is_valid(const Index2System& s) const {
  for (int k : rows)
    if (k < 0 || k >= s.ng || (kind == Kind::torque && s.constraints.rows[k].pair < 0)) return false;
  if (rate < -1 || rate >= s.ny || (kind == Kind::angle && (rate < 0 || rate >= s.nv))) return false;
  return i >= 0 && i + (kind == Kind::angle) < (kind == Kind::rate ? s.ny : s.length) &&
         (kind != Kind::lam || rows.size() == 1);
}

double SignalValue::at(PointValues& values, double t, const double* y) const {
  if (kind == Kind::t) return t;
  if (kind == Kind::y) return y[i];
  if (kind == Kind::angle) return std::atan2(y[i + 1], y[i]);
  values.set_point(t, y);
  double out = 0;
  if (kind == Kind::rate) out = values.F()[i];
  if (kind == Kind::lam) out = values.lam()[rows[0]];
  if (kind == Kind::force) {
    for (int k : rows) out += values.lam()[k] * values.lam()[k];
    out = std::sqrt(out);
  }
  if (kind == Kind::torque) out = values.moment(rows);
  if (kind == Kind::g || kind == Kind::Gv) {
    const Vector& residuals = kind == Kind::g ? values.g() : values.rate();
    out = largest(residuals.data(), static_cast<int>(residuals.size()));
  }
  if (kind == Kind::kinetic || kind == Kind::energy) out += values.energy().kinetic;
  if (kind == Kind::potential || kind == Kind::energy) out += values.energy().potential;
  if (!std::isfinite(out)) throw FallBackToPython();
  return out;
}

}  // namespace mbdae
