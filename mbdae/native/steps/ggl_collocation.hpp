// Collocation steps that also satisfy g = 0 by the multipliers mu (mbdae/mechanism/formulations/ggl.py).
#pragma once

#include "steps/collocation.hpp"
#include "system/position_rows.hpp"

namespace mbdae {

class GGLCollocation : public CollocationStep {
 public:
  explicit GGLCollocation(Index2System& system);

 protected:
  void residual(double t, const double* x, const double* dx, const double* z, double* R, double* C) override;
  std::shared_ptr<const LinearizedStages> linearize(double t, const double* x, const double* dx,
                                                    const double* z) override;
  std::vector<int> unknowns() const override;
  void begin_step(const double* y) override { positions_.select(y); }
  void all_multipliers(double t, const double* z, double* out) override;

  PositionRows positions_;

 private:
  Vector g_, mu_;  // (ng,)
  Vector mu_velocity_;  // (nv,)
};

}  // namespace mbdae
