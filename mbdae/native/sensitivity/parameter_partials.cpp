// Components moved by parameters, perturbed laws and rows, and gradients accumulated over points.
#include "sensitivity/parameter_partials.hpp"

#include <algorithm>

#include "math/vec3.hpp"

namespace mbdae {

PerturbedLaws::PerturbedLaws(double weight_, std::vector<Pair> pairs_, std::vector<Law> laws_)
    : weight(weight_), pairs(std::move(pairs_)), laws(std::move(laws_)) {
  for (Law& law : laws)
    if (law.pair >= 0) law.frames = &pairs[law.pair];
}

ParameterPartials::ParameterPartials(Index2System& s, int count, std::vector<ModelComponent> components,
                                     std::vector<Direction> directions, std::vector<ChangedElement> changed)
    : s_(s),
      count_(count),
      n_(s.nv + s.ns + 1),
      components_(std::move(components)),
      directions_(std::move(directions)),
      changed_(std::move(changed)),
      world_poses_(components_.size()),
      gaps_(s.ng) {
  const MultibodyTree& m = s.tree;
  const auto supports = m.supports();
  columns_.resize(m.joints), subtree_.resize(m.joints), joint_of_.resize(s.nv);
  has_ancestor_.assign(m.joints, std::vector<bool>(m.joints, false));
  for (int j = 1; j < m.joints; ++j) {
    const auto &dofs = supports[j].velocities, &parent_dofs = supports[m.parents[j]].velocities;
    columns_[j].assign(dofs.begin() + parent_dofs.size(), dofs.end());
    for (int c : columns_[j]) joint_of_[c] = j;
    for (int i = j; i; i = m.parents[i]) has_ancestor_[j][i] = true, subtree_[i].push_back(j);
    subtree_[0].push_back(j);
  }
  directions_of_.resize(components_.size());
  for (size_t d = 0; d < directions_.size(); ++d) directions_of_[directions_[d].component].push_back(&directions_[d]);
  std::vector<bool> needs_motion(m.joints, false), has_inertia(m.joints, false);
  const auto require_motion = [&](int j) {
    for (; j; j = m.parents[j]) needs_motion[j] = true;
  };
  for (const ModelComponent& x : components_) {
    needs_kinematics_ = needs_kinematics_ || x.kind != ModelComponent::armature;
    has_placement_ = has_placement_ || x.kind == ModelComponent::placement;
    frames_move_ = frames_move_ || has_placement_ || x.kind == ModelComponent::frame;
    if (x.kind == ModelComponent::inertia) require_motion(x.id);
    if (x.kind != ModelComponent::placement && x.kind != ModelComponent::gravity) continue;
    for (int j : subtree_[x.kind == ModelComponent::placement ? x.id : 0]) {
      has_inertia[j] = true;
      if (x.kind == ModelComponent::placement) require_motion(j);
    }
  }
  const auto collect_moved_frames = [&](const std::vector<Pair>& pairs, bool of_laws) {
    for (size_t p = 0; p < pairs.size(); ++p) {
      const int a = pairs[p].a.joint, b = pairs[p].b.joint;
      std::vector<MovedFrame>& frames = moved_frames_[&pairs[p]];
      for (int i = 0; i < static_cast<int>(components_.size()); ++i) {
        const ModelComponent& x = components_[i];
        if (x.kind == ModelComponent::frame && x.of_law == of_laws && x.id == static_cast<int>(p))
          frames.push_back({i, x.second});
        if (x.kind == ModelComponent::placement && has_ancestor_[a][x.id] != has_ancestor_[b][x.id])
          frames.push_back({i, has_ancestor_[b][x.id]});
      }
      if (frames.empty()) continue;
      require_motion(a), require_motion(b);
      has_moving_rows_ = has_moving_rows_ || !of_laws;
    }
  };
  collect_moved_frames(s.constraints.pairs, false), collect_moved_frames(s.law_pairs(), true);
  for (const ChangedElement& c : changed_) has_changed_rows_ = has_changed_rows_ || !c.rows.empty();
  for (int j = 1; j < m.joints; ++j) {
    if (needs_motion[j]) moving_joints_.push_back(j);
    if (has_inertia[j]) inertial_joints_.push_back(j);
  }
  for (auto* x : {&V_, &A_, &U_, &X_, &F_, &H_, &C_, &h_, &W_}) x->assign(m.joints, Six{});
  body_.resize(m.joints);
}

void ParameterPartials::update_poses(const LinearizationPoint& point) {
  if (needs_kinematics_ || !changed_.empty()) s_.tree.poses(point.q.data());
}

void ParameterPartials::evaluate_terms(const LinearizationPoint& point) {
  const MultibodyTree& m = s_.tree;
  if (needs_kinematics_) {
    double g[3] = {0, 0, 0};
    if (point.has_applied_forces) m.gravity(g);
    for (int i = 0; i < 3; ++i) A_[0][i] = -g[i];
    update_motions<true>(point.u.data(), point.vdot.data());
    for (int j : inertial_joints_) body_[j] = m.body(j);
    if (has_placement_) update_momenta();
    update_world_poses();
  }
  if (!changed_.empty()) evaluate_changed(point);
}

void ParameterPartials::evaluate_changed(const LinearizationPoint& point) {
  MultibodyTree& m = s_.tree;
  const size_t nv = s_.nv, n = n_;
  changed_P_.assign(changed_.size() * n, 0.0);
  const double *v = point.u.data(), *s = v + nv;
  Vector conservative(nv), other(nv), law_states, rates, G, speed;
  for (size_t i = 0; i < changed_.size(); ++i) {
    ChangedElement& c = changed_[i];
    double* P = &changed_P_[i * n];
    if (!c.bodies.empty()) {
      double gravity[3] = {0, 0, 0};
      const Vector zero(nv, 0.0);
      const bool has_gravity = !c.gravity.empty();
      if (point.has_applied_forces) m.gravity(gravity);
      if (has_gravity)
        for (int l = 0; l < 3; ++l) gravity[l] = point.has_applied_forces ? c.gravity[l] : 0;
      std::fill(other.begin(), other.end(), 0.0);
      m.add_forces(c.bodies, point.q.data(), has_gravity ? zero.data() : v,
                   has_gravity ? zero.data() : point.vdot.data(), gravity, other.data());
      for (size_t l = 0; l < nv; ++l) P[l] -= other[l];
    }
    for (const PerturbedLaws& perturbed : c.laws) {
      if (!point.has_applied_forces) break;
      law_states.resize(c.indices.size()), rates.assign(c.indices.size(), 0.0);
      for (size_t l = 0; l < c.indices.size(); ++l) law_states[l] = s[c.indices[l]];
      std::fill(conservative.begin(), conservative.end(), 0.0), std::fill(other.begin(), other.end(), 0.0);
      for (const Law& law : perturbed.laws)
        law.add(m, point.t, point.q.data(), v, law_states.data() + law.state, conservative.data(), other.data(),
                rates.data() + law.state);
      for (size_t l = 0; l < nv; ++l) P[l] += perturbed.weight * (conservative[l] + other[l]);
      for (size_t l = 0; l < c.indices.size(); ++l) P[nv + c.indices[l]] += perturbed.weight * rates[l];
      P[n - 1] += perturbed.weight * dot(other.data(), v, static_cast<int>(nv));
    }
    for (const PerturbedRows& perturbed : c.rows) {
      G.assign(perturbed.rows->start.back(), 0.0), speed.assign(c.indices.size(), 0.0);
      perturbed.rows->value(m, point.q.data(), perturbed.rows->all, G.data());
      perturbed.rows->evaluate_g_t(point.t, speed.data());
      for (size_t l = 0; l < c.indices.size(); ++l) {
        const double w = perturbed.weight * point.lam[c.indices[l]];
        perturbed.rows->add(static_cast<int>(l), G, w, P);
        P[n - 1] -= w * speed[l];
      }
    }
  }
}

void ParameterPartials::add_changed_rows(const LinearizationPoint::ConstraintPoint& constrained) {
  Vector G, g;
  for (size_t i = 0; i < changed_.size(); ++i)
    for (const PerturbedRows& perturbed : changed_[i].rows) {
      const std::vector<int>& indices = changed_[i].indices;
      G.assign(perturbed.rows->start.back(), 0.0), g.assign(indices.size(), 0.0);
      perturbed.rows->value(s_.tree, constrained.q.data(), perturbed.rows->all, G.data(), g.data());
      if (constrained.kind == LinearizationPoint::ConstraintPoint::g) {
        perturbed.rows->complete_g(constrained.t, g.data());
      } else {
        std::fill(g.begin(), g.end(), 0.0);
        if (constrained.kind == LinearizationPoint::ConstraintPoint::rate)
          perturbed.rows->evaluate_g_t(constrained.t, g.data());
        for (size_t l = 0; l < indices.size(); ++l)
          g[l] += perturbed.rows->times(static_cast<int>(l), G, constrained.v.data());
      }
      for (size_t l = 0; l < indices.size(); ++l)
        changed_Q_[i * s_.ng + indices[l]] += constrained.weight * perturbed.weight * g[l];
    }
}

void ParameterPartials::begin_gradient(size_t costs) {
  Sums zero{{}, Vector(count_, 0.0), Vector(changed_.size(), 0.0)};
  for (const ModelComponent& x : components_) zero.components.emplace_back(size_of(x.kind, s_.nv), 0.0);
  sums_.assign(costs, zero);
}

void ParameterPartials::add_point(const LinearizationPoint& point, const Vector& cotangent, const Vector& nu) {
  if (!count_) return;
  const IndependentRows& rows = point.rows ? *point.rows : s_.rows;
  const std::vector<int>& position = rows.position();
  const size_t costs = sums_.size(), n = n_, r = rows.in_use().size();
  update_poses(point);
  if (!point.at_rest) evaluate_terms(point);
  for (size_t c = 0; c < costs && !point.at_rest; ++c) contract(point, &cotangent[c * n], sums_[c].components);
  for_constraint_points(point, point.q, [&](const LinearizationPoint::ConstraintPoint& constrained, const Pair& pair) {
    for (size_t c = 0; c < costs; ++c) {
      WrenchPartials sum;
      for (const auto& [row, t] : requested_) sum.add(constrained.weight * nu[c * r + row], *t);
      if (constrained.kind == LinearizationPoint::ConstraintPoint::g)
        add_gap_gradient(pair, sum.F, sums_[c].components);
      else
        add_wrench_gradient(pair, sum, V_, sums_[c].components);
    }
  });
  for (size_t c = 0; c < costs; ++c)
    for (size_t i = 0; i < changed_.size(); ++i) {
      double& sum = sums_[c].changed[i];
      if (!point.at_rest) sum += dot(&changed_P_[i * n], &cotangent[c * n], n_);
      for (int k : rows.in_use()) sum += changed_Q_[i * s_.ng + k] * nu[c * r + position[k]];
    }
}

void ParameterPartials::add_columns(const Vector& P, const Vector& cotangent) {
  for (size_t c = 0; c < sums_.size(); ++c)
    for (size_t l = 0; l < count_; ++l) sums_[c].columns[l] += dot(&P[l * n_], &cotangent[c * n_], n_);
}

void ParameterPartials::end_gradient(double* p) {
  for (const Sums& sums : sums_) {
    for (size_t l = 0; l < count_; ++l) p[l] += sums.columns[l];
    for (const Direction& d : directions_)
      p[d.parameter] += dot(d.x.data(), sums.components[d.component].data(), static_cast<int>(d.x.size()));
    for (size_t i = 0; i < changed_.size(); ++i) p[changed_[i].parameter] += sums.changed[i];
    p += count_;
  }
}

}  // namespace mbdae
