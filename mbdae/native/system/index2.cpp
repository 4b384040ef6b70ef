// Forces, accelerations from the hidden constraint, updates between steps.
#include "system/index2.hpp"

#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"
#include "system/projection.hpp"

namespace mbdae {

Index2System::Index2System(const void* model, const Tolerances& tolerances, Description d)
    : tree(model, tolerances, std::move(d.flexible)),
      constraints(tree, std::move(d.rows), d.pairs, std::move(d.drivers)),
      manifold(tree, d.flat, std::move(d.group_joints), std::move(d.angular)),
      rows(constraints, std::move(d.order), tree.nv, tree.tolerances),
      point(tree, constraints, counts),
      saddle(point, constraints, rows, tree.tolerances, counts, tree.nv),
      friction(tree, constraints, rows),
      formulation(d.formulation),
      nq(tree.nq),
      nv(tree.nv),
      ng(static_cast<int>(constraints.rows.size())),
      ns(d.ns),
      nz(formulation == Formulation::ggl ? 2 * ng : ng),
      ny(2 * nv + ns + 1),
      length(nq + nv + ns + 1),
      joint_friction(ng),
      probe_(std::move(d.probe)),
      alpha_(d.alpha),
      beta_(d.beta),
      nonconservative_(nv),
      f_(nv),
      lam_(ng),
      gt_(ng),
      g_(ng),
      rate_(ng) {
  set_laws(std::move(d.laws), d.law_pairs), use_nodes(d);
}

void Index2System::use_nodes(const Description& d) {
  std::vector<int> frames;
  for (const auto* pairs : {&d.pairs, &d.law_pairs})
    for (const auto& p : *pairs) frames.push_back(p.first.joint), frames.push_back(p.second.joint);
  tree.use_nodes(frames);
}

void Index2System::set_laws(std::vector<Law> laws, const std::vector<std::pair<Anchor, Anchor>>& pairs) {
  const auto supports = tree.supports();
  laws_ = std::move(laws), law_pairs_.clear();
  law_pairs_.reserve(pairs.size());
  for (auto& p : pairs) law_pairs_.emplace_back(p.first, p.second, supports);
  for (Law& law : laws_)
    if (law.pair >= 0) law.frames = &law_pairs_[law.pair];
}

bool Index2System::write(const void* model, const Tolerances& tolerances, Description d) {
  if (d.formulation != formulation || d.alpha != alpha_ || d.beta != beta_ || d.ns != ns) return false;
  if (d.laws.size() != laws_.size() || d.law_pairs.size() != law_pairs_.size()) return false;
  for (size_t k = 0; k < laws_.size(); ++k)
    if (d.laws[k].kind != laws_[k].kind || d.laws[k].pair != laws_[k].pair || d.laws[k].state != laws_[k].state ||
        d.laws[k].states != laws_[k].states)
      return false;
  if (!tree.has_same_structure(d.flexible)) return false;
  Constraints new_constraints(tree, std::move(d.rows), d.pairs, std::move(d.drivers));
  if (!constraints.has_structure_of(new_constraints)) return false;
  constraints.write(std::move(new_constraints));
  set_laws(std::move(d.laws), d.law_pairs);
  tree.write(model, tolerances, std::move(d.flexible)), use_nodes(d), reset();
  return true;
}

void Index2System::select_rows_of_step(const double* y) {
  if (friction.has_planar_slip()) tree.poses(y), friction.begin_step(y + nq);
  if (!ng || rows.frozen) return;
  if (!point.is_current(y)) point.evaluate(y, true);
  rows.select_if_triggered(point.Z, point.stamp());
}

void Index2System::use_rows(const std::vector<int>& in_use, int rank, double floor, bool frozen) {
  point.invalidate();
  rows.use(in_use, rank, floor, frozen);
}

void Index2System::reset() {
  point.invalidate();
  rows.reset();
  last_stage.t = NAN, accuracy = 0, largest_g = largest_rate = largest_speed = 0, counts = {};
}

bool Index2System::change_law(int k, const Vector& a) {
  if (k < 0 || k >= static_cast<int>(laws_.size()) || laws_[k].a.size() != a.size()) return false;
  laws_[k].a = a, last_stage.t = NAN;
  return true;
}

double* Index2System::law_parameter(int k, int i) {
  if (k < 0 || k >= static_cast<int>(laws_.size()) || i < 0) return nullptr;
  Law& law = laws_[k];
  return static_cast<size_t>(i) < law.a.size() ? &law.a[i] : &law.offset;
}

bool Index2System::update_parameters() {
  const Sizes sizes{nq, nv, tree.joints};
  tree.refresh(), point.invalidate(), last_stage.t = NAN;
  return std::all_of(laws_.begin(), laws_.end(), [&](Law& law) { return law.kind->is_valid(law, sizes); });
}

void Index2System::set_input(int input, double t, double value, double rate) {
  for (Law& law : laws_)
    for (TimeFunction& u : law.signals) u.set(input, t, value, rate);
  for (Driver& driver : constraints.drivers) driver.motion.set(input, t, value, rate);
  for (SampledController& controller : samplers) controller.reference.set(input, t, value, rate);
  last_stage.t = NAN;
}

void Index2System::deactivate_rows(std::vector<bool> inactive, bool has_sticking_joints) {
  constraints.inactive = std::move(inactive), constraints.has_sticking_joints = has_sticking_joints;
  point.invalidate();
  for (Vector* rows : {&point.G, &point.Z, &point.scratch_G}) std::fill(rows->begin(), rows->end(), 0.0);
}

void Index2System::probe_other_rows() {
  if (rows.has_many() && rows.dependent() && !saddle.remaining_rows_dependent(probe_))
    rows.remaining_independent = true;
}

void Index2System::generalized_force(double t, const double* q, const double* v, const double* s, double* tau,
                                     double* rates) {
  counts.f += 1;
  std::fill_n(tau, nv, 0.0), rates[ns] = 0;
  if (laws_.empty()) return;
  std::fill(nonconservative_.begin(), nonconservative_.end(), 0.0);
  for (const Law& law : laws_) law.add(tree, t, q, v, s + law.state, tau, nonconservative_.data(), rates + law.state);
  rates[ns] = dot(nonconservative_.data(), v, nv);
  for (int i = 0; i < nv; ++i) tau[i] += nonconservative_[i];
}

void Index2System::forces(double t, const double* q, const double* v, const double* s, double* f, double* rates,
                          bool biased) {
  generalized_force(t, q, v, s, f, rates);
  if (!biased) tree.bias(q, v);
  const double* bias = tree.bias();
  for (int i = 0; i < nv; ++i) f[i] -= bias[i];
  if (!finite(f, nv)) throw FallBackToPython();
}

void Index2System::solve(const Vector& Zhat, double* rhs, double* f, double* power) {
  if (friction)
    *power += friction.solve(saddle, rows.dependent() ? constraints.dense(point.G).data() : nullptr, Zhat, rhs, f);
  else
    saddle.solve(Zhat, rhs, f);
}

void Index2System::accelerate(double t, const double* q, const double* v, const double* s, double* vdot,
                              double* rates, bool biased) {
  if (friction) friction.update_slips(v, false);
  forces(t, q, v, s, vdot, rates, biased);
  if (ng) {
    if (!rows.frozen) rows.select_if_triggered(point.Z, point.stamp());
    std::fill(gt_.begin(), gt_.end(), 0.0);
    constraints.evaluate_g_tt(t, gt_.data());
    constraints.bias(tree, q, v, rows.in_use(), lam_.data(), true);
    for (int k : rows.in_use()) lam_[k] = -(lam_[k] + gt_[k]);
    std::fill(gt_.begin(), gt_.end(), 0.0);
    constraints.evaluate_g_t(t, gt_.data());
    if (alpha_ != 0 || beta_ != 0) {
      g_ = point.g;
      constraints.complete_g(t, g_.data()), residual_rate(t, v, rate_.data());
      for (int k : rows.in_use()) lam_[k] -= 2 * alpha_ * rate_[k] + beta_ * beta_ * g_[k];
    }
  }
  saddle.factorize_symmetric();
  solve(point.Z, lam_.data(), vdot, rates + ns);
  for (int k : rows.in_use()) rates[ns] -= lam_[k] * gt_[k];
}

bool Index2System::is_last_stage(double t, const double* q, const double* v, const double* s) const {
  auto agrees = [&](const double* x, const double* y, int n, const std::vector<double>* scales = nullptr) {
    double size = 0;
    for (int i = 0; i < n; ++i) size = std::max(size, std::fabs(x[i]) / (scales ? (*scales)[i] : 1));
    for (int i = 0; i < n; ++i)  // false for nan, the time of an invalid stage
      if (!(std::fabs(x[i] - y[i]) <= tree.tolerances.rounding * size * (scales ? (*scales)[i] : 1))) return false;
    return true;
  };
  if (last_stage.motion_stamp != tree.motion_stamp()) return false;
  return agrees(&t, &last_stage.t, 1) && agrees(q, last_stage.q.data(), nq, &tree.tolerances.q_scales) &&
         agrees(v, last_stage.v.data(), nv, &tree.tolerances.coordinate_scales) && agrees(s, last_stage.s.data(), ns);
}

void Index2System::derivative(double t, const double* y, double* F, double* z) {
  const double *q = y, *v = y + nq, *s = v + nv;
  const bool current = point.is_exactly_current(q);
  if (current) {
    tree.poses(q);
    counts.M += 1, counts.factorizations += 1, counts.G += ng > 0;
  } else {
    point.evaluate(q, true, v);
  }
  std::copy(v, v + nv, F);
  accelerate(t, q, v, s, F + nv, F + 2 * nv, !current);
  saddle.all_multipliers(lam_.data(), z);
}

void Index2System::hidden_derivative(double t, const double* y, double* F, double* z) {
  const double *q = y, *v = y + nq, *s = v + nv;
  double *f = F + nv, *rates = F + 2 * nv;
  const bool current = point.is_current(q), reuse_stage = current && is_last_stage(t, q, v, s);
  if (!current)
    point.evaluate(q, false);
  else
    reuse_stage && !friction && !rows.in_use().empty() ? tree.restore_poses() : tree.poses(q);
  if (friction) friction.update_slips(v, false);
  if (reuse_stage)
    std::copy(last_stage.f.begin(), last_stage.f.end(), f),
        std::copy(last_stage.rates.begin(), last_stage.rates.end(), rates);
  else
    forces(t, q, v, s, f, rates);
  std::copy(v, v + nv, F);
  constraints.bias(tree, q, v, rows.in_use(), lam_.data(), true);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.evaluate_g_tt(t, gt_.data());
  for (int k : rows.in_use()) lam_[k] = -(lam_[k] + gt_[k]);
  if (friction)
    saddle.factorize_symmetric(), solve(point.Z, lam_.data(), f, rates + ns);
  else
    saddle.solve_uncounted(lam_.data(), f);
  std::fill(gt_.begin(), gt_.end(), 0.0);
  constraints.evaluate_g_t(t, gt_.data());
  for (int k : rows.in_use()) rates[ns] -= lam_[k] * gt_[k];
  saddle.all_multipliers(lam_.data(), z);
}

Vector Index2System::carry(const Vector& F) const {
  Vector out(carry_length(), 0.0);
  std::copy(F.begin() + nv, F.end(), out.end() - (ny - nv));
  return out;
}

void Index2System::residual_rate(double t, const double* v, double* rate) const {
  std::fill(rate, rate + ng, 0.0);
  constraints.evaluate_g_t(t, rate);
  for (int k = 0; k < ng; ++k)
    rate[k] = constraints.times(k, point.G, v, rate[k]);
}

bool Index2System::update_independent_rows(double t, State& s) {
  if (!ng) return false;
  const double* q = s.y.data();
  double* v = s.y.data() + nq;
  if (!point.are_rows_current(q)) point.evaluate(q, true);
  const bool changed = rows.select_if_triggered(point.Z, point.stamp());
  residual_rate(t, v, rate_.data());
  if (changed && formulation != Formulation::index1) {
    if (!point.is_current(q)) point.evaluate(q, true);
    saddle.factorize_symmetric();
    saddle.minimum_norm_correction(rate_.data(), f_.data());
    for (int i = 0; i < nv; ++i) v[i] -= f_[i];
    s.memory.reset();
    if (!s.carry.empty()) {
      Vector F(ny), z(ng);
      derivative(t, s.y.data(), F.data(), z.data());
      s.carry = carry(F);
    }
    residual_rate(t, v, rate_.data());
  }
  if (formulation == Formulation::ggl && violates_velocity_constraints(*this, t, v)) throw FallBackToPython();
  g_ = point.g;
  constraints.complete_g(t, g_.data());
  const Tolerances& tolerances = tree.tolerances;
  largest_g = std::max(largest_g, largest_scaled(g_.data(), tolerances.row_scales));
  largest_rate = std::max(largest_rate, largest_scaled(rate_.data(), tolerances.row_scales));
  largest_speed = std::max(largest_speed, largest_scaled(v, tolerances.coordinate_scales));
  return changed;
}

SmallestPivot Index2System::smallest_pivot(const double* q, int rank) {
  if (!rank) return {};
  if (!point.is_current(q)) point.evaluate(q, false);
  return rows.smallest_pivot(point.Z, rank);
}

}  // namespace mbdae
