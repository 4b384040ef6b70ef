// An applied force and moment on a frame; signals: their components.
#include "mechanism/frame_law.hpp"

namespace mbdae::laws {

struct AppliedWrench {
  static bool is_valid(Law& law, const Sizes&) { return law.pair >= 0 && law.signals.size() == 6; }

  static bool damped(const Law&) { return false; }

  template <class S, class T, class U>
  static Wrenches<S, S> wrenches(const Law& law, const Context<U>& context, const Frames<S>& x, const Velocity<T>&) {
    S u[6];
    for (int i = 0; i < 6; ++i) u[i] = law.signals[i].at(context.t);
    Vec3<S> force(u), moment(u + 3);
    if (law.rotating) force = x.Rb * force, moment = x.Rb * moment;
    if (law.has_potential) return {wrench_at(x.pb, force), {{}, moment}};
    return {{}, wrench_at(x.pb, force, moment)};
  }

  static double potential(const Law& law, const Frames<double>& x) {
    double out = 0;
    for (int i = 0; i < 3 && law.has_potential; ++i) out -= law.signals[i].at(0) * x.pb[i];
    return out;
  }
};

extern const LawKind wrench = frame_law<AppliedWrench>();

}  // namespace mbdae::laws
