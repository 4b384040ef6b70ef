// Impacts at which one contact rebounds (mbdae/mechanism/hybrid/impact.py, impact_law.py, friction_lcp.py).
#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"
#include "run/contact_guards.hpp"

namespace mbdae {

namespace {

// Impulses p of a contact and q of its friction, |q| <= mu p; W are the velocities of normal and tangent due to them.
class FrictionLaw {
 public:
  FrictionLaw(double Wnn, double Wnt, double Wtt, double mu) : Wnn_(Wnn), Wnt_(Wnt), Wtt_(Wtt), mu_(mu) {}

  // The impulses that increase the normal speed by `increase`, with a slip before them; false where they are not unique.
  bool solve(double increase, double slip, double& p, double& q) {
    if (!decided_ && Wtt_ > 0) {
      if (!(Wnn_ - mu_ * std::fabs(Wnt_) > 0)) return false;
      stick(increase, slip, p, q);
      if (!(std::fabs(q) <= mu_ * p)) direction_ = q > 0 ? -1 : 1;
    }
    if (Wtt_ > 0 && direction_ == 0) {
      stick(increase, slip, p, q);
    } else {
      p = increase / (Wnn_ - direction_ * mu_ * Wnt_), q = -direction_ * mu_ * p;
      if (!decided_ && direction_ * (slip + Wnt_ * p + Wtt_ * q) < 0) return false;
    }
    decided_ = true;
    return true;
  }

 private:
  void stick(double increase, double slip, double& p, double& q) const {
    const double determinant = Wnn_ * Wtt_ - Wnt_ * Wnt_;
    p = (Wtt_ * increase + Wnt_ * slip) / determinant, q = -(Wnn_ * slip + Wnt_ * increase) / determinant;
  }

