// Times at which a problem may jump, and the smooth intervals between them (mbdae/integrate/jumps.py).
#pragma once

#include <cmath>

#include "system/sampled_controller.hpp"
#include "run/step_control.hpp"

namespace mbdae {

struct Jumps {
  bool crossed = false;  // by the core, or else by Python
  Numbers times;         // s, increasing
  double margin = 0;     // roundings of t by which a step stays before a jump
  int crowd = 0;         // jumps within roundings of one another that count as one
  double restart = NAN;  // start of the next interval; nan after the end

  // The interval from t on, and the start of the next one; false where jumps follow one another too closely.
  bool leg(const std::vector<SampledController>& samplers, double t, SmoothInterval& leg);

 private:
  double next(const std::vector<SampledController>& samplers, double t, double sign) const;
  bool last(const std::vector<SampledController>& samplers, double t, double sign, double near, double& found) const;
};

}  // namespace mbdae
