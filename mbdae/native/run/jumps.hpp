// Times at which a problem may jump, and the smooth intervals between them (mbdae/integrate/events/jumps.py).
#pragma once

#include <cmath>

#include "system/sampled_controller.hpp"
#include "run/step_control.hpp"

namespace mbdae {

struct Jumps {
  bool in_core = false;  // whether the core crosses them, not Python
  Vector times;          // s, increasing
  double margin = 0;     // roundings of t by which a step stays before a jump
  int max_cluster = 0;   // jumps within roundings of one another that count as one
  double restart = NAN;  // s: start of the next interval; nan after the end

  FIELDS(in_core, times, margin, max_cluster, restart)

  double late() const { return 4 * margin; }  // roundings between jumps that count as one, and to a start just after one

  // The interval from t on, and the start of the next one; false where jumps follow one another too closely.
  bool next_interval(const std::vector<SampledController>& samplers, double t, SmoothInterval& interval);

 private:
  double next(const std::vector<SampledController>& samplers, double t, double sign) const;
  bool last_of_cluster(const std::vector<SampledController>& samplers, double t, double sign, double gap,
                       double& found) const;
};

}  // namespace mbdae
