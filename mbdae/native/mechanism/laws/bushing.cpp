// A linear compliant connection (bushing) of two frames; a: stiffness (6,), damping (6,), largest rotation in rad.
#include <algorithm>
#include <limits>

#include "mechanism/frame_law.hpp"
#include "mechanism/multibody_tree.hpp"

namespace mbdae::laws {

// angle/sine for 0 <= angle < pi, from sine^2: the square root has no derivative at 0, where angle/sine = 1 is
// constant.
template <class S>
static S angle_over_sine(const S& square, const S& cosine) {
  if (!(value(square) > std::numeric_limits<double>::min())) return 1;
  const S sine = sqrt(square);
  return atan2(sine, cosine) / sine;
}

template <class S>
static Vec3<S> rotation_vector(const Rotation<S>& R) {  // log R
  const S* x = R.x;
  const Vec3<S> axis = 0.5 * Vec3<S>(x[7] - x[5], x[2] - x[6], x[3] - x[1]);
  return angle_over_sine(dot(axis, axis), 0.5 * (x[0] + x[4] + x[8] - 1)) * axis;
}

// J_r(theta)^-1 a = a + theta x a/2 + sum B_2k/(2k)! theta x (theta x ...).
template <class S>
static Vec3<S> inverse_jacobian(const Tolerances& tolerances, const Vec3<S>& theta, const Vec3<S>& a) {
  auto largest = [](const Vec3<S>& x) { return std::max({magnitude(x[0]), magnitude(x[1]), magnitude(x[2])}); };
  Vec3<S> out = a + 0.5 * cross(theta, a), term = a;
  for (double b : tolerances.series) {
    term = cross(theta, cross(theta, term)), out = out + b * term;
    if (largest(term) * std::fabs(b) <= tolerances.below_rounding * largest(a)) break;
  }
  return out;
}

struct Bushing {
  static bool is_valid(Law& law, const Sizes&) { return law.pair >= 0 && law.a.size() == 12 + 1; }

  static bool damped(const Law& law) {
    return std::any_of(law.a.begin() + 6, law.a.end() - 1, [](double x) { return x != 0; });
  }

  template <class S>
  static Vec3<S> gap(const Frames<S>& x) {  // in the axes of a, like the rotation vector
    return transposed(x.Ra, x.pb - x.pa);
  }

  template <class S>
  static Vec3<S> rotation(const Law& law, const Frames<S>& x) {
    const Vec3<S> theta = rotation_vector(transposed(x.Ra, x.Rb));
    if (!(value(dot(theta, theta)) <= law.a.back() * law.a.back())) throw FallBackToPython();
    return theta;
  }

  template <class S, class T, class U>
  static Wrenches<S, Common<S, T>> wrenches(const Law& law, const Context<U>& context, const Frames<S>& x,
                                            const Velocity<T>& V) {
    const double *k = law.a.data(), *d = k + 6;
    const Vec3<S> theta = rotation(law, x);
    const Vec3<S> moment = inverse_jacobian(context.tolerances, theta, scaled(k + 3, theta));
    Wrenches<S, Common<S, T>> out{};
    out.conservative = wrench_at(x.pb, x.Ra * (-1.0 * scaled(k, gap(x))), x.Ra * (-1.0 * moment));
    if (!damped(law)) return out;
    const auto velocity = transposed(x.Ra, V.at(x.pb));
    const auto angular_velocity = transposed(x.Ra, V.angular);
    out.other = wrench_at(x.pb, x.Ra * (-1.0 * scaled(d, velocity)), x.Ra * (-1.0 * scaled(d + 3, angular_velocity)));
    return out;
  }

  static double potential(const Law& law, const Frames<double>& x) {
    const double* k = law.a.data();
    const Vec3<double> p = gap(x), theta = rotation(law, x);
    return 0.5 * (dot(scaled(k, p), p) + dot(scaled(k + 3, theta), theta));
  }
};

extern const LawKind bushing = frame_law<Bushing>();

}  // namespace mbdae::laws
