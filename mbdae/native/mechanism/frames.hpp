// Poses of a frame pair, as dual numbers for a motion of b alone; partials for a motion of a follow from a common
// motion of both frames, which only rotates wrenches (`WrenchPartials::complete`).
#pragma once

#include "math/geometry.hpp"
#include "mechanism/rows.hpp"

namespace mbdae {

template <class S>
struct Frames {
  Rotation<double> Ra;
  Vec3<double> pa;
  Rotation<S> Rb;
  Vec3<S> pb;
};

inline Frames<double> frames_of(const Pair& p) {
  return {Rotation<double>(p.Ra), Vec3<double>(p.pa), Rotation<double>(p.Rb), Vec3<double>(p.pb)};
}
Frames<Dual<6>> moving_frames(const Pair& pair);                   // d/d(motion of b), linear part first
Frames<Dual<1>> moving_frames(const Pair& pair, const double* V);  // along the motion V of b

inline Velocity<double> velocity_of(const double* V) { return {Vec3<double>(V), Vec3<double>(V + 3)}; }
Velocity<Dual<6>> moving_velocity(const double* V);  // d/dV

// Values, and derivatives (6, N) by rows.
template <int N>
void read(const Wrench<Dual<N>>& w, double* F, double* D) {
  for (int i = 0; i < 6; ++i) {
    const Dual<N>& x = i < 3 ? w.force[i] : w.moment[i - 3];
    F[i] = x.x, std::copy(x.d, x.d + N, D + N * i);
  }
}

inline void read(const Wrench<double>& w, double* F, double*) {
  std::copy(w.force.x, w.force.x + 3, F), std::copy(w.moment.x, w.moment.x + 3, F + 3);
}

}  // namespace mbdae
