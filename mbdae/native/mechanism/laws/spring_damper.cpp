// Spring, damper and actuator between two points; a: stiffness, damping, free length; signals: the force of the
// actuator.
#include "mechanism/frame_law.hpp"

namespace mbdae::laws {

struct SpringDamper {
  static bool is_valid(Law& law, const Sizes&) { return law.pair >= 0 && law.a.size() == 3 && law.signals.size() == 1; }

  static bool damped(const Law& law) { return law.a[1] != 0; }

  // The unit vector from a to b; the x axis if their distance is 0.
  template <class S>
  static Vec3<S> direction(const Vec3<S>& gap) {
    const S square = dot(gap, gap);
    if (!(value(square) > 0)) return {1, 0, 0};
    return 1 / sqrt(square) * gap;
  }

  template <class S, class T, class U>
  static Wrenches<S, Common<S, T>> wrenches(const Law& law, const Context<U>& context, const Frames<S>& x,
                                            const Velocity<T>& V) {
    const Vec3<S> gap = x.pb - x.pa, n = direction(gap);
    // Not as a function of the distance, which has no derivative at 0: a spring of free length 0 is stiff in all
    // directions.
    Wrenches<S, Common<S, T>> out{wrench_at(x.pb, -law.a[0] * (gap - law.a[2] * n)), {}};
    Common<S, T> force = law.signals[0].at(context.t);
    if (damped(law)) force = force - law.a[1] * dot(n, V.at(x.pb));
    if (magnitude(force) != 0) out.other = wrench_at(x.pb, force * n);  // zero for most springs
    return out;
  }

  static double potential(const Law& law, const Frames<double>& x) {
    const Vec3<double> gap = x.pb - x.pa;
    const double elongation = sqrt(dot(gap, gap)) - law.a[2];
    return 0.5 * law.a[0] * elongation * elongation;
  }
};

extern const LawKind spring_damper = frame_law<SpringDamper>();

}  // namespace mbdae::laws
