#include "system/closure_friction.hpp"

#include <algorithm>
#include <cmath>

#include "math/dense_lu.hpp"
#include "math/vec3.hpp"
#include "system/saddle.hpp"

namespace mbdae {

ClosureFriction::ClosureFriction(const Mechanics& m, Constraints& constraints, const IndependentRows& rows)
    : still(m.limits.still), m_(m), constraints_(constraints), rows_(rows) {}

void ClosureFriction::use(std::vector<FrictionInterface> places, const std::uint8_t* active, double* heading) {
  places_ = std::move(places), active_ = active, heading_ = heading;
  const auto k = static_cast<Eigen::Index>(places_.size());
  e_.setZero(k, m_.nv), speed_.setZero(k), factor_.setZero(k), T_.setZero(k);
  all_.assign(constraints_.rows.size(), 0.0), one_ = all_, v_.resize(m_.nv);
  for (const FrictionInterface& p : places_)
    if (p.kind == FrictionInterface::turns || p.kind == FrictionInterface::slides) constraints_.pairs[p.pair].turns_a = true;
}

ClosureFriction::operator bool() const {
  return std::any_of(active_, active_ + places_.size(), [](std::uint8_t x) { return x != 0; });
}

void ClosureFriction::slips(const double* v) {
  for (size_t k = 0; k < places_.size(); ++k) {
    const FrictionInterface& place = places_[k];
    e_.row(k).setZero(), speed_[k] = factor_[k] = 0;
    if (!active_[k]) continue;
    Pair& pair = constraints_.pairs[place.pair];
    double w[6];
    pair.locate(m_);
    place.kind == FrictionInterface::grips ? along_grip(k, v, w) : along(place, v, w);
    pair.torque(m_, w, 1, &e_(k, 0));
    speed_[k] = dot(&e_(k, 0), v, m_.nv);
    factor_[k] = -place.coefficient * (place.kind == FrictionInterface::grips ? 1 : std::tanh(speed_[k] / place.width));
  }
}

void ClosureFriction::along_grip(size_t k, const double* v, double* w) {
  const FrictionInterface& place = places_[k];
  const Pair& pair = constraints_.pairs[place.pair];
  const Tolerances& limits = m_.limits;
  const size_t m = place.grip.size();
  double W[2][6], V[6], now[2] = {0, 0}, *heading = heading_ + 2 * k;
  pair.relative(m_, v, V);
  for (size_t i = 0; i < m; ++i) constraints_.rows[place.grip[i]].wrench(pair, W[i]), now[i] = dot(W[i], V, 6);
  const double size = std::sqrt(dot(now, now, 2));
  if (size > still) {
    for (double& x : now) x /= size;
    const double ahead = dot(now, heading, 2);
    if (ahead < 0)
      for (double& x : now) x = -x;
    if (std::fabs(ahead) > limits.turned) std::copy(now, now + m, heading);
  } else {
    std::copy(heading, heading + m, now);
  }
  std::fill(w, w + 6, 0.0);
  for (size_t i = 0; i < m; ++i)
    for (int j = 0; j < 6; ++j) w[j] += now[i] * W[i][j];
}

void ClosureFriction::along(const FrictionInterface& place, const double* v, double* w) {
  const Pair& pair = constraints_.pairs[place.pair];
  double n[6], V[6];
  const double* p = pair.pb;
  std::fill(w, w + 6, 0.0);
  auto unit = [&](double* x) {
    const double size = norm(x, 3) + m_.limits.nothing;
    for (int i = 0; i < 3; ++i) x[i] /= size;
  };
  if (place.kind == FrictionInterface::turns) return turn(pair.Ra, place.axis, w + 3);
  pair.relative(m_, v, V);
  if (place.kind == FrictionInterface::bears) return std::copy(V + 3, V + 6, w + 3), unit(w + 3);
  if (place.kind == FrictionInterface::slides) {
    turn(pair.Ra, place.axis, w);
  } else {
    const Row& first = constraints_.rows[place.row];
    first.wrench(pair, n);
    if (first.kind == Row::height) p = pair.touch(first.shape, false).p;
    cross(V + 3, p, w);
    for (int i = 0; i < 3; ++i) w[i] += V[i];
    const double off = dot(n, w);
    for (int i = 0; i < 3; ++i) w[i] -= n[i] * off;
    unit(w);
  }
  cross(p, w, w + 3);
}

// Dependent rows G_D = C G_R give the null vectors (-C^T n, n) of G^T; the norm is least where (1 + C C^T) n = C lam.
void ClosureFriction::spread(const double* G) {
  const std::vector<int>&rows = rows_.in_use(), &others = rows_.others();
  const auto r = static_cast<Eigen::Index>(rows.size()), d = static_cast<Eigen::Index>(others.size());
  C_.setZero(d, r);
  if (!r || !d) return;
  Numbers used, rest;  // by columns
  const size_t nv = m_.nv;
  for (int k : rows) used.insert(used.end(), G + k * nv, G + (k + 1) * nv);
  for (int k : others) rest.insert(rest.end(), G + k * nv, G + (k + 1) * nv);
  least_squares(m_.nv, static_cast<int>(r), used.data(), static_cast<int>(d), rest.data());
  for (Eigen::Index i = 0; i < d; ++i) C_.row(i) = Vector<double>::Map(&rest[i * nv], r);
  DenseLU<1> normal;
  normal.resize(static_cast<int>(d));
  for (Eigen::Index j = 0; j < d; ++j)
    for (Eigen::Index i = 0; i < d; ++i) normal.column(j)[i] = (i == j) + C_.row(i).dot(C_.row(j));
  normal.factorize();
  Eigen::MatrixXd P = C_;
  for (Eigen::Index j = 0; j < r; ++j) normal.solve(&P(0, j));
  P_ = P;
}

void ClosureFriction::whole(const double* lam, double* all) const {
  const std::vector<int>&rows = rows_.in_use(), &others = rows_.others();
  std::fill(all, all + all_.size(), 0.0);
  for (int k : rows) all[k] = lam[k];
  if (!C_.size()) return;
  Vector<double> used(rows.size());
  for (size_t i = 0; i < rows.size(); ++i) used[i] = lam[rows[i]];
  const Vector<double> n = P_ * used;
  used -= C_.transpose() * n;
  for (size_t i = 0; i < rows.size(); ++i) all[rows[i]] = used[i];
  for (size_t i = 0; i < others.size(); ++i) all[others[i]] = n[i];
}

double ClosureFriction::carried(const FrictionInterface& place, const double* all, double* gradient) const {
  const double* F = all + place.row;
  const double size = norm(F, place.carried);
  for (int i = 0; i < place.carried; ++i) gradient[i] = F[i] / (size + m_.limits.nothing);
  return size;
}

void ClosureFriction::forces(const Numbers& lam, const Rows<double>& responses) {
  const Tolerances& limits = m_.limits;
  const auto k = static_cast<Eigen::Index>(places_.size());
  const auto ng = static_cast<Eigen::Index>(lam.size());
  T_.setZero(k);
  double last = INFINITY;
  for (int it = 0; it < limits.loading; ++it) {
    const Vector<double> now = Vector<double>::Map(lam.data(), ng) + responses.transpose() * T_;
    DenseLU<1> partials;
    Vector<double> move(k);
    bool wedged = false;
    partials.resize(static_cast<int>(k));
    for (Eigen::Index i = 0; i < k; ++i) {
      const FrictionInterface& place = places_[i];
      double gradient[6];
      move[i] = factor_[i] * carried(place, now.data(), gradient) - T_[i];
      for (Eigen::Index j = 0; j < k; ++j)
        partials.column(j)[i] = (i == j) - factor_[i] * dot(gradient, &responses(j, place.row), place.carried);
      wedged = wedged || !(partials.column(i)[i] > 0);
    }
    if (wedged || !partials.factorize() || !partials.positive_determinant()) throw FallBackToPython();
    partials.solve(move.data());
    T_ += move;
    const double change = move.cwiseAbs().maxCoeff(), size = T_.cwiseAbs().maxCoeff();
    if (change <= limits.loaded * size || (change >= 0.5 * last && change <= limits.settled * size)) return;
    last = change;
  }
  throw FallBackToPython();
}

double ClosureFriction::solve(SaddleSystem& saddle, const double* G, const Numbers& Zhat, double* rhs, double* f) {
  const auto k = static_cast<Eigen::Index>(places_.size());
  const auto ng = static_cast<Eigen::Index>(all_.size());
  Rows<double> lam = Rows<double>::Zero(k, ng), responses(k, ng), moves(e_);
  spread(G);
  saddle.solve(Zhat, rhs, f);
  whole(rhs, all_.data());
  for (Eigen::Index i = 0; i < k; ++i) {
    if (active_[i]) saddle.respond(Zhat, &lam(i, 0), &moves(i, 0));
    whole(&lam(i, 0), &responses(i, 0));
  }
  forces(all_, responses);
  for (Eigen::Index i = 0; i < k; ++i) {
    for (int j = 0; j < m_.nv; ++j) f[j] += T_[i] * moves(i, j);
    for (int row : rows_.in_use()) rhs[row] += T_[i] * lam(i, row);
  }
  return T_.dot(speed_);
}

double ClosureFriction::add(const double* G, const double* lam, double* tau) {
  double gradient[6];
  spread(G), whole(lam, all_.data());
  for (size_t i = 0; i < places_.size(); ++i) T_[i] = factor_[i] * carried(places_[i], all_.data(), gradient);
  for (size_t i = 0; i < places_.size(); ++i)
    for (int j = 0; j < m_.nv; ++j) tau[j] += T_[i] * e_(i, j);
  return T_.dot(speed_);
}

void ClosureFriction::partials(const double* G, const double* lam, Numbers& out) {
  const std::vector<int>& rows = rows_.in_use();
  const size_t width = m_.nv + 1;
  out.assign(rows.size() * width, 0.0);
  spread(G), whole(lam, all_.data());
  Numbers unit(all_.size());
  for (size_t r = 0; r < rows.size(); ++r) {
    unit[rows[r]] = 1, whole(unit.data(), one_.data()), unit[rows[r]] = 0;
    for (size_t i = 0; i < places_.size(); ++i) {
      double gradient[6];
      carried(places_[i], all_.data(), gradient);
      const double by = factor_[i] * dot(gradient, &one_[places_[i].row], places_[i].carried);
      for (int j = 0; j < m_.nv; ++j) out[r * width + j] += by * e_(i, j);
      out[r * width + m_.nv] += by * speed_[i];
    }
  }
}

}  // namespace mbdae
