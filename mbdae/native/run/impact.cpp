// Impacts: Newton's law with Coulomb friction (mbdae/mechanism/hybrid/impact.py, impact_law.py).
#include <algorithm>
#include <cmath>

#include "math/vec3.hpp"
#include "run/mode_transition.hpp"

namespace mbdae {

ModeTransition::ModeTransition(Index2System& s, const Modes& modes)
    : s_(s), modes_(modes), tolerances_(s.tree.tolerances), mode_(modes.mode) {
  g_.assign(s.ng, 0.0), g_t_ = rate_ = gamma_ = g_;
}

void ModeTransition::evaluate(double t, const double* y) {
  t_ = t, y_ = y;
  if (!s_.point.is_current(y)) s_.point.evaluate(y, false);
  const AllRowsActive all(s_.constraints);
  s_.tree.poses(y);
  Vector G(s_.constraints.start.back()), Z(G.size());
  s_.constraints.value(s_.tree, y, s_.constraints.all, G.data(), g_.data());
  s_.constraints.complete_g(t, g_.data());
  s_.constraints.evaluate_g_t(t, g_t_.data());
  s_.point.scale_rows(s_.constraints.all, G, Z);
  G_ = s_.constraints.dense(G), Z_ = s_.constraints.dense(Z);
  update_rates();
}

void ModeTransition::update_rates() {
  const double* v = y_ + s_.nq;
  for (int k : s_.constraints.all) rate_[k] = dot(row(k), v, s_.nv) + g_t_[k];
  speed_ = modes_.characteristic_rate + largest_scaled(v, tolerances_.coordinate_scales);
}

bool ModeTransition::in_contact(int i) const {
  const Switch& x = modes_.switches[i];
  return modes_.mode[i] != released || x.sign * g_[x.rows[0]] <= gap_limit(x);
}

bool ModeTransition::in_tooth(const Switch& x) const {
  const double position = x.teeth(y_);
  return std::fabs(position - std::nearbyint(position)) < modes_.coincident;
}

bool ModeTransition::inside(const Switch& x) const {
  const double v = y_[s_.nq + x.column];
  const double offset = modes_.lookahead * tolerances_.coordinate_scales[x.column] * ((v > 0) - (v < 0));
  return x.depth(x.coordinate(y_) + offset) > 0;
}

std::vector<ModeTransition::ImpactRow> ModeTransition::impact_rows(int i) const {
  const Switch& x = modes_.switches[i];
  std::vector<ImpactRow> out;
  switch (x.kind) {
    case Switch::Kind::contact:
      if (!in_contact(i)) break;
      out.push_back({i, x.rows[0], x.sign, x.restitution});
      for (size_t k = 1; k < x.rows.size(); ++k)
        out.push_back({i, x.rows[k], 0, 0, x.frictional() ? x.friction : NAN});
      break;
    case Switch::Kind::ratchet:
      if (modes_.mode[i] != active && !in_tooth(x)) break;
      [[fallthrough]];
    case Switch::Kind::clutch:
      out.push_back({i, x.rows[0], x.sign});
      break;
    case Switch::Kind::range:
      if (inside(x))
        for (int k : x.rows) out.push_back({i, k, 0});
      break;
    case Switch::Kind::stiction:
      break;
  }
  return out;
}

bool ModeTransition::resolve_impact(double* y, const std::vector<int>& resting, Transition& out) {
  const std::vector<double>& scales = tolerances_.row_scales;
  const double speed = speed_, rest = modes_.mode_rounding * speed;
  std::vector<ImpactRow> contacts, separating, frictional, conditional;
  std::vector<int> bilateral(modes_.unswitched), violated, approaching, closed;
  const auto violates = [&](int k) {
    return std::fabs(rate_[k] / scales[k]) > tolerances_.evaluation_rounding * speed;
  };
  std::copy_if(bilateral.begin(), bilateral.end(), std::back_inserter(violated), violates);
  const auto recent = [&](int i) { return std::fabs(t_ - modes_.last_impact[i]) < modes_.switches[i].rest; };
  for (int i = 0; i < static_cast<int>(modes_.switches.size()); ++i) {
    const std::vector<ImpactRow> rows = impact_rows(i);
    if (rows.empty()) continue;
    const double separation_speed = rows[0].sign * rate_[rows[0].row] / scales[rows[0].row];
    const bool takes_part = separation_speed <= rest || modes_.mode[i] != released;
    if (rows[0].sign != 0) closed.push_back(i);
    if (takes_part && rows[0].sign != 0 && separation_speed < -rest) approaching.push_back(i);
    if (!takes_part && rows[0].sign != 0 && std::find(resting.begin(), resting.end(), i) != resting.end()) {
      for (const ImpactRow& x : rows)
        if (!(x.friction >= 0)) bilateral.push_back(x.row), violated.push_back(x.row);
      continue;
    }
    for (const ImpactRow& x : rows) {
      if (x.friction >= 0)
        frictional.push_back(x);
      else if (x.sign != 0)
        (takes_part ? contacts : separating).push_back(x);
      else
        takes_part ? bilateral.push_back(x.row) : conditional.push_back(x);
      if (takes_part && rows[0].sign == 0 && violates(x.row)) violated.push_back(x.row);
    }
  }
  if (approaching.empty() && violated.empty()) return false;
  // all contacts come to rest together
  if (!approaching.empty() && std::all_of(approaching.begin(), approaching.end(), recent)) {
    const auto comes_to_rest = [&](const ImpactRow& x) {
      return (recent(x.element) || modes_.mode[x.element] != released) && !modes_.switches[x.element].frictional();
    };
    for (const ImpactRow& x : contacts)
      if (comes_to_rest(x)) bilateral.push_back(x.row);
    contacts.erase(std::remove_if(contacts.begin(), contacts.end(), comes_to_rest), contacts.end());
  }
  contacts.insert(contacts.end(), separating.begin(), separating.end());
  for (ImpactRow& x : contacts)
    if (recent(x.element)) x.restitution = 0;
  const Vector rate_before(rate_);
  apply_impulses(contacts, frictional, bilateral, conditional, y, out);
  double largest = 0;
  for (int k : violated)
    if (std::fabs(rate_before[k] / scales[k]) > tolerances_.visible * speed) out.engaged.push_back(k);
  out.impact = !approaching.empty() || !out.engaged.empty();
  const auto impulse = [&](int i) {
    const int k = modes_.switches[i].rows[0];
    return modes_.switches[i].sign * out.impulses[k] * scales[k];
  };
  for (int i : closed) largest = std::max(largest, impulse(i));
  // omit impulses that are rounding errors, relative to the largest impulse or in the speeds that they change
  for (int i : closed) {
    const int k = modes_.switches[i].rows[0];
    const Vector z = root(k);
    const double change = impulse(i) * dot(z.data(), z.data(), s_.nv) / (scales[k] * scales[k]);
    const bool has_impulse =
        change > tolerances_.evaluation_rounding * speed && impulse(i) > modes_.mode_rounding * largest;
    if (out.impact && has_impulse) out.contacts.push_back(i);
  }
  update_rates();
  return true;
}

void ModeTransition::apply_impulses(const std::vector<ImpactRow>& contacts, const std::vector<ImpactRow>& frictional,
                                    const std::vector<int>& bilateral, const std::vector<ImpactRow>& conditional,
                                    double* y, Transition& out) {
  const int nv = s_.nv;
  const std::vector<double>& scales = tolerances_.row_scales;
  const double rest = modes_.mode_rounding * speed_;
  double* v = y + s_.nq;
  out.impulses.assign(s_.ng, 0.0);
  const auto change_velocity = [&](Vector z, double factor) {  // v += factor M^-1/2 z
    s_.point.solve_root_transposed(z.data());
    for (int c = 0; c < nv; ++c) v[c] += factor * z[c];
  };
  for (int iteration = 0;; ++iteration) {
    update_rates();
    const auto separation_speed = [&](const ImpactRow& x) { return x.sign * rate_[x.row] / scales[x.row]; };
    if (iteration &&
        std::none_of(contacts.begin(), contacts.end(), [&](auto& x) { return separation_speed(x) < -rest; }))
      break;
    if (iteration == modes_.max_impacts) fall_back_to_python();
    const Vector start(v, v + nv), rate(rate_);
    std::vector<int> acting_rows(bilateral);
    for (const ImpactRow& x : conditional)
      for (const ImpactRow& contact : contacts)
        if (contact.element == x.element && separation_speed(contact) <= rest) acting_rows.push_back(x.row);
    const RowSpace bilateral_space(s_, Z_, acting_rows);
    const Vector correction = bilateral_space.minimum_norm_correction(rate_);
    change_velocity(correction, -1);
    std::vector<ImpactRow> acting;
    std::vector<Multiplier> multipliers;
    std::vector<Vector> roots, full_roots;
    Vector speeds;
    const auto add = [&](const ImpactRow& x, double sign, double speed, const Multiplier& m) {
      full_roots.push_back(root(x.row));
      for (double& z : full_roots.back()) z *= sign / scales[x.row];
      roots.push_back(full_roots.back()), bilateral_space.project_out(roots.back());
      const double size = norm(roots.back().data(), nv);
      if (size > tolerances_.truncation * norm(full_roots.back().data(), nv)) {
        acting.push_back(x), speeds.push_back(speed), multipliers.push_back(m);
        return;
      }
      if (speed < 0 || !frictional.empty()) fall_back_to_python();  // dependent on bilateral rows
      full_roots.pop_back(), roots.pop_back();
    };
    for (const ImpactRow& x : contacts) {
      const double approach_rate = x.sign * rate[x.row] / scales[x.row];
      if (!(approach_rate <= rest)) continue;
      double speed = x.sign * (dot(row(x.row), v, nv) + g_t_[x.row]) / scales[x.row];
      if (approach_rate < 0) speed += x.restitution * approach_rate;
      if (speed < 0 && speed >= -rest) speed = 0;
      add(x, x.sign, speed, {0, INFINITY});
    }
    const size_t normals = acting.size();
    for (const ImpactRow& x : frictional)
      for (size_t n = 0; n < normals; ++n)
        if (acting[n].element == x.element && acting[n].sign != 0)
          add(x, 1, (dot(row(x.row), v, nv) + g_t_[x.row]) / scales[x.row],
              {-INFINITY, INFINITY, static_cast<int>(n), x.friction});
    const size_t m = roots.size();
    Vector W(m * m), impulses, rates, added(nv, 0.0), bilateral_change(nv, 0.0);
    for (size_t i = 0; i < m; ++i)
      for (size_t j = 0; j < m; ++j) W[i * m + j] = dot(roots[i].data(), roots[j].data(), nv);
    const Vector noise(m, tolerances_.evaluation_rounding * speed_);
    if (!solve_complementarity(W, speeds, noise, multipliers, tolerances_, modes_.max_states, impulses, rates))
      fall_back_to_python();
    for (size_t i = 0; i < m; ++i)
      for (int c = 0; c < nv; ++c)
        added[c] += impulses[i] * roots[i][c], bilateral_change[c] += impulses[i] * (roots[i][c] - full_roots[i][c]);
    change_velocity(added, 1);
    for (int c = 0; c < nv; ++c) bilateral_change[c] -= correction[c];
    Vector step_impulses = bilateral_space.multipliers(bilateral_change);
    for (size_t i = 0; i < m; ++i)
      step_impulses[acting[i].row] += (acting[i].sign != 0 ? acting[i].sign : 1) * impulses[i] / scales[acting[i].row];
    for (int k : s_.constraints.all) {
      if (step_impulses[k] == 0) continue;
      out.impulses[k] += step_impulses[k];
      out.work += 0.5 * step_impulses[k] * (dot(row(k), start.data(), nv) + dot(row(k), v, nv));
    }
  }
  for (int k : bilateral)
    if (!(std::fabs(rate_[k] / scales[k]) <= tolerances_.visible * speed_)) fall_back_to_python();
  if ((!frictional.empty() && out.work > 0) || !finite(v, nv) || !std::isfinite(out.work)) fall_back_to_python();
  y[s_.length - 1] += out.work;
}

}  // namespace mbdae
