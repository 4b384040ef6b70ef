// Force laws, as mbdae/mechanism/{joint,frame}_forces.py, actuators.py and controllers.py define them.
#pragma once

#include <functional>
#include <vector>

#include "rows.hpp"
#include "signals.hpp"

namespace mbdae {

struct Law {
  enum Kind {
    damping,
    friction,
    spring,
    curve,
    torque,
    pd,
    pid,
    resistance,
    motor,
    held,
    spring_damper,
    bushing,
    wrench,
    python,
    actuator
  } kind = damping;
  std::vector<int> iq, iv;      // coordinates
  std::vector<double> a;        // numbers
  std::vector<Signal> signals;  // functions of time
  Pair* pair = nullptr;
  int state = 0, states = 0;  // where its states stand in s, and how many there are
  bool flag = false;          // pd, pid: velocity is controlled; wrench: axes turn with the frame; bushing: damped
  std::function<void(double, const double*, const double*, const double*, double*, double*)> call;  // t q v s tau ds

  bool steady = false;  // wrench: a constant force, which has a potential

  // Add to conservative and other (nv,); write s'. The kinematics stand at q.
  void add(const Mechanics& m, double t, const double* q, const double* v, const double* s, double* conservative,
           double* other, double* ds) const;
};

}  // namespace mbdae
