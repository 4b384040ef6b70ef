// Half-explicit steps that also satisfy g = 0: x' = J (v + M^-1 G^T mu) (mbdae/mechanism/formulations/ggl.py).
#pragma once

#include "system/position_rows.hpp"
#include "steps/half_explicit_step.hpp"

namespace mbdae {

class GGLStep : public HalfExplicitStep {
 public:
  explicit GGLStep(Index2System& system);

 protected:
  void begin_step(const double* y) override { positions_.select(y); }
  void first_stage(const Vector& carry, double* F) const override;
  void set_carry(const double* F, Vector& carry) const override;
  void stage(double t, double t_hat, double factor, double* F, bool last) override;
  void satisfy_constraint(double t_hat, double factor, double* dx) override;  // by Newton's method for mu
  void project(double* e) override;
  void all_multipliers(double* z) override;

  PositionRows positions_;
  Vector mu_, mu_velocity_;  // (ng,) by row, and (nv,) M^-1 G^T mu

 private:
  // Newton correction of mu, M^-1 G^T mu and x' for the gaps g; factorizes S of the rows G
  void compute_correction(const Vector& G);
  void transfer();                     // set G_transferred_
  void check_other_rows(double t_hat);  // throws if a row that is not in use is violated

  Vector g_, dmu_;          // (ng,) by row
  Vector dmu_velocity_, move_, stage_x_;  // (nv,) correction of M^-1 G^T mu and of x'; x of a stage
  Vector G_transferred_;                  // Ghat J(xhat)^-1 J(x) of curved coordinates
  std::vector<TangentBlock> transfer_;
};

}  // namespace mbdae