  const double Wnn_, Wnt_, Wtt_, mu_;
  int direction_ = 0;  // of the slip after the impact; 0: it sticks
  bool decided_ = false;
};

}  // namespace

void ContactMonitor::require_loads(const double* y, const double* F, const double* lam) {
  if (!loaded_) return;
  double most = 0;
  for (const ContactGuard& guard : all_.guards)
    if (guard.closed) most = std::max(most, std::fabs(lam[guard.row]));
  const double zero = std::max(all_.mode_rounding * most, load_rounding(y, F, lam));
  for (const ContactGuard& guard : all_.guards)
    if (guard.closed && !(guard.sign * lam[guard.row] > zero)) leave_to_python();
}

bool ContactMonitor::redundant() const {
  const std::vector<bool>& off = s_.constraints.off;
  const long active = off.empty() ? s_.ng : std::count(off.begin(), off.end(), false);
  return static_cast<long>(s_.rows.in_use().size()) < active;
}

Numbers ContactMonitor::all_impulses(const Numbers& in_use) const {
  Numbers out(s_.ng, 0.0);
  for (int k : s_.rows.in_use()) out[k] = in_use[k];
  if (!redundant()) return out;
  const std::vector<double>& scales = s_.mechanics.limits.row_scales;
  const size_t nv = s_.nv, ng = s_.ng;
  Numbers impulse(nv, 0.0), columns(nv * ng), scaled(ng);
  for (size_t k = 0; k < ng; ++k)
    for (int c : s_.constraints.rows[k].columns) {
      const double z = s_.point.Z[k * nv + c];
      columns[c * ng + k] = z / scales[k], impulse[c] += z * out[k];
    }
  minimum_norm(s_.ng, s_.nv, columns.data(), impulse.data(), s_.mechanics.limits.truncation, scaled.data());
  for (size_t k = 0; k < ng; ++k) out[k] = scaled[k] / scales[k];
  return out;
}

// With current gaps.
ContactMonitor::Response ContactMonitor::response(int row, double sign) {
  const size_t nv = s_.nv, at = row * nv;
  Response out{Numbers(nv, 0.0), Numbers(), Numbers(s_.ng, 0.0)};
  for (int c : s_.constraints.rows[row].columns) out.row[c] = sign * G_[at + c];
  s_.point.scale_row(row, G_, Z_);
  double free = 0;  // |M^-1/2 G^T|^2
  for (int c : s_.constraints.rows[row].columns) free += Z_[at + c] * Z_[at + c];
  s_.saddle.factorize_symmetric();
  out.v = out.row;
  s_.saddle.solve_uncounted(out.lam.data(), out.v.data());
  const double truncation = s_.mechanics.limits.truncation;
  if (!(dot(out.row.data(), out.v.data(), s_.nv) > truncation * truncation * free)) leave_to_python();
  return out;
}

Rebound ContactMonitor::rebound(int i, double t, double* y) {
  const Tolerances& limits = s_.mechanics.limits;
  const ContactGuard& guard = all_.guards[i];
  const int row = guard.row, nv = s_.nv;
  const double scale = limits.row_scales[row], e = guard.restitution;
  double* v = y + s_.nq;
  const auto largest_speed = [&] { return all_.characteristic_rate + largest_scaled(v, limits.coordinate_scales); };
  const Gaps before = gaps(t, y);
  for (int k = 0; k < static_cast<int>(rows_.size()); ++k) {  // this one alone closes
    const bool touches = before.value[k] <= limits.solution_rounding * limits.row_scales[rows_[k]];
    if (!all_.guards[k].closed && touches != (k == i)) leave_to_python();
  }
  if (loaded_ && redundant()) leave_to_python();  // impulses of contacts have signs
  const double approach = before.rate[i], speed = largest_speed();
  if (!(e > 0) || std::fabs(t - guard.last_impact) < guard.rest) leave_to_python();
  if (!(approach < -all_.mode_rounding * speed * scale)) leave_to_python();

  Numbers rate(s_.ng), x(nv), closing(s_.ng, 0.0);
  s_.residual_rate(t, v, rate.data());
  if (!(largest_scaled(rate.data(), limits.row_scales) <= limits.visible * speed)) leave_to_python();
  const Response normal = response(row, guard.sign);
  const Response none{Numbers(nv), Numbers(nv), Numbers(s_.ng)};
  const Response tangent = guard.no_slip >= 0 ? response(guard.no_slip, 1) : none;
  const auto compliance = [&](const Response& a, const Response& b) { return dot(a.row.data(), b.v.data(), nv); };
  FrictionLaw law(compliance(normal, normal), compliance(normal, tangent), compliance(tangent, tangent), guard.friction);

  Rebound out{-1, i, 0, Numbers(s_.ng, 0.0)};
  const Numbers start(v, v + nv);
  for (int k = 0; k < 2; ++k) {  // the second time, rounding is removed
    if (k) s_.residual_rate(t, v, rate.data());
    s_.saddle.factorize_symmetric();
    s_.saddle.minimum_norm_motion(rate.data(), x.data(), closing.data());
    for (int c = 0; c < nv; ++c) v[c] -= x[c];
    double p, q;
    const double increase = -e * approach - dot(normal.row.data(), v, nv), slip = dot(tangent.row.data(), v, nv);
    if (!law.solve(increase, slip, p, q)) leave_to_python();
    for (int c = 0; c < nv; ++c) v[c] += p * normal.v[c] + q * tangent.v[c];
    for (int r : s_.rows.in_use()) out.impulses[r] += p * normal.lam[r] + q * tangent.lam[r] - closing[r];
    out.impulses[row] += guard.sign * p;
    if (guard.no_slip >= 0) out.impulses[guard.no_slip] += q;
  }
  Numbers force(nv, 0.0);
  const auto add = [&](const Numbers& G, int r) {
    for (int c : s_.constraints.rows[r].columns) force[c] += out.impulses[r] * G[static_cast<size_t>(r) * nv + c];
  };
  for (int r : s_.rows.in_use()) add(s_.point.G, r);
  add(G_, row);
  if (guard.no_slip >= 0) add(G_, guard.no_slip);
  for (int c = 0; c < nv; ++c) out.work += 0.5 * force[c] * (start[c] + v[c]);
  if (guard.no_slip >= 0 && out.work > 0) leave_to_python();
  y[s_.length - 1] += out.work;
  if (!(e * -approach > all_.mode_rounding * largest_speed() * scale) || !finite(y, s_.length)) leave_to_python();
  const double impulse = out.impulses[row];
  const double zero = all_.mode_rounding * std::fabs(impulse);
  for (const ContactGuard& other : all_.guards)  // closed contacts stay closed
    if (other.closed && !(other.sign * out.impulses[other.row] >= -zero)) leave_to_python();
  const double tangential = guard.no_slip >= 0 ? out.impulses[guard.no_slip] : 0;
  out.impulses = all_impulses(out.impulses), out.impulses[row] = impulse;
  if (guard.no_slip >= 0) out.impulses[guard.no_slip] = tangential;
  return out;
}

}  // namespace mbdae
