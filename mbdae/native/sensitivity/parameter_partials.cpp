#include "sensitivity/parameter_partials.hpp"

#include <algorithm>

#include "math/vec3.hpp"

namespace mbdae {

PerturbedLaws::PerturbedLaws(std::vector<Pair> pairs_, std::vector<Law> laws_, const std::vector<int>& pair_of_law)
    : pairs(std::move(pairs_)), laws(std::move(laws_)) {
  for (size_t i = 0; i < laws.size(); ++i)
    if (pair_of_law[i] >= 0) laws[i].pair = &pairs[pair_of_law[i]];
}

Parameters::Parameters(Index2System& s, int count, std::vector<ModelComponent> stuff,
                                 std::vector<Direction> directions, std::vector<ChangedElement> changed)
    : s_(s),
      count_(count),
      n_(s.nv + s.ns + 1),
      stuff_(std::move(stuff)),
      directions_(std::move(directions)),
      changed_(std::move(changed)),
      own_(changed_.size()),
      here_(stuff_.size()),
      gaps_(s.ng) {
  const Mechanics& m = s.mechanics;
  const auto supports = m.supports();
  columns_.resize(m.joints), behind_.resize(m.joints), joint_of_.resize(s.nv);
  above_.assign(m.joints, std::vector<bool>(m.joints, false));
  for (int j = 1; j < m.joints; ++j) {
    columns_[j].assign(supports[j].begin() + supports[m.parents[j]].size(), supports[j].end());
    for (int c : columns_[j]) joint_of_[c] = j;
    for (int i = j; i; i = m.parents[i]) above_[j][i] = true, behind_[i].push_back(j);
    behind_[0].push_back(j);
  }
  along_.resize(stuff_.size());
  for (size_t d = 0; d < directions_.size(); ++d) along_[directions_[d].stuff].push_back(&directions_[d]);
  std::vector<bool> used(m.joints, false), heavy(m.joints, false);
  const auto use = [&](int j) {
    for (; j; j = m.parents[j]) used[j] = true;
  };
  for (const ModelComponent& x : stuff_) {
    sums_.emplace_back(size_of(x.of, s.nv), 0.0);
    kinematic_ = kinematic_ || x.of != ModelComponent::armature;
    placing_ = placing_ || x.of == ModelComponent::place;
    moving_ = moving_ || placing_ || x.of == ModelComponent::frame;
    if (x.of == ModelComponent::inertia) use(x.at);
    if (x.of != ModelComponent::place && x.of != ModelComponent::gravity) continue;
    for (int j : behind_[x.of == ModelComponent::place ? x.at : 0]) {
      heavy[j] = true;
      if (x.of == ModelComponent::place) use(j);
    }
  }
  const auto find = [&](const std::vector<Pair>& pairs, bool of_laws) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const int a = pairs[p].a.joint, b = pairs[p].b.joint;
      std::vector<Moving>& found = ends_[&pairs[p]];
      for (int i = 0; i < static_cast<int>(stuff_.size()); ++i) {
        const ModelComponent& x = stuff_[i];
        if (x.of == ModelComponent::frame && x.of_law == of_laws && x.at == static_cast<int>(p)) found.push_back({i, x.b});
        if (x.of == ModelComponent::place && above_[a][x.at] != above_[b][x.at]) found.push_back({i, above_[b][x.at]});
      }
      if (found.empty()) continue;
      use(a), use(b);
      rows_move_ = rows_move_ || !of_laws;
    }
  };
  find(s.constraints.pairs, false), find(s.law_pairs(), true);
  for (const ChangedElement& c : changed_) meeting_ = meeting_ || !c.rows.empty();
  for (int j = 1; j < m.joints; ++j) {
    if (used[j]) used_.push_back(j);
    if (heavy[j]) heavy_.push_back(j);
  }
  for (auto* x : {&V_, &A_, &U_, &X_, &F_, &H_, &C_, &h_, &W_}) x->assign(m.joints, Six{});
  body_.resize(m.joints);
}

void Parameters::pose(const LinearisationPoint& point) {
  if (kinematic_ || !changed_.empty()) s_.mechanics.poses(point.q.data());
}

void Parameters::stand(const LinearisationPoint& point) {
  const Mechanics& m = s_.mechanics;
  if (kinematic_) {
    double g[3] = {0, 0, 0};
    if (point.loaded) m.gravity(g);
    for (int i = 0; i < 3; ++i) A_[0][i] = -g[i];
    motions<true>(point.u.data(), point.vdot.data());
    for (int j : heavy_) body_[j] = m.body(j);
    if (placing_) momenta();
    locate();
  }
  if (!changed_.empty()) change(point);
}

