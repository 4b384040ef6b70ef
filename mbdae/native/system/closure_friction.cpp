// Slips and wrenches of friction interfaces, and the fixed point of friction and closure forces.
#include "system/closure_friction.hpp"

#include <algorithm>
#include <cmath>

#include "math/dense_lu.hpp"
#include "math/vec3.hpp"
#include "system/saddle.hpp"

namespace mbdae {

ClosureFriction::ClosureFriction(const MultibodyTree& m, Constraints& constraints, const IndependentRows& rows)
    : smallest_slip(m.tolerances.zero_speed), m_(m), constraints_(constraints), rows_(rows) {}

void ClosureFriction::use(std::vector<FrictionInterface> interfaces, std::uint8_t* active, double* directions) {
  interfaces_ = std::move(interfaces), active_ = active, directions_ = directions;
  const size_t k = interfaces_.size();
  e_.assign(k * m_.nv, 0.0), speed_.assign(k, 0.0), factor_ = T_ = speed_, slips_.assign(2 * k, 0.0);
  all_multipliers_.assign(constraints_.rows.size(), 0.0), unit_response_ = all_multipliers_, v_.resize(m_.nv);
  for (const FrictionInterface& p : interfaces_)
    if (p.kind == FrictionInterface::revolute || p.kind == FrictionInterface::prismatic)
      constraints_.pairs[p.pair].needs_Ra = true;
}

void ClosureFriction::update_slips(const double* v, bool within_step) {
  for (size_t k = 0; k < interfaces_.size(); ++k) {
    const FrictionInterface& interface = interfaces_[k];
    double* e = &e_[k * m_.nv];
    std::fill(e, e + m_.nv, 0.0), speed_[k] = factor_[k] = 0;
    if (!active_[k]) continue;
    Pair& pair = constraints_.pairs[interface.pair];
    double w[6];
    pair.update_poses(m_);
    interface.kind == FrictionInterface::rolling ? no_slip_wrench(k, v, within_step, w) : slip_wrench(interface, v, w);
    pair.generalized_force(m_, w, 1, e);
    speed_[k] = dot(e, v, m_.nv);
    factor_[k] = -interface.coefficient *
                 (interface.kind == FrictionInterface::rolling ? 1 : std::tanh(speed_[k] / interface.width));
  }
}

bool ClosureFriction::has_planar_slip() const {
  for (size_t k = 0; k < interfaces_.size(); ++k)
    if (active_[k] && interfaces_[k].no_slip_rows.size() > 1) return true;
  return false;
}

void ClosureFriction::begin_step(const double* v) {
  double W[2][6], slip_velocity[2];
  for (size_t k = 0; k < interfaces_.size(); ++k) {
    if (!active_[k] || interfaces_[k].no_slip_rows.size() < 2) continue;
    constraints_.pairs[interfaces_[k].pair].update_poses(m_);
    const double size = slip(interfaces_[k], v, W, slip_velocity);
    if (size > m_.tolerances.clear_slip * smallest_slip && dot(slip_velocity, directions_ + 2 * k, 2) < 0)
      for (int i = 0; i < 2; ++i) directions_[2 * k + i] = slip_velocity[i] / size;
  }
}

double ClosureFriction::slip(const FrictionInterface& interface, const double* v, double (*W)[6],
                             double* slip_velocity) const {
  const Pair& pair = constraints_.pairs[interface.pair];
  double V[6];
  slip_velocity[0] = slip_velocity[1] = 0;
  pair.relative(m_, v, V);
  for (size_t i = 0; i < interface.no_slip_rows.size(); ++i)
    constraints_.rows[interface.no_slip_rows[i]].wrench(pair, W[i]), slip_velocity[i] = dot(W[i], V, 6);
  return std::sqrt(dot(slip_velocity, slip_velocity, 2));
}

void ClosureFriction::no_slip_wrench(size_t k, const double* v, bool within_step, double* w) {
  const FrictionInterface& interface = interfaces_[k];
  const Tolerances& tolerances = m_.tolerances;
  const size_t m = interface.no_slip_rows.size();
  double W[2][6], slip_velocity[2], *directions = directions_ + 2 * k;
  const double size = slip(interface, v, W, slip_velocity);
  if (size > smallest_slip) {
    for (double& x : slip_velocity) x /= size;
    const double component = dot(slip_velocity, directions, 2);
    if (component < 0 && (within_step || size <= tolerances.clear_slip * smallest_slip))
      for (double& x : slip_velocity) x = -x;
    if (within_step && std::fabs(component) > tolerances.slip_cosine)
      std::copy(slip_velocity, slip_velocity + m, directions);
  } else {
    std::copy(directions, directions + m, slip_velocity);
  }
  std::copy(slip_velocity, slip_velocity + m, &slips_[2 * k]);
  std::fill(w, w + 6, 0.0);
  for (size_t i = 0; i < m; ++i)
    for (int j = 0; j < 6; ++j) w[j] += slip_velocity[i] * W[i][j];
}

void ClosureFriction::slip_wrench(const FrictionInterface& interface, const double* v, double* w) {
  const Pair& pair = constraints_.pairs[interface.pair];
  double n[6], V[6];
  const double* p = pair.pb;
  std::fill(w, w + 6, 0.0);
  auto normalize = [&](double* x) {
    const double size = norm(x, 3) + m_.tolerances.tiny;
    for (int i = 0; i < 3; ++i) x[i] /= size;
  };
  if (interface.kind == FrictionInterface::revolute) return rotate(pair.Ra, interface.axis, w + 3);
  pair.relative(m_, v, V);
  if (interface.kind == FrictionInterface::spherical) return std::copy(V + 3, V + 6, w + 3), normalize(w + 3);
  if (interface.kind == FrictionInterface::prismatic) {
    rotate(pair.Ra, interface.axis, w);
  } else {
    const Row& first = constraints_.rows[interface.row];
    first.wrench(pair, n);
    if (first.kind == Row::height) p = pair.contact(first.shape).p.x;
    cross(V + 3, p, w);
    for (int i = 0; i < 3; ++i) w[i] += V[i];
    const double normal_part = dot(n, w);
    for (int i = 0; i < 3; ++i) w[i] -= n[i] * normal_part;
    normalize(w);
  }
  cross(p, w, w + 3);
}

// Dependent rows G_D = C G_R give the null vectors (-C^T n, n) of G^T; the norm is minimal if (1 + C C^T) n = C lam.
void ClosureFriction::prepare_minimum_norm(const double* G) {
  const std::vector<int>&rows = rows_.in_use(), &remaining = rows_.remaining();
  const int r = static_cast<int>(rows.size()), d = static_cast<int>(remaining.size());
  C_.clear(), P_.clear();
  if (!r || !d) return;
  Vector G_in_use, G_remaining, column(d);  // by columns
  const size_t nv = m_.nv;
  for (int k : rows) G_in_use.insert(G_in_use.end(), G + k * nv, G + (k + 1) * nv);
  for (int k : remaining) G_remaining.insert(G_remaining.end(), G + k * nv, G + (k + 1) * nv);
  least_squares(m_.nv, r, G_in_use.data(), d, G_remaining.data());
  for (int i = 0; i < d; ++i) C_.insert(C_.end(), &G_remaining[i * nv], &G_remaining[i * nv] + r);
  DenseLU<1> normal;
  normal.resize(d);
  for (int j = 0; j < d; ++j)
    for (int i = 0; i < d; ++i) normal.column(j)[i] = (i == j) + dot(&C_[i * r], &C_[j * r], r);
  normal.factorize();
  P_.resize(C_.size());
  for (int j = 0; j < r; ++j) {
    for (int i = 0; i < d; ++i) column[i] = C_[i * r + j];
    normal.solve(column.data());
    for (int i = 0; i < d; ++i) P_[i * r + j] = column[i];
  }
}

void ClosureFriction::minimum_norm(const double* lam, double* all) const {
  const std::vector<int>&rows = rows_.in_use(), &remaining = rows_.remaining();
  std::fill(all, all + all_multipliers_.size(), 0.0);
  for (int k : rows) all[k] = lam[k];
  if (C_.empty()) return;
  const size_t r = rows.size();
  for (size_t i = 0; i < remaining.size(); ++i) {
    double n = 0;
    for (size_t j = 0; j < r; ++j) n += P_[i * r + j] * lam[rows[j]];
    all[remaining[i]] = n;
    for (size_t j = 0; j < r; ++j) all[rows[j]] -= C_[i * r + j] * n;
  }
}

double ClosureFriction::force_magnitude(const FrictionInterface& interface, const double* all, double* gradient) const {
  const double* F = all + interface.row;
  const double size = norm(F, interface.components);
  for (int i = 0; i < interface.components; ++i) gradient[i] = F[i] / (size + m_.tolerances.tiny);
  return size;
}

void ClosureFriction::solve_forces(const Vector& lam, const Vector& responses) {
  const Tolerances& tolerances = m_.tolerances;
  const int k = static_cast<int>(interfaces_.size());
  const size_t ng = lam.size();
  std::fill(T_.begin(), T_.end(), 0.0);
  double last = INFINITY;
  Vector multipliers, correction(k);
  DenseLU<1> partials;
  for (int it = 0; it < tolerances.friction_iterations; ++it) {
    multipliers = lam;
    for (int i = 0; i < k; ++i)
      for (size_t j = 0; j < ng; ++j) multipliers[j] += T_[i] * responses[i * ng + j];
    bool is_jammed = false;
    partials.resize(k);
    for (int i = 0; i < k; ++i) {
      const FrictionInterface& interface = interfaces_[i];
      double gradient[6];
      correction[i] = factor_[i] * force_magnitude(interface, multipliers.data(), gradient) - T_[i];
      for (int j = 0; j < k; ++j)
        partials.column(j)[i] =
            (i == j) - factor_[i] * dot(gradient, &responses[j * ng + interface.row], interface.components);
      is_jammed = is_jammed || !(partials.column(i)[i] > 0);
    }
    if (is_jammed || !partials.factorize() || !partials.positive_determinant()) throw FallBackToPython();
    partials.solve(correction.data());
    for (int i = 0; i < k; ++i) T_[i] += correction[i];
    const double change = largest(correction.data(), k), size = largest(T_.data(), k);
    if (change <= tolerances.rounding * size || (change >= 0.5 * last && change <= tolerances.solution_rounding * size))
      return;
    last = change;
  }
  throw FallBackToPython();
}

double ClosureFriction::solve(SaddleSystem& saddle, const double* G, const Vector& Zhat, double* rhs, double* f) {
  const size_t k = interfaces_.size(), ng = all_multipliers_.size(), nv = m_.nv;
  Vector lam(k * ng, 0.0), responses(k * ng), accelerations(e_);
  prepare_minimum_norm(G);
  saddle.solve(Zhat, rhs, f);
  minimum_norm(rhs, all_multipliers_.data());
  for (size_t i = 0; i < k; ++i) {
    if (active_[i]) saddle.solve_uncounted(Zhat, &lam[i * ng], &accelerations[i * nv]);
    minimum_norm(&lam[i * ng], &responses[i * ng]);
  }
  solve_forces(all_multipliers_, responses);
  for (size_t i = 0; i < k; ++i) {
    for (size_t j = 0; j < nv; ++j) f[j] += T_[i] * accelerations[i * nv + j];
    for (int row : rows_.in_use()) rhs[row] += T_[i] * lam[i * ng + row];
  }
  return dot(T_.data(), speed_.data(), static_cast<int>(k));
}

double ClosureFriction::add(const double* G, const double* lam, double* tau) {
  double gradient[6];
  prepare_minimum_norm(G), minimum_norm(lam, all_multipliers_.data());
  for (size_t i = 0; i < interfaces_.size(); ++i)
    T_[i] = factor_[i] * force_magnitude(interfaces_[i], all_multipliers_.data(), gradient);
  for (size_t i = 0; i < interfaces_.size(); ++i)
    for (int j = 0; j < m_.nv; ++j) tau[j] += T_[i] * e_[i * m_.nv + j];
  return dot(T_.data(), speed_.data(), static_cast<int>(T_.size()));
}

void ClosureFriction::write_multipliers(double* lam) const {
  for (size_t k = 0; k < interfaces_.size(); ++k) {
    const std::vector<int>& no_slip = interfaces_[k].no_slip_rows;
    for (size_t i = 0; active_[k] && i < no_slip.size(); ++i) lam[no_slip[i]] = T_[k] * slips_[2 * k + i];
  }
}

void ClosureFriction::partials(const double* G, const double* lam, Vector& out) {
  const std::vector<int>& rows = rows_.in_use();
  const size_t width = m_.nv + 1;
  out.assign(rows.size() * width, 0.0);
  prepare_minimum_norm(G), minimum_norm(lam, all_multipliers_.data());
  Vector unit(all_multipliers_.size());
  for (size_t r = 0; r < rows.size(); ++r) {
    unit[rows[r]] = 1, minimum_norm(unit.data(), unit_response_.data()), unit[rows[r]] = 0;
    for (size_t i = 0; i < interfaces_.size(); ++i) {
      double gradient[6];
      force_magnitude(interfaces_[i], all_multipliers_.data(), gradient);
      const double gain = factor_[i] * dot(gradient, &unit_response_[interfaces_[i].row], interfaces_[i].components);
      for (int j = 0; j < m_.nv; ++j) out[r * width + j] += gain * e_[i * m_.nv + j];
      out[r * width + m_.nv] += gain * speed_[i];
    }
  }
}

}  // namespace mbdae
