#include "signal_value.hpp"

#include <algorithm>
#include <cmath>

#include "residuals.hpp"
#include "vec3.hpp"

namespace mbdae {

namespace {

// Moment of lam (ng,) on the body of the second frame, at its origin; the kinematics stand.
double moment(Index2System& s, const std::vector<int>& rows, const Numbers& lam) {
  double sum[3] = {0, 0, 0};
  for (int k : rows) {
    const Row& row = s.constraints.rows[k];
    Pair& pair = s.constraints.pairs[row.pair];
    double w[6], arm[3];
    pair.locate(s.mechanics);
    row.wrench(pair, w);
    cross(pair.pb, w, arm);
    for (int i = 0; i < 3; ++i) sum[i] += lam[k] * (w[3 + i] - arm[i]);
  }
  return norm(sum, 3);
}

}  // namespace

bool SignalValue::fits(const Index2System& s) const {
  for (int k : rows)
    if (k < 0 || k >= s.ng || (kind == torque && s.constraints.rows[k].pair < 0)) return false;
  if (rate < -1 || rate >= s.ny || (kind == angle && (rate < 0 || rate >= s.nv))) return false;
  return i >= 0 && i + (kind == angle) < s.length && (kind != lam || rows.size() == 1);
}

double SignalValue::at(Index2System& s, double t, const double* y) const {
  if (kind == time) return t;
  if (kind == number) return y[i];
  if (kind == angle) return std::atan2(y[i + 1], y[i]);
  const Counts counts = s.counts;
  const double least = s.rows.least_pivot_ratio;
  double out = 0;
  if (kind == lam || kind == force || kind == torque) {
    Numbers F(s.ny), z(s.ng);
    s.derivative(t, y, F.data(), z.data());
    for (int k : rows) out += z[k] * z[k];
    out = kind == lam ? z[rows[0]] : kind == force ? std::sqrt(out) : moment(s, rows, z);
  } else {
    Numbers g(s.ng), rate(s.ng);
    residual(s, t, y, g.data(), rate.data());
    const Energy e = mbdae::energy(s, y);
    if (kind == gap || kind == speed) out = largest(kind == gap ? g.data() : rate.data(), s.ng);
    if (kind == kinetic || kind == energy) out += e.kinetic;
    if (kind == potential || kind == energy) out += e.potential;
  }
  s.counts = counts, s.rows.least_pivot_ratio = least;
  if (!std::isfinite(out)) throw Trouble();
  return out;
}

}  // namespace mbdae
