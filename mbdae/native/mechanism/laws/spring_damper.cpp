// Spring, damper and actuator between two points; a: stiffness, damping, length; signals: the force of the actuator.
#include <limits>

#include "mechanism/frame_law.hpp"

namespace mbdae::laws {

static bool is_valid(Law& law, const Sizes&) { return law.pair >= 0 && law.a.size() == 3 && law.signals.size() == 1; }

struct SpringDamper {
  static bool damped(const Law& law) { return law.a[1] != 0; }

  template <class S>
  static S distance(const Frames<S>& x, Vec3<S>& n) {  // n: unit vector from a to b
    n = x.pb - x.pa;
    if (!(value(dot(n, n)) > 0)) return n = {1, 0, 0}, std::numeric_limits<double>::min();
    const S d = sqrt(dot(n, n));
    n = 1 / d * n;
    return d;
  }

  template <class S, class T, class U>
  static Wrenches<S, Common<S, T>> wrenches(const Law& law, const Context<U>& at, const Frames<S>& x, const Velocity<T>& V) {
    Vec3<S> n;
    const S d = distance(x, n);
    const Common<S, T> force = law.signals[0].at(at.t) - law.a[1] * dot(n, V.at(x.pb));
    return {wrench_at(x.pb, -law.a[0] * (d - law.a[2]) * n), wrench_at(x.pb, force * n)};
  }

  static double potential(const Law& law, const Frames<double>& x) {
    Vec3<double> n;
    const double stretch = distance(x, n) - law.a[2];
    return 0.5 * law.a[0] * stretch * stretch;
  }
};

extern const LawKind spring_damper = frame_law<SpringDamper>(is_valid);

}  // namespace mbdae::laws
