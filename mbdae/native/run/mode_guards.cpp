// Values, rates and references of guards at points of a step.
#include "run/mode_guards.hpp"

#include <algorithm>
#include <cmath>

#include "math/field_reader.hpp"
#include "math/vec3.hpp"
#include "run/row_space.hpp"

namespace mbdae {

std::vector<Guard> guards_of(const std::vector<Switch>& switches, const Mode& mode) {
  std::vector<Guard> out;
  for (size_t i = 0; i < switches.size(); ++i) {
    const Switch& x = switches[i];
    const int state = mode[i], index = static_cast<int>(i);
    const auto add = [&](Guard::Kind kind, double sign) { out.push_back({kind, index, sign}); };
    switch (x.kind) {
      case Switch::Kind::contact:
        add(state == released ? Guard::contact : Guard::separation, x.sign);
        if (x.frictional() && state != released) add(state == active ? Guard::slip : Guard::zero_velocity, 1);
        break;
      case Switch::Kind::ratchet:
        if (state == runs_back) {
          add(Guard::contact, 1), add(Guard::zero_velocity, -x.sign);
          break;
        }
        [[fallthrough]];
      case Switch::Kind::clutch:
        add(state == active ? Guard::separation : Guard::zero_velocity, x.sign);
        break;
      case Switch::Kind::stiction:
        if (state == active) add(Guard::slip, 1);
        if (state > active) add(Guard::zero_velocity, state == slips_forwards ? 1 : -1);
        break;
      case Switch::Kind::range:
        add(Guard::range_boundary, state == active ? 1 : -1);
    }
  }
  return out;
}

double largest_force(Index2System& s, const double* y, const double* F, const double* lam) {
  const int nv = s.nv;
  const double* a = F + nv;
  Vector inertial(nv, 0.0), reaction(nv, 0.0);
  s.tree.inertia(y);
  s.tree.add_inertial_force(a, inertial.data());
  for (int k = 0; k < s.ng; ++k) s.constraints.add(k, s.point.G, lam[k], reaction.data());
  return largest(inertial.data(), nv) + largest(reaction.data(), nv);
}

double stiction_utilization(const Index2System& s, const std::vector<Switch>& switches, const Mode& mode, int element,
                            const Vector& lam) {
  const int nv = s.nv;
  const double truncation = s.tree.tolerances.truncation;
  std::vector<const Switch*> sticking;
  std::vector<bool> not_sticking(s.ng, true);
  for (size_t i = 0; i < switches.size(); ++i)
    if (switches[i].kind == Switch::Kind::stiction && mode[i] == active)
      sticking.push_back(&switches[i]), not_sticking[switches[i].rows[0]] = false;
  std::vector<int> rows;
  for (int k : s.constraints.all)
    if (not_sticking[k] && (s.constraints.inactive.empty() || !s.constraints.inactive[k])) rows.push_back(k);
  const Vector Z = s.constraints.dense(s.point.Z);
  const RowSpace space(s, Z, rows);
  for (const Switch* x : sticking) rows.push_back(x->rows[0]);
  if (RowSpace(s, Z, rows).rank() == space.rank() + sticking.size())
    return lam[switches[element].rows[0]] / switches[element].limit;
  Vector first;
  double work = 0, limit = 0, size = 0;
  for (const Switch* x : sticking) {
    const double* row = &Z[static_cast<size_t>(x->rows[0]) * nv];
    Vector motion(row, row + nv);
    const double full_norm = norm(row, nv);
    space.project_out(motion);
    if (first.empty()) first = motion, size = norm(first.data(), nv);
    const double component = dot(motion.data(), first.data(), nv) / (size * size);
    for (int c = 0; c < nv; ++c) motion[c] -= component * first[c];
    if (!(std::fabs(component) * size > truncation * full_norm) || !(norm(motion.data(), nv) <= truncation * full_norm))
      throw FallBackToPython();
    work += component * lam[x->rows[0]], limit += std::fabs(component) * x->limit;
  }
  return work / limit;
}

bool GuardMonitor::has_rate(const Guard& guard) const {
  return guard.kind == Guard::contact || guard.kind == Guard::zero_velocity;
}

double GuardMonitor::speed(const Point& p) const {
  return modes_.characteristic_rate + largest_scaled(p.y.data() + s_.nq, s_.tree.tolerances.coordinate_scales);
}

void GuardMonitor::evaluate(Point& p) {
  const double *q = p.y.data(), *v = q + s_.nq;
  p.g.assign(s_.ng, 0.0), p.rate = p.acceleration = p.g;
  const bool dynamic = dynamic_ || !p.F.empty();
  if (dynamic) {
    if (p.F.empty()) {
      p.F.resize(s_.ny), p.lam.resize(s_.ng);
      s_.derivative(p.t, q, p.F.data(), p.lam.data());
    }
    p.force = largest_force(s_, q, p.F.data(), p.lam.data());
  }
  const AllRowsActive all(s_.constraints);
  s_.tree.poses(q);
  s_.constraints.value(s_.tree, q, rows_, G_.data(), p.g.data());
  s_.constraints.complete_g(p.t, p.g.data());
  s_.constraints.evaluate_g_t(p.t, p.rate.data());
  if (dynamic) {
    s_.tree.motions(q, v);
    s_.constraints.evaluate_g_tt(p.t, p.acceleration.data());
    Vector gamma(s_.ng);
    s_.constraints.bias(s_.tree, q, v, rows_, gamma.data());
    for (int k : rows_) p.acceleration[k] += gamma[k];
  }
  for (int k : rows_) {
    p.rate[k] = s_.constraints.times(k, G_, v, p.rate[k]);
    if (dynamic) p.acceleration[k] = s_.constraints.times(k, G_, p.F.data() + s_.nv, p.acceleration[k]);
  }
}

const GuardMonitor::Point& GuardMonitor::point(double theta) {
  for (const Point& p : points_)
    if (p.theta == theta) return p;
  Point p{theta, step_->t + theta * (step_->t1 - step_->t)};
  if (theta == 0 || theta == 1) {
    const double* y = theta == 0 ? step_->y : step_->y1;
    p.y.assign(y, y + s_.length);
  } else {
    p.y = (*partial_step_)(theta);
  }
  evaluate(p);
  points_.push_back(std::move(p));
  return points_.back();
}

double GuardMonitor::value(const Guard& guard, const Point& p) {
  const Switch& x = of(guard);
  switch (guard.kind) {
    case Guard::contact:
      if (x.kind == Switch::Kind::ratchet) return (x.teeth(p.y.data()) - guard.reference) * x.pitch;
      return guard.sign * p.g[x.rows[0]];
    case Guard::separation:
      return guard.sign * p.lam[x.rows[0]];
    case Guard::slip:
      if (x.frictional()) return 1 - std::fabs(monitored_multiplier(guard, p));
      if (!s_.point.is_current(p.y.data())) s_.point.evaluate(p.y.data(), false);
      return 1 - std::fabs(stiction_utilization(s_, modes_.switches, modes_.mode, guard.element, p.lam));
    case Guard::zero_velocity:
      return guard.sign * p.rate[x.rows[x.frictional()]];
    default:
      return guard.sign * x.depth(x.coordinate(p.y.data()));
  }
}

double GuardMonitor::rate(const Guard& guard, const Point& p) const {
  const Switch& x = of(guard);
  if (guard.kind == Guard::contact) return (x.kind == Switch::Kind::ratchet ? x.sign : guard.sign) * p.rate[x.rows[0]];
  return guard.kind == Guard::zero_velocity ? guard.sign * p.acceleration[x.rows[x.frictional()]] : 0;
}

double GuardMonitor::monitored_multiplier(const Guard& guard, const Point& p) {
  const Switch& x = of(guard);
  if (guard.kind == Guard::separation) return guard.sign * p.lam[x.rows[0]];
  if (!x.frictional()) return p.lam[x.rows[0]] / x.limit;
  return p.lam[x.rows[1]] / std::max(x.limit * std::fabs(p.lam[x.rows[0]]), s_.tree.tolerances.tiny);
}

void GuardMonitor::set_reference(Guard& guard, const Point& p) const {
  const Switch& x = of(guard);
  const Tolerances& tolerances = s_.tree.tolerances;
  if (guard.kind == Guard::contact && x.kind == Switch::Kind::ratchet)
    guard.reference = std::floor(x.teeth(p.y.data()) + modes_.coincident);
  if (guard.kind == Guard::zero_velocity && x.frictional()) {
    const double slip = p.rate[x.rows[1]];
    const double rest = modes_.mode_rounding * speed(p) * tolerances.row_scales[x.rows[1]];
    guard.sign = std::fabs(slip) > modes_.transverse * rest ? std::copysign(1.0, slip) : s_.friction.direction(x.interface);
  }
}

double GuardMonitor::unit(const Guard& guard, const Point& p) const {
  const double scale = s_.tree.tolerances.row_scales[of(guard).rows[0]];
  if (guard.monitors_multiplier()) return p.force;
  return guard.kind == Guard::zero_velocity ? scale * speed(p) : scale;
}

void GuardMonitor::prepare() {
  dynamic_ = std::any_of(modes_.guards.begin(), modes_.guards.end(), [&](const Guard& x) {
    return x.monitors_multiplier() || x.kind == Guard::zero_velocity;
  });
  rows_.clear();
  for (const Guard& x : modes_.guards)
    for (int k : of(x).rows)
      if (std::find(rows_.begin(), rows_.end(), k) == rows_.end()) rows_.push_back(k);
  G_.resize(s_.constraints.start.back());
}

void GuardMonitor::set_references(const Point& p) {
  if (std::exchange(has_references_, true)) return;
  for (Guard& guard : modes_.guards) set_reference(guard, p);
}

void GuardMonitor::track(double t, const double* y, const Vector& F, const Vector& lam) {
  modes_.guards = guards_of(modes_.switches, modes_.mode), points_.clear();
  has_references_ = true, prepare();
  Point p{0, t, Vector(y, y + s_.length)};
  p.F = F, p.lam = lam;
  evaluate(p);  // accelerations predict the duration of separations
  for (size_t i = 0; i < modes_.guards.size(); ++i) {
    Guard& guard = modes_.guards[i];
    set_reference(guard, p);
    const double f = value(guard, p), separation_speed = rate(guard, p);
    guard.unit = unit(guard, p), guard.size = std::fabs(f), guard.return_time = NAN;
    guard.level = guard.needs_multipliers() ? 0 : std::min(0.0, f);
    if (guard.kind != Guard::contact || of(guard).kind != Switch::Kind::contact) continue;
    const double a = guard.sign * p.acceleration[of(guard).rows[0]];
    if (f <= rounding(static_cast<int>(i)) && separation_speed > 0 && a < 0)
      guard.return_time = t - modes_.return_factor * 2 * separation_speed / a;
  }
  points_.push_back(std::move(p));
}

GuardMonitor::Values GuardMonitor::values(double t, const double* y, const Vector& F, const Vector& lam,
                                          bool advances) {
  Point p{0, t, Vector(y, y + s_.length)};
  p.F = F, p.lam = lam;
  if (!has_references_) prepare();
  evaluate(p), set_references(p);
  Values out;
  for (size_t i = 0; i < modes_.guards.size(); ++i) {
    const int k = static_cast<int>(i);
    out.guards.push_back(at(p, k)), out.tolerances.push_back(rounding(k));
  }
  if (advances) advance(p);
  return out;
}

double GuardMonitor::first_quarter_of_flight(int i) const {
  const Guard& guard = modes_.guards[i];
  const double impact = modes_.last_impact[guard.element];
  return std::isnan(guard.return_time) ? -INFINITY : impact + (guard.return_time - impact) / (4 * modes_.return_factor);
}

void GuardMonitor::advance(const Point& p) {
  for (Guard& guard : modes_.guards) {
    const double f = value(guard, p);
    guard.size = std::max(guard.size, std::fabs(f));
    if (f >= 0) guard.level = 0;
  }
}

void check(const Modes& m, const Index2System& s) {
  const auto outside = [](int i, size_t n) { return i < 0 || static_cast<size_t>(i) >= n; };
  for (const Switch& x : m.switches) {
    bool invalid = x.rows.empty() || x.positions.size() != x.factors.size() || x.column >= s.nv;
    for (int k : x.rows) invalid |= outside(k, s.ng);
    for (int k : x.positions) invalid |= outside(k, s.nq);
    invalid |= x.frictional() && (outside(x.interface, s.friction.size()) || x.rows.size() != 2);
    invalid |= x.kind == Switch::Kind::stiction && outside(x.column, s.law_size(x.law));
    invalid |= x.kind == Switch::Kind::range && (x.windows.empty() || x.column < 0);
    if (invalid) reject("a switch is not valid for the mechanism");
  }
  for (int k : m.unswitched)
    if (outside(k, s.ng)) reject("the index of a row is out of range");
}

}  // namespace mbdae
