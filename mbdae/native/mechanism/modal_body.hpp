// A body with modal deformation: inertial forces, polynomial in the modal coordinates, over any scalar
// (mbdae/mechanism/flexible/modal_body.py).
#pragma once

#include <algorithm>
#include <vector>

#include "math/factorizations.hpp"
#include "math/fields.hpp"
#include "math/geometry.hpp"

namespace mbdae {

inline bool is_zero(const Vector& x) {
  return std::all_of(x.begin(), x.end(), [](double y) { return y == 0; });
}

struct ModalNode {  // position r; Phi, Psi (k, 3): translations and rotations of modes; Phi2 (k, k, 3): second order
  double r[3] = {0, 0, 0};
  Vector Phi, Psi, Phi2;

  FIELDS(r, Phi, Psi, Phi2)
};

// H2 (k, k, k, 3), Mq1 (k, k, k), Mq2 (k, k, k, k), the index of the derivative first, are empty without displacements
// of second order. Per mode: C, H0 (3,); C2 (k, 3); Mq (k,); Hj (k, 3), sum of m Phi_j x Phi_i; I1 and I2 (k,), in the
// order xx, xy, yy, xz, yz, zz.
struct ModalBody {
  int joint = 0;                                                // joint of the model that moves the frame
  double placement[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};  // placement of the frame on the joint: R by columns, p
  int iq = 0, iv = 0, modes = 0;  // the first coordinate and velocity of the modes, and their number
  Vector C, C2, H0, Mq, Hj, I1, I2, H2, Mq1, Mq2;
  std::vector<ModalNode> nodes;

  bool orthogonal() const {  // whether Mq is diagonal at all q
    bool out = Mq1.empty();
    for (int i = 0; i < modes; ++i)
      for (int j = 0; j < i; ++j) out = out && Mq[i * modes + j] == 0 && Mq[j * modes + i] == 0;
    return out;
  }

  FIELDS(joint, placement, iq, iv, modes, C, C2, H0, Mq, Hj, I1, I2, H2, Mq1, Mq2, nodes)
};

template <class S>
Vec3<S> symmetric(const S* I, const Vec3<S>& x) {
  return {I[0] * x[0] + I[1] * x[1] + I[3] * x[2], I[1] * x[0] + I[2] * x[1] + I[4] * x[2],
          I[3] * x[0] + I[4] * x[1] + I[5] * x[2]};
}

template <class S, class T>
void add_multiple(const S& factor, const T* x, size_t n, S* __restrict out) {
  for (size_t i = 0; i < n; ++i) out[i] = out[i] + factor * x[i];
}

// out (n,) += sum q_i x_i, x_i (n,).
template <class S, class T>
void add_combination(const std::vector<T>& x, const S* q, int k, size_t n, S* __restrict out) {
  for (int i = 0; i < k; ++i) add_multiple(q[i], x.data() + n * i, n, out);
}

// out (n,) += sum q_i q_j x_ij.
template <class S, class T>
void add_quadratic(const std::vector<T>& x, const S* q, int k, size_t n, S* __restrict out) {
  for (int i = 0; i < k; ++i)
    for (int j = 0; j < k; ++j) add_multiple(q[i] * q[j], &x[n * (i * k + j)], n, out);
}

// out (n,) += sum q_i (d0_i + d_i)/2: a polynomial of second order from its derivatives at 0 and at q.
template <class S>
void add_polynomial(const Vector& d0, const std::vector<S>& d, const S* q, int k, size_t n, S* __restrict out) {
  for (int i = 0; i < k; ++i) {
    const S factor = 0.5 * q[i];
    for (size_t l = 0; l < n; ++l) out[l] = out[l] + factor * (d[n * i + l] + d0[n * i + l]);
  }
}

// The polynomials at modal coordinates: first moment S - s0, C, dI/dq_i, I - I0, H, Mq, and dH/dq_j, dMq/dq_j, where
// dMq/dq_j is empty without displacements of second order.
template <class S>
struct Deformation {
  const bool second_order, H_varies;  // H_varies: H depends on q
  Vec3<S> moment;
  std::vector<S> C, dI_dq, H, Mq, dH_dq, dMq_dq;  // (k, 3), (k, 6), (k, 3), (k, k), (k, k, 3), (k, k, k)
  S I[6];

  explicit Deformation(const ModalBody& b)
      : second_order(!b.Mq1.empty()),
        H_varies(second_order || !is_zero(b.Hj)),
        C(b.C.begin(), b.C.end()),
        dI_dq(b.I1.size()),
        H(b.H0.begin(), b.H0.end()),
        Mq(b.Mq.begin(), b.Mq.end()),
        dH_dq(b.Hj.begin(), b.Hj.end()) {}