void Parameters::change(const LinearisationPoint& point) {
  Mechanics& m = s_.mechanics;
  const size_t nv = s_.nv, n = n_;
  own_P_.assign(changed_.size() * n, 0.0);
  const double *v = point.u.data(), *s = v + nv;
  Numbers conservative(nv), other(nv), here, rates, G, speed;
  for (size_t i = 0; i < changed_.size(); ++i) {
    const ChangedElement& c = changed_[i];
    double* P = &own_P_[i * n];
    for (const PerturbedLaws& near : c.laws) {
      if (!point.loaded) break;
      here.resize(c.at.size()), rates.assign(c.at.size(), 0.0);
      for (size_t l = 0; l < c.at.size(); ++l) here[l] = s[c.at[l]];
      std::fill(conservative.begin(), conservative.end(), 0.0), std::fill(other.begin(), other.end(), 0.0);
      for (const Law& law : near.laws)
        law.add(m, point.t, point.q.data(), v, here.data() + law.state, conservative.data(), other.data(),
                rates.data() + law.state);
      for (size_t l = 0; l < nv; ++l) P[l] += near.weight * (conservative[l] + other[l]);
      for (size_t l = 0; l < c.at.size(); ++l) P[nv + c.at[l]] += near.weight * rates[l];
      P[n - 1] += near.weight * dot(other.data(), v, static_cast<int>(nv));
    }
    for (const PerturbedRows& near : c.rows) {
      G.assign(c.at.size() * nv, 0.0), speed.assign(c.at.size(), 0.0);
      near.rows->value(m, point.q.data(), near.rows->all, G.data()), near.rows->speed(point.t, speed.data());
      for (size_t l = 0; l < c.at.size(); ++l) {
        const double w = near.weight * point.lam[c.at[l]];
        for (size_t k = 0; k < nv; ++k) P[k] += w * G[l * nv + k];
        P[n - 1] -= w * speed[l];
      }
    }
  }
}

void Parameters::meet_changed(const LinearisationPoint::Met& met) {
  const size_t nv = s_.nv;
  Numbers G, g;
  for (size_t i = 0; i < changed_.size(); ++i)
    for (const PerturbedRows& near : changed_[i].rows) {
      const std::vector<int>& at = changed_[i].at;
      G.assign(at.size() * nv, 0.0), g.assign(at.size(), 0.0);
      near.rows->value(s_.mechanics, met.q.data(), near.rows->all, G.data(), g.data());
      if (met.kind == LinearisationPoint::Met::gap) {
        near.rows->gaps(met.t, g.data());
      } else {
        std::fill(g.begin(), g.end(), 0.0);
        if (met.kind == LinearisationPoint::Met::rate) near.rows->speed(met.t, g.data());
        for (size_t l = 0; l < at.size(); ++l) g[l] += dot(&G[l * nv], met.v.data(), static_cast<int>(nv));
      }
      for (size_t l = 0; l < at.size(); ++l) own_Q_[i * s_.ng + at[l]] += met.weight * near.weight * g[l];
    }
}

void Parameters::begin() {
  extra_.assign(count_, 0.0);
  for (Numbers& x : sums_) std::fill(x.begin(), x.end(), 0.0);
  std::fill(own_.begin(), own_.end(), 0.0);
}

void Parameters::add(const LinearisationPoint& point, const double* above, const double* nu) {
  if (!count_) return;
  const IndependentRows& rows = point.rows ? *point.rows : s_.rows;
  const std::vector<int>& position = rows.position();
  pose(point);
  if (!point.still) stand(point), contract(point, above);
  meet(point, point.q, [&](const LinearisationPoint::Met& met, const Pair& pair) {
    WrenchPartials sum;
    for (const auto& [at, t] : asked_) {
      const double w = met.weight * nu[at];
      sum.add(w, *t);
    }
    if (met.kind == LinearisationPoint::Met::gap)
      shifted(pair, sum.F);
    else
      moved(pair, sum, V_);
  });
  for (size_t i = 0; i < changed_.size(); ++i) {
    if (!point.still) own_[i] += dot(&own_P_[i * n_], above, n_);
    for (int k : rows.in_use()) own_[i] += own_Q_[i * s_.ng + k] * nu[position[k]];
  }
}

void Parameters::add_columns(const Numbers& P, const double* above) {
  for (size_t l = 0; l < count_; ++l) extra_[l] += dot(&P[l * n_], above, n_);
}

void Parameters::end(double* p) {
  for (size_t l = 0; l < count_; ++l) p[l] += extra_[l];
  for (const Direction& d : directions_)
    p[d.parameter] += dot(d.x.data(), sums_[d.stuff].data(), static_cast<int>(d.x.size()));
  for (size_t i = 0; i < changed_.size(); ++i) p[changed_[i].parameter] += own_[i];
}

}  // namespace mbdae
