// The system of a mechanism, with the steps of all methods.
#pragma once

#include <memory>
#include <utility>

#include "run/time_loop.hpp"
#include "steps/formulations.hpp"
#include "steps/newmark.hpp"
#include "steps/variational.hpp"

namespace mbdae {

struct Core {
  Core(const void* model, const Tolerances& tolerances, Description d)
      : system(model, tolerances, std::move(d)), step(half_explicit_step(system)), stages(collocation_step(system)),
        variational(system), newmark(system) {}

  HalfExplicitMethod method(const Tableau& a) { return {*step, a}; }
  CollocationMethod method(const Radau& a) { return {*stages, a}; }
  FixedStepMethod<VariationalStep, Composition> method(const Composition& a) {
    return {variational, a, false};
  }
  FixedStepMethod<NewmarkStep, GeneralizedAlpha> method(const GeneralizedAlpha& a) {
    return {newmark, a, true};
  }

  Index2System system;
  std::unique_ptr<HalfExplicitStep> step;
  std::unique_ptr<CollocationStep> stages;
  VariationalStep variational;
  NewmarkStep newmark;
};

}  // namespace mbdae