  // body: the one that the constructor was called with.
  void update(const ModalBody& b, const S* q) {
    const int k = b.modes;
    std::copy(b.I1.begin(), b.I1.end(), dI_dq.begin());
    add_combination(b.I2, q, k, 6 * k, dI_dq.data());  // second derivatives are symmetric in the modes, also below
    if (second_order) update_second_order(b, q);
    moment = {0, 0, 0};
    for (S& x : I) x = 0;
    add_polynomial(b.C, C, q, k, 3, moment.x), add_polynomial(b.I1, dI_dq, q, k, 6, I);
    if (!H_varies) return;
    std::copy(b.H0.begin(), b.H0.end(), H.begin()), add_polynomial(b.Hj, dH_dq, q, k, 3 * k, H.data());
  }

 private:
  void update_second_order(const ModalBody& b, const S* q) {
    const int k = b.modes;
    C.assign(b.C.begin(), b.C.end()), Mq.assign(b.Mq.begin(), b.Mq.end());
    dH_dq.assign(b.Hj.begin(), b.Hj.end()), dMq_dq.assign(b.Mq1.begin(), b.Mq1.end());
    add_combination(b.C2, q, k, 3 * k, C.data()), add_combination(b.H2, q, k, 3 * k * k, dH_dq.data());
    add_combination(b.Mq2, q, k, k * k * k, dMq_dq.data());
    add_polynomial(b.Mq1, dMq_dq, q, k, k * k, Mq.data());
  }
};

// Inertial forces F (6 + k,) due to deformation: on the frame, in its axes, force before moment, and on the modes;
// nu (6 + k,) velocities, A (6,) spatial acceleration of the frame minus gravity, du (k,) modal accelerations or null:
// 0.
template <class S>
void inertial_force(const ModalBody& b, const Deformation<S>& d, const S* nu, const S* A, const S* du, S* F) {
  const int k = b.modes;
  const Vec3<S> v(nu), w(nu + 3), Av(A), Aw(A + 3);
  const S* u = nu + 6;
  Vec3<S> moment_rate(0, 0, 0), C_rate(0, 0, 0), Hu(0, 0, 0), H_rate(0, 0, 0);
  S dI[6] = {0, 0, 0, 0, 0, 0};
  const Vec3<S> vw = cross(v, w);
  for (int i = 0; i < k; ++i) {
    const Vec3<S> C(&d.C[3 * i]), H(&d.H[3 * i]);
    for (int l = 0; l < 6; ++l) dI[l] = dI[l] + u[i] * d.dI_dq[6 * i + l];
    moment_rate = moment_rate + u[i] * C, Hu = Hu + u[i] * H;
    F[6 + i] = dot(C, Av - vw) + dot(H, Aw) - 0.5 * dot(w, symmetric(&d.dI_dq[6 * i], w));
    if (du) {
      C_rate = C_rate + du[i] * C, H_rate = H_rate + du[i] * H;
      for (int j = 0; j < k; ++j) F[6 + i] = F[6 + i] + d.Mq[i * k + j] * du[j];
    }
    if (!d.H_varies) continue;
    Vec3<S> rate(0, 0, 0), row(0, 0, 0);
    for (int j = 0; j < k; ++j)
      add_multiple(u[j], &d.dH_dq[3 * (j * k + i)], 3, rate.x), add_multiple(u[j], &d.dH_dq[3 * (i * k + j)], 3, row.x);
    H_rate = H_rate + u[i] * rate, F[6 + i] = F[6 + i] + dot(w, rate - row);
  }
  if (d.second_order) {
    add_quadratic(b.C2, u, k, 3, C_rate.x);
    for (int j = 0; j < k; ++j) {
      S square = 0;
      for (int i = 0; i < k; ++i) {
        S product = 0;
        for (int l = 0; l < k; ++l) product = product + d.dMq_dq[(j * k + i) * k + l] * u[l];
        F[6 + i] = F[6 + i] + u[j] * product, square = square + u[i] * product;
      }
      F[6 + j] = F[6 + j] - 0.5 * square;
    }
  }
  const Vec3<S> p = cross(w, d.moment) + moment_rate;
  const Vec3<S> h = cross(d.moment, v) + symmetric(d.I, w) + Hu;
  const Vec3<S> force = cross(Aw, d.moment) + C_rate + cross(w, moment_rate) + cross(w, p);
  const Vec3<S> torque = cross(d.moment, Av) + symmetric(d.I, Aw) + H_rate + cross(moment_rate, v) + symmetric(dI, w) +
                         cross(w, h) + cross(v, p);
  for (int l = 0; l < 3; ++l) F[l] = force[l], F[3 + l] = torque[l];
}

}  // namespace mbdae
