// A modal body: forces of inertia of its deformation, polynomials in the modal coordinates over any scalar
// (mbdae/mechanism/flexible/modal_body.py).
#pragma once

#include <vector>

#include "math/factorizations.hpp"
#include "math/fields.hpp"
#include "math/geometry.hpp"

namespace mbdae {

struct ModalNode {  // Phi, Psi: 3 numbers a mode; Phi2: 3 a pair of modes
  double r[3] = {0, 0, 0};
  Numbers Phi, Psi, Phi2;

  FIELDS(r, Phi, Psi, Phi2)
};

// H2 (k, k, k, 3), Mq1 (k, k, k), Mq2 (k, k, k, k), derivatives first, are empty without displacements of second order.
// Per mode: C, H0 (3,); C2 (k, 3); Mq (k,); Hj (k, 3) of sum m Phi_j x Phi_i; I1 and I2 (k,) in order xx, xy, yy, xz, yz, zz.
struct ModalBody {
  int joint = 0;  // of the model, which carries the frame
  double placement[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};  // of the frame in the joint: R by columns, p
  int iq = 0, iv = 0, modes = 0;  // the first coordinate and velocity of the modes, and their number
  Numbers C, C2, H0, Mq, Hj, I1, I2, H2, Mq1, Mq2;
  std::vector<ModalNode> nodes;

  FIELDS(joint, placement, iq, iv, modes, C, C2, H0, Mq, Hj, I1, I2, H2, Mq1, Mq2, nodes)
};

template <class S>
Vec3<S> symmetric(const S* I, const Vec3<S>& x) {
  return {I[0] * x[0] + I[1] * x[1] + I[3] * x[2], I[1] * x[0] + I[2] * x[1] + I[4] * x[2],
          I[3] * x[0] + I[4] * x[1] + I[5] * x[2]};
}

template <class S>
void add_multiple(const S& factor, const double* x, size_t n, S* out) {
  for (size_t i = 0; i < n; ++i) out[i] = out[i] + factor * x[i];
}

// out += half of sum q_i (first_i + by_q_i), n numbers each: a polynomial of second order from its derivatives.
template <class S>
void add_polynomial(const Numbers& first, const std::vector<S>& by_q, const S* q, int k, size_t n, S* out) {
  for (int i = 0; i < k; ++i)
    for (size_t l = 0; l < n; ++l) out[l] = out[l] + 0.5 * q[i] * (by_q[n * i + l] + first[n * i + l]);
}

// The polynomials at modal coordinates: S - s0, C, dI/dq_i, I - I0, H, Mq, and dH/dq_j, dMq/dq_j; the last is empty
// without displacements of second order.
template <class S>
struct Deformation {
  Vec3<S> moment;
  std::vector<S> C, by_q, H, Mq, H_by_q, Mq_by_q;  // (k, 3), (k, 6), (k, 3), (k, k), (k, k, 3), (k, k, k)
  S I[6];

