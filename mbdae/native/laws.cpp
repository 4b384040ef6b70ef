#include "laws.hpp"

#include <algorithm>
#include <cmath>

#include "manifold.hpp"
#include "vec3.hpp"

namespace mbdae {

namespace {

void turn_back(const double* R, const double* x, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

// Generalised force of a force and a moment in axes of a, at the origin of b.
void on_b(const Mechanics& m, const Pair& p, const double* force, const double* moment, double* tau) {
  double w[6], arm[3];
  turn(p.Ra, force, w), turn(p.Ra, moment, w + 3);
  cross(p.pb, w, arm);
  for (int i = 0; i < 3; ++i) w[3 + i] += arm[i];
  p.torque(m, w, 1, tau);
}

void rotation_vector(const double* A, const double* B, double* theta) {  // log(A^T B)
  double R[9];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) R[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
  theta[0] = 0.5 * (R[7] - R[5]), theta[1] = 0.5 * (R[2] - R[6]), theta[2] = 0.5 * (R[3] - R[1]);
  const double sine = std::sqrt(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2]);
  const double angle = std::atan2(sine, 0.5 * (R[0] + R[4] + R[8] - 1));
  if (sine > 0)
    for (int i = 0; i < 3; ++i) theta[i] *= angle / sine;
}

}  // namespace

void Law::add(const Mechanics& m, double t, const double* q, const double* v, const double* s, double* conservative,
              double* other, double* ds) const {
  switch (kind) {
    case damping:
      for (int i = 0; i < m.nv; ++i) other[i] -= a[i] * v[i];
      return;
    case friction:  // a: d (nv,), v0
      for (int i = 0; i < m.nv; ++i)
        if (a[i] != 0) other[i] -= a[i] * std::tanh(v[i] / a[m.nv]);
      return;
    case spring:  // a: k, rest, damping
    case curve:   // a: -, rest, damping; signals[0]: c
      for (size_t i = 0; i < iq.size(); ++i) {
        const double x = q[iq[i]] - a[1];
        conservative[iv[i]] -= kind == spring ? a[0] * x : signals[0].at(x);
        other[iv[i]] -= a[2] * v[iv[i]];
      }
      return;
    case torque:  // a: gear
      for (size_t i = 0; i < signals.size(); ++i) other[iv[0] + i] += a[0] * signals[i].at(t);
      return;
    case pd:
    case pid: {  // a: kp, kd, ki
      const double e = signals[0].at(t) - (flag ? v[iv[0]] : q[iq[0]]);
      double tau = a[0] * e;
      if (!flag && a[1] != 0) tau += a[1] * (signals[0].at(t, 1) - v[iv[0]]);
      if (kind == pid) tau += a[2] * s[0], ds[0] = e;
      other[iv[0]] += tau;
      return;
    }
    case resistance:  // a: k, resistance
      other[iv[0]] += a[0] * (signals[0].at(t) - a[0] * v[iv[0]]) / a[1];
      return;
    case motor:  // a: k, resistance, inductance
      other[iv[0]] += a[0] * s[0];
      ds[0] = (signals[0].at(t) - a[1] * s[0] - a[0] * v[iv[0]]) / a[2];
      return;
    case held:
      for (size_t i = 0; i < iv.size(); ++i) other[iv[i]] += s[i];
      std::fill(ds, ds + states, 0.0);
      return;
    case spring_damper: {  // a: stiffness, damping, length; signals[0]: force
      double w[6], twist[6];
      pair->locate(m);
      const double d = unit_gap(*pair, w);
      cross(pair->pb, w, w + 3);
      double push = signals[0].at(t);
      if (a[1] != 0) {
        pair->relative(m, v, twist);
        double rate = 0;
        for (int i = 0; i < 6; ++i) rate += w[i] * twist[i];
        push -= a[1] * rate;
      }
      pair->torque(m, w, -a[0] * (d - a[2]), conservative);
      if (push != 0) pair->torque(m, w, push, other);
      return;
    }
    case bushing: {  // a: stiffness (6,), damping (6,)
      double gap[3], theta[3], moved[3], ad[9], force[3], moment[3];
      pair->locate(m);
      for (int i = 0; i < 3; ++i) moved[i] = pair->pb[i] - pair->pa[i];
      turn_back(pair->Ra, moved, gap);
      rotation_vector(pair->Ra, pair->Rb, theta);
      const double most = m.limits.bushing_turn;
      if (!(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2] <= most * most)) throw Trouble();
      const double cross_theta[9] = {0, -theta[2], theta[1], theta[2], 0, -theta[0], -theta[1], theta[0], 0};
      std::copy(cross_theta, cross_theta + 9, ad);
      for (int i = 0; i < 3; ++i) moved[i] = -a[3 + i] * theta[i], force[i] = -a[i] * gap[i];
      inverse_jacobian(m.limits, 3, ad, moved, moment);
      on_b(m, *pair, force, moment, conservative);
      if (!flag) return;
      double twist[6], arm[3], velocity[3], spin[3];
      pair->relative(m, v, twist);
      cross(twist + 3, pair->pb, arm);
      for (int i = 0; i < 3; ++i) arm[i] += twist[i];
      turn_back(pair->Ra, arm, velocity), turn_back(pair->Ra, twist + 3, spin);
      for (int i = 0; i < 3; ++i) force[i] = -a[6 + i] * velocity[i], moment[i] = -a[9 + i] * spin[i];
      on_b(m, *pair, force, moment, other);
      return;
    }
    case wrench: {
      double n[3], w[6], moment[6] = {0, 0, 0, 0, 0, 0};
      pair->locate(m);
      for (int i = 0; i < 3; ++i) n[i] = signals[i].at(t), w[i] = signals[3 + i].at(t);
      if (flag) {
        double x[3];
        turn(pair->Rb, n, x), turn(pair->Rb, w, moment + 3);
        std::copy(x, x + 3, n);
      } else {
        std::copy(w, w + 3, moment + 3);
      }
      std::copy(n, n + 3, w);
      cross(pair->pb, n, w + 3);
      pair->torque(m, w, 1, steady ? conservative : other);
      if (moment[3] != 0 || moment[4] != 0 || moment[5] != 0) pair->torque(m, moment, 1, other);
      return;
    }
    case python:
    case actuator:
      call(t, q, v, s, other, ds);
      return;
  }
}

}  // namespace mbdae
