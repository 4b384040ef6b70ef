#include "tangents/parameter_slopes.hpp"

#include <algorithm>

#include "numbers/vec3.hpp"

namespace mbdae {

NearLaws::NearLaws(std::vector<Pair> pairs_, std::vector<Law> laws_, const std::vector<int>& pair_of_law)
    : pairs(std::move(pairs_)), laws(std::move(laws_)) {
  for (size_t i = 0; i < laws.size(); ++i)
    if (pair_of_law[i] >= 0) laws[i].pair = &pairs[pair_of_law[i]];
}

ParameterSlopes::ParameterSlopes(Index2System& s, int count, std::vector<Stuff> stuff,
                                 std::vector<Direction> directions, std::vector<Changed> changed)
    : s_(s),
      count_(count),
      n_(s.nv + s.ns + 1),
      stuff_(std::move(stuff)),
      directions_(std::move(directions)),
      changed_(std::move(changed)),
      own_(changed_.size()),
      here_(stuff_.size()),
      pull_(stuff_.size(), Six{}) {
  const Mechanics& m = s.mechanics;
  const auto supports = m.supports();
  columns_.resize(m.joints), above_.assign(m.joints, std::vector<bool>(m.joints, false));
  for (int j = 1; j < m.joints; ++j) {
    columns_[j].assign(supports[j].begin() + supports[m.parents[j]].size(), supports[j].end());
    for (int i = j; i; i = m.parents[i]) above_[j][i] = true;
  }
  for (const Stuff& x : stuff_) {
    sums_.emplace_back(size_of(x.of, s.nv), 0.0);
    kinematic_ = kinematic_ || x.of != Stuff::armature;
    placing_ = placing_ || x.of == Stuff::place;
    moving_ = moving_ || placing_ || x.of == Stuff::frame;
  }
  const auto find = [&](const std::vector<Pair>& pairs, bool of_laws) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const int a = pairs[p].a.joint, b = pairs[p].b.joint;
      std::vector<Moving>& found = ends_[&pairs[p]];
      for (int i = 0; i < static_cast<int>(stuff_.size()); ++i) {
        const Stuff& x = stuff_[i];
        if (x.of == Stuff::frame && x.of_law == of_laws && x.at == static_cast<int>(p)) found.push_back({i, x.b});
        if (x.of == Stuff::place && above_[a][x.at] != above_[b][x.at]) found.push_back({i, above_[b][x.at]});
      }
    }
  };
  find(s.constraints.pairs, false), find(s.law_pairs(), true);
  for (const Changed& c : changed_) meeting_ = meeting_ || !c.rows.empty();
  for (auto* x : {&V_, &A_, &U_, &X_, &F_, &H_, &C_, &h_}) x->assign(m.joints, Six{});
  body_.resize(m.joints);
}

void ParameterSlopes::stand(const VariedPoint& point) {
  Mechanics& m = s_.mechanics;
  if (kinematic_ || !changed_.empty()) {
    m.motions(point.q.data(), point.u.data(), point.vdot.data());
    m.poses(point.q.data());
  }
  if (kinematic_) {
    double g[3] = {0, 0, 0};
    if (point.loaded) m.gravity(g);
    J_.assign(m.J(), m.J() + 6 * s_.nv);
    for (int i = 0; i < 3; ++i) A_[0][i] = -g[i];
    for (int j = 1; j < m.joints; ++j) {
      m.velocity(j, V_[j].data()), m.acceleration(j, A_[j].data());
      for (int i = 0; i < 3; ++i) A_[j][i] -= g[i];
      body_[j] = m.body(j);
    }
    if (placing_) momenta();
    locate(here_);
  }
  change(point);
  met_.resize(moving_ ? point.met.size() : 0);
  const std::vector<int>& position = s_.rows.position();
  for (size_t i = 0; i < met_.size(); ++i) {
    const VariedPoint::Met& at = point.met[i];
    Met& met = met_[i];
    m.poses(at.q.data());
    met.kind = at.kind, met.weight = at.weight, met.V.assign(m.joints, Six{}), met.placed.resize(stuff_.size());
    if (at.kind != VariedPoint::Met::gap) twists(m.J(), at.v.data(), met.V);
    locate(met.placed);
    met.rows.clear();
    for (size_t p = 0; p < s_.constraints.pairs.size(); ++p) {
      Pair& pair = s_.constraints.pairs[p];
      if (ends_.at(&pair).empty()) continue;
      std::vector<std::pair<int, Turning>> found;
      for (int k : s_.constraints.of_pair[p]) {
        if (position[k] < 0) continue;
        if (found.empty()) pair.locate(m);
        found.emplace_back(position[k], Turning());
        s_.constraints.rows[k].slopes(pair, found.back().second);
      }
      if (!found.empty()) met.rows.emplace_back(&pair, std::move(found));
    }
  }
}

