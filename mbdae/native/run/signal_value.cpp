#include "run/signal_value.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"

namespace mbdae {

void PointValues::stand(double t, const double* y) {
  if (t == t_ && std::equal(y_.begin(), y_.end(), y)) return;
  t_ = t, y_.assign(y, y + s_.length), derived_ = measured_ = false;
}

void PointValues::derive() {
  if (derived_) return;
  if (!s_.point.near(y_.data())) part();
  const Counts counts = s_.counts;
  F_.resize(s_.ny), z_.resize(s_.ng);
  s_.hidden(t_, y_.data(), F_.data(), z_.data());
  s_.counts = counts, derived_ = true;
}

void PointValues::measure() {
  if (measured_) return;
  if (s_.point.exactly(y_.data()))
    s_.mechanics.inertia(y_.data());
  else
    part(), s_.point.evaluate(y_.data(), false);
  g_ = s_.point.g, rate_.resize(s_.ng);
  s_.constraints.gaps(t_, g_.data());
  s_.residual_rate(t_, y_.data() + s_.nq, rate_.data());
  energy_ = mbdae::energy(s_, y_.data()), measured_ = true;
}

double PointValues::moment(const std::vector<int>& rows) {
  derive();
  s_.mechanics.poses(y_.data());
  double sum[3] = {0, 0, 0};
  for (int k : rows) {
    const Row& row = s_.constraints.rows[k];
    Pair& pair = s_.constraints.pairs[row.pair];
    double w[6], arm[3];
    pair.locate(s_.mechanics);
    row.wrench(pair, w);
    cross(pair.pb, w, arm);
    for (int i = 0; i < 3; ++i) sum[i] += z_[k] * (w[3 + i] - arm[i]);
  }
  return norm(sum, 3);
}

bool SignalValue::fits(const Index2System& s) const {
  for (int k : rows)
    if (k < 0 || k >= s.ng || (kind == torque && s.constraints.rows[k].pair < 0)) return false;
  if (rate < -1 || rate >= s.ny || (kind == angle && (rate < 0 || rate >= s.nv))) return false;
  return i >= 0 && i + (kind == angle) < (kind == rated ? s.ny : s.length) && (kind != lam || rows.size() == 1);
}

double SignalValue::at(PointValues& values, double t, const double* y) const {
  if (kind == time) return t;
  if (kind == number) return y[i];
  if (kind == angle) return std::atan2(y[i + 1], y[i]);
  values.stand(t, y);
  double out = 0;
  if (kind == rated) out = values.F()[i];
  if (kind == lam) out = values.lam()[rows[0]];
  if (kind == force) {
    for (int k : rows) out += values.lam()[k] * values.lam()[k];
    out = std::sqrt(out);
  }
  if (kind == torque) out = values.moment(rows);
  if (kind == gap || kind == speed) {
    const Numbers& of = kind == gap ? values.gaps() : values.rates();
    out = largest(of.data(), static_cast<int>(of.size()));
  }
  if (kind == kinetic || kind == energy) out += values.energy().kinetic;
  if (kind == potential || kind == energy) out += values.energy().potential;
  if (!std::isfinite(out)) throw FallBackToPython();
  return out;
}

}  // namespace mbdae
