// Exponential map and logarithm of joints: quaternions, circles, screw motions.
#include "mechanism/tree_coordinates.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

// Sum of the series 1/n! - x^2/(n + 2)! + x^4/(n + 4)! ..., to rounding.
double series(double square, int n) {
  double term = 1;
  for (int i = 2; i <= n; ++i) term /= i;
  double sum = term, last = 0;
  for (int i = n + 1; sum != last; i += 2) last = sum, term *= -square / (i * (i + 1)), sum += term;
  return sum;
}

double sinc(double x) { return x == 0 ? 1 : std::sin(x) / x; }

void quaternion_product(const double* a, const double* b, double* out) {  // quaternions x, y, z, w
  const double x = a[3] * b[0] + b[3] * a[0] + a[1] * b[2] - a[2] * b[1];
  const double y = a[3] * b[1] + b[3] * a[1] + a[2] * b[0] - a[0] * b[2];
  const double z = a[3] * b[2] + b[3] * a[2] + a[0] * b[1] - a[1] * b[0];
  const double w = a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2];
  out[0] = x, out[1] = y, out[2] = z, out[3] = w;
}

void rotate_by_quaternion(const double* q, const double* x, double* out) {
  double t[3], u[3];
  cross(q, x, t);
  for (double& a : t) a *= 2;
  cross(q, t, u);
  for (int i = 0; i < 3; ++i) out[i] = x[i] + q[3] * t[i] + u[i];
}

void normalize_array(double* x, int n) {
  const double size = norm(x, n);
  for (int i = 0; i < n; ++i) x[i] /= size;
}

void add_rotation(const double* q, const double* w, double* out) {
  const double angle = norm(w, 3), s = sinc(angle / 2) / 2;
  const double rotation[4] = {s * w[0], s * w[1], s * w[2], std::cos(angle / 2)};
  double to[4];
  quaternion_product(q, rotation, to);
  const double sign = mbdae::dot(q, to, 4) < 0 ? -1 : 1;  // the sign of the quaternion does not change
  normalize_array(to, 4);
  for (int i = 0; i < 4; ++i) out[i] = sign * to[i];
}

void rotation_between(const double* q0, const double* q1, double* w) {
  const double inverse[4] = {-q0[0], -q0[1], -q0[2], q0[3]};
  double d[4];
  quaternion_product(inverse, q1, d);
  const double sign = d[3] < 0 ? -1 : 1, s = norm(d, 3), angle = 2 * std::atan2(s, sign * d[3]);
  const double factor = s == 0 ? 2 * sign / norm(d, 4) : sign * angle / s;
  for (int i = 0; i < 3; ++i) w[i] = factor * d[i];
}

// Translation of a free joint along a screw: p = V(w) u with V = 1 + b [w] + c [w]^2, and its inverse 1 - [w]/2 + d
// [w]^2.
void screw_translation(const double* w, const double* u, bool inverse, double* out) {
  const double angle = norm(w, 3), square = angle * angle, half_angle = sinc(angle / 2);
  const double b = half_angle * half_angle / 2, c = square < 1 ? series(square, 3) : (1 - sinc(angle)) / square;
  const double e = square < 1 ? series(square, 4) : (1 - 2 * b) / (2 * square);  // (x^2/2 - 1 + cos x)/x^4
  double x[3], xx[3];
  cross(w, u, x), cross(w, x, xx);
  const double first = inverse ? -0.5 : b, second = inverse ? (c - 2 * e) / (2 * b) : c;
  for (int i = 0; i < 3; ++i) out[i] = u[i] + first * x[i] + second * xx[i];
}

// Chord of a planar joint, at half the angle of rotation: its direction (c, s), times the ratio of chord to arc.
void chord(const double* q, double rotation, double* c, double* s) {
  const double half_angle = rotation / 2, ch = std::cos(half_angle), sh = std::sin(half_angle),
               ratio = sinc(half_angle);
  *c = ratio * (q[0] * ch - q[1] * sh), *s = ratio * (q[1] * ch + q[0] * sh);
}

void add_angle(const double* q, double angle, double* out) {
  const double c = std::cos(angle), s = std::sin(angle), x = q[0] * c - q[1] * s, y = q[1] * c + q[0] * s;
  out[0] = x, out[1] = y, normalize_array(out, 2);
}

double angle_between(const double* q0, const double* q1) {
  return std::atan2(q0[0] * q1[1] - q0[1] * q1[0], q0[0] * q1[0] + q0[1] * q1[1]);
}

}  // namespace

