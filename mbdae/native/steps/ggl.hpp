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
  void first_stage(const Numbers& carry, double* F) const override;
  void set_carry(const double* F, Numbers& carry) const override;
  void stage(double t, double that, double factor, double* F, bool last) override;
  void satisfy_constraint(double that, double factor, double* dx) override;  // by Newton's method for mu
  void project(double* e) override;
  void all_multipliers(double* z) override;

  PositionRows positions_;
  Numbers mu_, slip_;  // (ng,) by row, and (nv,) M^-1 G^T mu

 private:
  void compute_correction(const Numbers& G);  // the change of mu, slip and x' that closes the gaps by rows G; their S
  void transfer();                            // Gmoved_
  void check_other_rows(double that);         // throws if a row that is not in use is open

  Numbers gap_, dmu_;                     // (ng,) by row
  Numbers dslip_, move_, at_;             // (nv,) change of slip as velocity and in coordinates; x of a stage
  Numbers Gmoved_;                        // Ghat J(xhat)^-1 J(x), where coordinates are curved
  std::vector<TangentBlock> transfer_;
};

}  // namespace mbdae