  // Of one body, always the same.
  void update(const ModalBody& b, const S* q) {
    const int k = b.modes;
    const bool second_order = !b.Mq1.empty();
    by_q.assign(b.I1.begin(), b.I1.end()), H.assign(b.H0.begin(), b.H0.end());
    if (second_order || H_by_q.empty()) {
      C.assign(b.C.begin(), b.C.end()), Mq.assign(b.Mq.begin(), b.Mq.end());
      H_by_q.assign(b.Hj.begin(), b.Hj.end()), Mq_by_q.assign(b.Mq1.begin(), b.Mq1.end());
    }
    for (int j = 0; j < k; ++j) add_multiple(q[j], &b.I2[6 * k * j], 6 * k, by_q.data());  // symmetric in the modes
    for (int i = 0; i < k && second_order; ++i)
      for (int j = 0; j < k; ++j) {
        add_multiple(q[j], &b.C2[3 * (i * k + j)], 3, &C[3 * i]);
        add_multiple(q[j], &b.H2[3 * k * (i * k + j)], 3 * k, &H_by_q[3 * k * i]);
        add_multiple(q[j], &b.Mq2[k * k * (i * k + j)], k * k, &Mq_by_q[k * k * i]);
      }
    moment = {0, 0, 0};
    for (S& x : I) x = 0;
    for (int i = 0; i < k; ++i)
      for (int l = 0; l < 3; ++l) moment[l] = moment[l] + 0.5 * q[i] * (b.C[3 * i + l] + C[3 * i + l]);
    add_polynomial(b.I1, by_q, q, k, 6, I), add_polynomial(b.Hj, H_by_q, q, k, 3 * k, H.data());
    if (second_order) add_polynomial(b.Mq1, Mq_by_q, q, k, k * k, Mq.data());
  }
};

// Forces of inertia on the frame, in its axes, force before moment, and on the modes, F (6 + k,), without those of the
// rigid body: nu (6 + k,) velocities, A (6 + k,) their rates, those of the frame spatial and minus gravity.
template <class S>
void inertial_force(const ModalBody& b, const Deformation<S>& d, const S* nu, const S* A, S* F) {
  const int k = b.modes;
  const Vec3<S> v(nu), w(nu + 3), Av(A), Aw(A + 3);
  const S *u = nu + 6, *du = A + 6;
  Vec3<S> moment_rate(0, 0, 0), Cdu(0, 0, 0), Hu(0, 0, 0), Hdu(0, 0, 0), dHu(0, 0, 0);
  S dI[6] = {0, 0, 0, 0, 0, 0};
  const Vec3<S> vw = cross(v, w);
  const bool second_order = !d.Mq_by_q.empty();
  for (int i = 0; i < k; ++i) {
    const Vec3<S> C(&d.C[3 * i]), H(&d.H[3 * i]);
    Vec3<S> rate(0, 0, 0), row(0, 0, 0);
    S other = 0;
    for (int j = 0; j < k; ++j) {
      rate = rate + u[j] * Vec3<S>(&d.H_by_q[3 * (j * k + i)]);
      row = row + u[j] * Vec3<S>(&d.H_by_q[3 * (i * k + j)]);
      other = other + d.Mq[i * k + j] * du[j];
    }
    for (int j = 0; j < k && second_order; ++j) {
      Cdu = Cdu + u[i] * u[j] * Vec3<double>(&b.C2[3 * (i * k + j)]);
      for (int l = 0; l < k; ++l)
        other = other + (d.Mq_by_q[(j * k + i) * k + l] - 0.5 * d.Mq_by_q[(i * k + j) * k + l]) * u[j] * u[l];
    }
    for (int l = 0; l < 6; ++l) dI[l] = dI[l] + u[i] * d.by_q[6 * i + l];
    moment_rate = moment_rate + u[i] * C, Cdu = Cdu + du[i] * C;
    Hu = Hu + u[i] * H, Hdu = Hdu + du[i] * H, dHu = dHu + u[i] * rate;
    const S by_q = dot(C, vw) + 0.5 * dot(w, symmetric(&d.by_q[6 * i], w)) + dot(w, row);
    F[6 + i] = dot(C, Av) + dot(H, Aw) + other + dot(rate, w) - by_q;
  }
  const Vec3<S> p = cross(w, d.moment) + moment_rate;
  const Vec3<S> h = cross(d.moment, v) + symmetric(d.I, w) + Hu;
  const Vec3<S> force = cross(Aw, d.moment) + Cdu + cross(w, moment_rate) + cross(w, p);
  const Vec3<S> torque = cross(d.moment, Av) + symmetric(d.I, Aw) + Hdu + cross(moment_rate, v) + symmetric(dI, w) +
                         dHu + cross(w, h) + cross(v, p);
  for (int l = 0; l < 3; ++l) F[l] = force[l], F[3 + l] = torque[l];
}

}  // namespace mbdae
