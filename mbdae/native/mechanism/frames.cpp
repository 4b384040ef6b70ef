// Dual numbers of the poses and velocities of frame pairs.
#include "mechanism/frames.hpp"

#include "math/spatial.hpp"

namespace mbdae {

Frames<Dual<6>> moving_frames(const Pair& p) {
  Frames<Dual<6>> out{Rotation<double>(p.Ra), Vec3<double>(p.pa), Rotation<Dual<6>>(p.Rb), Vec3<Dual<6>>(p.pb)};
  double skewed[9];
  skew(p.pb, skewed);
  for (int i = 0; i < 3; ++i) {
    out.pb[i].d[i] = 1;
    for (int k = 0; k < 3; ++k) out.pb[i].d[3 + k] = -skewed[3 * i + k];
  }
  for (int j = 0; j < 3; ++j) {
    const double column[3] = {p.Rb[j], p.Rb[3 + j], p.Rb[6 + j]};
    skew(column, skewed);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) out.Rb.x[3 * i + j].d[3 + k] = -skewed[3 * i + k];
  }
  return out;
}

Velocity<Dual<6>> moving_velocity(const double* V) {
  Velocity<Dual<6>> out{Vec3<Dual<6>>(V), Vec3<Dual<6>>(V + 3)};
  for (int i = 0; i < 3; ++i) out.linear[i].d[i] = out.angular[i].d[3 + i] = 1;
  return out;
}

Frames<Dual<1>> moving_frames(const Pair& p, const double* V) {
  Frames<Dual<1>> out{Rotation<double>(p.Ra), Vec3<double>(p.pa), Rotation<Dual<1>>(p.Rb), Vec3<Dual<1>>(p.pb)};
  const double* w = V + 3;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    out.pb[i].d[0] = V[i] + w[j] * p.pb[k] - w[k] * p.pb[j];
    for (int c = 0; c < 3; ++c) out.Rb.x[3 * i + c].d[0] = w[j] * p.Rb[3 * k + c] - w[k] * p.Rb[3 * j + c];
  }
  return out;
}

}  // namespace mbdae
