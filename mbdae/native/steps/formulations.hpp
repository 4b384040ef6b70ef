// The half-explicit and collocation steps of each formulation.
#pragma once

#include <memory>

#include "steps/ggl.hpp"
#include "steps/ggl_collocation.hpp"
#include "steps/index1.hpp"

namespace mbdae {

inline std::unique_ptr<HalfExplicitStep> half_explicit_step(Index2System& s) {
  if (s.formulation == Formulation::ggl) return std::make_unique<GGLStep>(s);
  if (s.formulation == Formulation::index1) return std::make_unique<Index1Step>(s);
  return std::make_unique<HalfExplicitStep>(s);
}

inline std::unique_ptr<CollocationStep> collocation_step(Index2System& s) {
  if (s.formulation == Formulation::ggl) return std::make_unique<GGLCollocation>(s);
  return std::make_unique<CollocationStep>(s);
}

}  // namespace mbdae
