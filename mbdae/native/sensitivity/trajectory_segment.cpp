// Recomputed steps, with their projections, and the recursion of tangents and adjoints over them.
#include "sensitivity/trajectory_segment.hpp"

#include <algorithm>
#include <cmath>

#include "sensitivity/general_step_sensitivity.hpp"
#include "sensitivity/step_sensitivity.hpp"
#include "steps/formulations.hpp"
#include "system/projection.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

void set_state(const Index2System& s, const TrajectorySegment& g, const double* carries, size_t i, State& state) {
  const size_t nc = carry_size(s, g);
  state.y.assign(g.y + i * s.length, g.y + (i + 1) * s.length);
  state.carry.assign(carries + i * nc, carries + (i + 1) * nc);
}

std::unique_ptr<StepMap> step_map(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& g,
                                  bool forward, bool varying) {
  if (g.radau) return std::make_unique<GeneralStepSensitivity>(s, parameters, forward, StepCoefficients(*g.radau), recorder(s, *g.radau));
  if (!varying && s.formulation == Formulation::index2 && !s.friction)
    return std::make_unique<StepSensitivity>(s, &parameters, *g.tableau, forward);
  return std::make_unique<GeneralStepSensitivity>(s, parameters, forward, StepCoefficients(*g.tableau), recorder(s, *g.tableau));
}

// The interval between two nodes: one step, or two of half the size, and the projection of its end.
class Interval {
 public:
  Interval(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& g, bool forward,
           bool varying = false)
      : s_(s), g_(g), first_(step_map(s, parameters, g, forward, varying)), end_(s, parameters, forward) {
    if (g.halved) second_ = step_map(s, parameters, g, forward, varying);
  }

  void take(const double* carries, size_t i) {
    const double h = g_.t[i + 1] - g_.t[i];
    set_state(s_, g_, carries, i, start_);
    if (g_.halved) {
      first_->repeat(g_.t[i], h / 2, start_, middle_);
      second_->repeat(g_.t[i] + h / 2, h / 2, middle_, next_);
    } else {
      first_->repeat(g_.t[i], h, start_, next_);
    }
    if (g_.project) end_.take(g_.t[i + 1], next_.y.data());
  }

  void forward(int d, double* tangents, size_t width, const double* dp, const double* dh) {
    Vector half_dh;
    if (dh) half_dh.assign(dh, dh + d);
    for (double& x : half_dh) x /= 2;
    const double* step_dh = dh && g_.halved ? half_dh.data() : dh;
    first_->forward(d, tangents, dp, step_dh, nullptr);
    if (g_.halved) second_->forward(d, tangents, dp, step_dh, step_dh);
    if (g_.project) end_.forward(d, tangents, width, dp, dh);
  }

  void reverse(int costs, double* cotangents, size_t width) {
    if (g_.project) end_.reverse(costs, cotangents, width);
    if (g_.halved) second_->reverse(costs, cotangents);
    first_->reverse(costs, cotangents);
  }

 private:
  Index2System& s_;
  const TrajectorySegment& g_;
  std::unique_ptr<StepMap> first_, second_;
  ProjectionSensitivity end_;
  State start_, middle_, next_;
};

// Project the end of a step as in the run; return whether the carry is restarted.
bool project(Index2System& s, const RepeatTolerances& tolerances, double t, const State& start, State& next) {
  Vector y = next.y, move(s.ny), size0(s.ny), size1(s.ny);
  project_state(s, t, next.y.data());
  s.difference(y.data(), next.y.data(), move.data());
  s.component_magnitudes(start.y.data(), size0.data()), s.component_magnitudes(next.y.data(), size1.data());
  double move_norm;
  if (tolerances.adaptive) {
    move_norm = tolerances.control.error_norm(move.data(), 1, s.ny, s.controlled_components(), size0.data(),
                                              size1.data(), 0, 0, 0);
  } else {
    add_characteristic_magnitudes(s, next.y.data(), size1.data());
    move_norm = largest_move(move, size1, s.controlled_components(), tolerances.tolerated_move, tolerances.tiny);
  }
  if (move_norm <= 1) return false;
  Vector F(s.ny), z(s.ng);
  s.derivative(t, next.y.data(), F.data(), z.data());
  next.carry = s.carry(F);
  return true;
}

}  // namespace

size_t carry_size(const Index2System& s, const TrajectorySegment& g) {
  return g.tableau && g.tableau->explicit_first ? s.carry_length() : 0;
}

void recompute(Index2System& s, const TrajectorySegment& g, const RepeatTolerances& tolerances, Recomputed& out) {
  StepSensitivity index2_step(s, nullptr, *g.tableau);
  const auto other_step = half_explicit_step(s);
  Vector move(s.ny), z(s.nz), errors;
  const auto step = [&](double t, double h, const State& in, State& out) {
    if (s.formulation == Formulation::index2) return index2_step.repeat(t, h, in, out, false);
    other_step->take(*g.tableau, t, h, in, out, z.data(), errors);
    out.low.clear();
  };
  State current, middle, next;
  const size_t nc = carry_size(s, g);
  set_state(s, g, out.carries.data(), 0, current);
  out.restarted.assign(g.steps + 1, 0);
  for (out.steps = 0; out.steps < g.steps; ++out.steps) {
    const size_t i = out.steps;
    const double h = g.t[i + 1] - g.t[i], *end = g.y + (i + 1) * s.length;
    if (g.halved) {
      step(g.t[i], h / 2, current, middle);
      step(g.t[i] + h / 2, h / 2, middle, next);
    } else {
      step(g.t[i], h, current, next);
    }
    if (g.project) out.restarted[i + 1] = project(s, tolerances, g.t[i + 1], current, next);
    std::copy(next.carry.begin(), next.carry.end(), out.carries.begin() + (i + 1) * nc);
    s.difference(next.y.data(), end, move.data());
    const double deviation = largest(move.data(), s.ny), size = 1 + largest(end, s.length);
    if (!(deviation <= tolerances.same_state * size)) return;
    if (!(deviation <= tolerances.agreement * size)) next.y.assign(end, end + s.length);
    std::swap(current, next);
  }
  out.end = current.y;
}

void adjoint(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& g, const double* carries,
             int costs, const double* extra, double* cotangents, double* p) {
  Interval interval(s, parameters, g, false);
  const size_t width = s.ny + carry_size(s, g), size = costs * width;
  parameters.begin_gradient(costs);
  for (size_t i = g.steps; i-- > 0;) {
    interval.take(carries, i);
    if (i + 1 < g.steps)
      for (size_t c = 0; c < size; ++c) cotangents[c] += extra[(i + 1) * size + c];
    interval.reverse(costs, cotangents, width);
  }
  parameters.end_gradient(p);
}

void tangent(Index2System& s, ParameterPartials& parameters, const TrajectorySegment& g, const double* carries, int d,
             const double* dp, const double* dh, const double* first, double* tangents) {
  Interval interval(s, parameters, g, true, dh);
  const size_t width = s.ny + carry_size(s, g), size = d * width;
  std::copy_n(first, size, tangents);
  for (size_t i = 0; i < g.steps; ++i) {
    double* node = tangents + (i + 1) * size;
    std::copy_n(node - size, size, node);
    interval.take(carries, i);
    interval.forward(d, node, width, dp, dh);
  }
}

}  // namespace mbdae