void integrate(const TreeJoints& joints, const double* q, const double* x, double* out) {
  for (size_t j = 1; j < joints.size(); ++j) {
    const TreeJoint& a = joints[j];
    const double *p = q + a.q, *u = x + a.v;
    double* to = out + a.q;
    double step[3] = {};
    std::copy_n(u, a.translations, step);
    const double* rotation = u + a.translations;
    if (a.translations && a.rotation == TreeJoint::quaternion) {
      double screw[3];
      screw_translation(rotation, u, false, screw), rotate_by_quaternion(p + 3, screw, step);
    } else if (a.translations == 2) {
      double c, s;
      chord(p + 2, u[2], &c, &s);
      step[0] = c * u[0] - s * u[1], step[1] = s * u[0] + c * u[1];
    }
    for (int i = 0; i < a.translations; ++i) to[i] = p[i] + step[i];
    to += a.translations, p += a.translations;
    if (a.rotation == TreeJoint::quaternion) add_rotation(p, rotation, to);
    if (a.rotation == TreeJoint::circle) add_angle(p, rotation[0], to);
    if (a.rotation == TreeJoint::angle) to[0] = p[0] + rotation[0];
  }
}

void difference(const TreeJoints& joints, const double* q0, const double* q1, double* out) {
  for (size_t j = 1; j < joints.size(); ++j) {
    const TreeJoint& a = joints[j];
    const double *p = q0 + a.q, *r = q1 + a.q;
    double *u = out + a.v, *rotation = u + a.translations, step[3] = {};
    for (int i = 0; i < a.translations; ++i) step[i] = r[i] - p[i];
    p += a.translations, r += a.translations;
    if (a.rotation == TreeJoint::quaternion) rotation_between(p, r, rotation);
    if (a.rotation == TreeJoint::circle) rotation[0] = angle_between(p, r);
    if (a.rotation == TreeJoint::angle) rotation[0] = r[0] - p[0];
    if (a.translations && a.rotation == TreeJoint::quaternion) {
      const double inverse[4] = {-p[0], -p[1], -p[2], p[3]};
      double local[3];
      rotate_by_quaternion(inverse, step, local), screw_translation(rotation, local, true, u);
    } else if (a.translations == 2) {
      double c, s;
      chord(p, rotation[0], &c, &s);
      const double square = c * c + s * s;
      u[0] = (c * step[0] + s * step[1]) / square, u[1] = (c * step[1] - s * step[0]) / square;
    } else {
      std::copy_n(step, a.translations, u);
    }
  }
}

void neutral(const TreeJoints& joints, double* q) {
  for (size_t j = 1; j < joints.size(); ++j) {
    const TreeJoint& a = joints[j];
    double* to = std::fill_n(q + a.q, a.translations, 0.0);
    if (a.rotation == TreeJoint::quaternion) *std::fill_n(to, 3, 0.0) = 1;
    if (a.rotation == TreeJoint::circle) to[0] = 1, to[1] = 0;
    if (a.rotation == TreeJoint::angle) to[0] = 0;
  }
}

void normalize(const TreeJoints& joints, double* q) {
  for (const TreeJoint& a : joints) {
    if (a.rotation == TreeJoint::quaternion) normalize_array(q + a.q + a.translations, 4);
    if (a.rotation == TreeJoint::circle) normalize_array(q + a.q + a.translations, 2);
  }
}

void tangent_map(const TreeJoints& joints, const double* q, const double* v, double* dq) {
  for (size_t j = 1; j < joints.size(); ++j) {
    const TreeJoint& a = joints[j];
    const double *p = q + a.q + a.translations, *u = v + a.v, *rotation = u + a.translations;
    double *to = dq + a.q, *rate = to + a.translations;
    std::copy_n(u, a.translations, to);
    if (a.rotation == TreeJoint::quaternion) {
      const double w[4] = {rotation[0] / 2, rotation[1] / 2, rotation[2] / 2, 0};
      quaternion_product(p, w, rate);
      if (a.translations) rotate_by_quaternion(p, u, to);
    } else if (a.rotation == TreeJoint::circle) {
      rate[0] = -p[1] * rotation[0], rate[1] = p[0] * rotation[0];
      if (a.translations) to[0] = p[0] * u[0] - p[1] * u[1], to[1] = p[1] * u[0] + p[0] * u[1];
    } else if (a.rotation == TreeJoint::angle) {
      rate[0] = rotation[0];
    }
  }
}

}  // namespace mbdae