void ParameterSlopes::change(const VariedPoint& point) {
  Mechanics& m = s_.mechanics;
  const size_t nv = s_.nv, n = n_, ng = s_.ng;
  own_P_.assign(changed_.size() * n, 0.0), own_Q_.assign(changed_.size() * ng, 0.0);
  const double *v = point.u.data(), *s = v + nv;
  Numbers conservative(nv), other(nv), here, rates, G, speed;
  for (size_t i = 0; i < changed_.size(); ++i) {
    const Changed& c = changed_[i];
    double* P = &own_P_[i * n];
    for (const NearLaws& near : c.laws) {
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
    for (const NearRows& near : c.rows) {
      G.assign(c.at.size() * nv, 0.0), speed.assign(c.at.size(), 0.0);
      near.rows->value(m, point.q.data(), near.rows->all, G.data()), near.rows->speed(point.t, speed.data());
      for (size_t l = 0; l < c.at.size(); ++l) {
        const double w = near.weight * point.lam[c.at[l]];
        for (size_t k = 0; k < nv; ++k) P[k] += w * G[l * nv + k];
        P[n - 1] -= w * speed[l];
      }
    }
  }
  if (!meeting_) return;
  Numbers g;
  for (const VariedPoint::Met& met : point.met) {
    m.poses(met.q.data());
    for (size_t i = 0; i < changed_.size(); ++i)
      for (const NearRows& near : changed_[i].rows) {
        const std::vector<int>& at = changed_[i].at;
        G.assign(at.size() * nv, 0.0), g.assign(at.size(), 0.0);
        near.rows->value(m, met.q.data(), near.rows->all, G.data(), g.data());
        if (met.kind == VariedPoint::Met::gap) {
          near.rows->gaps(met.t, g.data());
        } else {
          std::fill(g.begin(), g.end(), 0.0);
          if (met.kind == VariedPoint::Met::rate) near.rows->speed(met.t, g.data());
          for (size_t l = 0; l < at.size(); ++l) g[l] += dot(&G[l * nv], met.v.data(), static_cast<int>(nv));
        }
        for (size_t l = 0; l < at.size(); ++l) own_Q_[i * ng + at[l]] += met.weight * near.weight * g[l];
      }
  }
}

void ParameterSlopes::clear() {
  for (Numbers& x : sums_) std::fill(x.begin(), x.end(), 0.0);
}

void ParameterSlopes::collect(double* p) const {
  for (const Direction& d : directions_)
    p[d.parameter] += dot(d.x.data(), sums_[d.stuff].data(), static_cast<int>(d.x.size()));
}

void ParameterSlopes::begin() {
  clear();
  std::fill(own_.begin(), own_.end(), 0.0);
}

void ParameterSlopes::add(const VariedPoint& point, const double* above, const double* nu) {
  if (!count_) return;
  const std::vector<int>& position = s_.rows.position();
  stand(point);
  contract(point, above, nu);
  for (size_t i = 0; i < changed_.size(); ++i) {
    own_[i] += dot(&own_P_[i * n_], above, n_);
    for (int k : s_.rows.in_use()) own_[i] += own_Q_[i * s_.ng + k] * nu[position[k]];
  }
}

void ParameterSlopes::end(double* p) {
  collect(p);
  for (size_t i = 0; i < changed_.size(); ++i) p[changed_[i].parameter] += own_[i];
}

void ParameterSlopes::columns(const VariedPoint& point, Numbers& P, Numbers& Q) {
  const std::vector<int>& position = s_.rows.position();
  const size_t r = s_.rows.in_use().size(), n = n_;
  P.assign(count_ * n, 0.0), Q.assign(count_ * r, 0.0);
  stand(point);
  Numbers unit(std::max(n, r), 0.0), p(count_);
  for (size_t e = 0; e < n + r; ++e) {
    if (e < n ? e >= static_cast<size_t>(s_.nv) && e < n - 1 : met_.empty()) continue;  // rates of states are laws' own
    const size_t at = e < n ? e : e - n;
    unit[at] = 1, clear(), std::fill(p.begin(), p.end(), 0.0);
    contract(point, e < n ? unit.data() : nullptr, e < n ? nullptr : unit.data());
    collect(p.data());
    for (size_t k = 0; k < count_; ++k) (e < n ? P[k * n + at] : Q[k * r + at]) = p[k];
    unit[at] = 0;
  }
  for (size_t i = 0; i < changed_.size(); ++i) {
    const size_t k = changed_[i].parameter;
    for (size_t e = 0; e < n; ++e) P[k * n + e] += own_P_[i * n + e];
    for (int row : s_.rows.in_use()) Q[k * r + position[row]] += own_Q_[i * s_.ng + row];
  }
}

}  // namespace mbdae
