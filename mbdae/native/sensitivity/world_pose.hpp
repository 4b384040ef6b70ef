// Momentum of a body in the world, and transforms between the world and the axes of a frame.
#pragma once

#include "mechanism/rnea_partials.hpp"
#include "math/spatial.hpp"

namespace mbdae {

inline void momentum(const Body& b, const double* V, double* out) {  // I V
  double relative[3];  // velocity of the centre of mass relative to the origin
  cross(V + 3, b.centre, relative);
  for (int i = 0; i < 3; ++i) out[i] = b.mass * (V[i] + relative[i]);
  cross(b.centre, out, out + 3);
  for (int i = 0; i < 3; ++i) out[3 + i] += dot(b.I + 3 * i, V + 3);
}

struct WorldPose {  // a body, a joint placement, or a frame, in the world; R by rows
  double R[9], p[3];

  void to_local(const double* X, double* out) const {  // a motion, from the world to the axes of the frame
    double linear[3];
    cross(X + 3, p, linear);
    for (int i = 0; i < 3; ++i) linear[i] += X[i];
    rotate_by_columns(R, linear, out), rotate_by_columns(R, X + 3, out + 3);
  }

  void to_world(const double* x, double* out) const {  // a motion, from the axes of the frame to the world
    double moment[3];
    rotate(R, x, out), rotate(R, x + 3, out + 3), cross(p, out + 3, moment);
    for (int i = 0; i < 3; ++i) out[i] += moment[i];
  }

  void wrench_to_world(const double* w, double* out) const {
    double moment[3];
    rotate(R, w, out), rotate(R, w + 3, out + 3), cross(p, out, moment);
    for (int i = 0; i < 3; ++i) out[3 + i] += moment[i];
  }
};

}  // namespace mbdae
