// Times of possible jumps, and the smooth intervals between them (mbdae/integrate/events/jumps.py).
#pragma once

#include <cmath>

#include "system/sampled_controller.hpp"
#include "run/step_control.hpp"

namespace mbdae {

struct Jumps {
  bool in_core = false;  // whether the core crosses jumps, not Python
  Vector times;          // s, increasing
  double margin = 0;     // distance between the end of a step and a jump, in roundings of t
  int max_cluster = 0;   // largest number of jumps that count as one
  double restart = NAN;  // s: start of the next interval; nan: none

  FIELDS(in_core, times, margin, max_cluster, restart)

  double cluster_width() const { return 4 * margin; }  // roundings of t within which jumps count as one

  // Set the interval from t on, and the start of the next one; false if too many jumps follow each other closely.
  bool next_interval(const std::vector<SampledController>& samplers, double t, SmoothInterval& interval);

 private:
  double next(const std::vector<SampledController>& samplers, double t, double sign) const;
  bool last_of_cluster(const std::vector<SampledController>& samplers, double t, double sign, double gap,
                       double& last) const;
};

}  // namespace mbdae
