// Times at which a problem may jump, and the legs of a run between them (mbdae/integrate/jumps.py).
#pragma once

#include <cmath>

#include "system/sampled_controller.hpp"
#include "run/step_control.hpp"

namespace mbdae {

struct Jumps {
  bool crossed = false;  // by the core, or else by Python
  Numbers times;         // s, rising
  double margin = 0;     // roundings of t by which a step stays before a jump
  int crowd = 0;         // jumps within roundings of one another that count as one
  double restart = NAN;  // where the next leg begins; nan behind the end

  // The leg from t on, with the time where the one behind it begins; false where jumps follow one another too closely.
  bool leg(const std::vector<SampledController>& samplers, double t, SmoothInterval& leg);

 private:
  double next(const std::vector<SampledController>& samplers, double t, double sign) const;
  bool last(const std::vector<SampledController>& samplers, double t, double sign, double near, double& found) const;
};

}  // namespace mbdae
