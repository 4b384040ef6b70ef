// What motions of places and frames, masses and gravity do at a point: cotangents of all stuff.
#include "tangents/parameter_slopes.hpp"
#include "numbers/vec3.hpp"

namespace mbdae {

namespace {

void wrench_cross(const double* d, const double* F, double* out) {  // d x* F
  double other[3];
  cross(d + 3, F, out), cross(d + 3, F + 3, out + 3), cross(d, F, other);
  for (int i = 0; i < 3; ++i) out[3 + i] += other[i];
}

void momentum(const Body& b, const double* V, double* out) {  // I V, at the world's origin
  double arm[3];
  cross(V + 3, b.centre, arm);
  for (int i = 0; i < 3; ++i) out[i] = b.mass * (V[i] + arm[i]);
  cross(b.centre, out, out + 3);
  for (int i = 0; i < 3; ++i) out[3 + i] += dot(b.I + 3 * i, V + 3);
}

// Adds the slopes of U . I A by the ten inertial numbers, in the body's axes, times a factor.
void inertial(const double* U, const double* A, double factor, double* out) {
  double first[3], second[3];
  cross(A + 3, U, first), cross(A, U + 3, second);
  const double *w = U + 3, *a = A + 3;
  out[0] += factor * dot(U, A);
  for (int i = 0; i < 3; ++i) out[1 + i] += factor * (second[i] - first[i]);
  out[4] += factor * w[0] * a[0], out[5] += factor * (w[0] * a[1] + w[1] * a[0]), out[6] += factor * w[1] * a[1];
  out[7] += factor * (w[0] * a[2] + w[2] * a[0]), out[8] += factor * (w[1] * a[2] + w[2] * a[1]);
  out[9] += factor * w[2] * a[2];
}

bool still(const std::array<double, 6>& x) {
  return !(x[0] != 0 || x[1] != 0 || x[2] != 0 || x[3] != 0 || x[4] != 0 || x[5] != 0);
}

void transposed(const double* R, const double* x, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2];
}

void local(const double* R, const double* p, const double* X, double* out) {  // a motion in a body's axes
  double moved[3];
  cross(X + 3, p, moved);
  for (int i = 0; i < 3; ++i) moved[i] += X[i];
  transposed(R, moved, out), transposed(R, X + 3, out + 3);
}

void add_motion(const double* R, const double* p, const double* g, double* out) {  // of slopes by a motion in the world
  double turned[3], all[6];
  cross(g, p, turned);
  for (int i = 0; i < 3; ++i) turned[i] += g[3 + i];
  transposed(R, g, all), transposed(R, turned, all + 3);
  for (int i = 0; i < 6; ++i) out[i] += all[i];
}

}  // namespace

void ParameterSlopes::twists(const double* J, const double* v, std::vector<Six>& out) const {
  for (int j = 1; j < s_.mechanics.joints; ++j) {
    out[j] = out[s_.mechanics.parents[j]];
    for (int c : columns_[j])
      for (int i = 0; i < 6; ++i) out[j][i] += J[6 * c + i] * v[c];
  }
}

void ParameterSlopes::locate(std::vector<Placed>& out) const {
  static const Anchor origin;
  const Mechanics& m = s_.mechanics;
  for (size_t i = 0; i < stuff_.size(); ++i) {
    const Stuff& x = stuff_[i];
    if (x.of == Stuff::place) m.place(x.at, out[i].R, out[i].p);
    if (x.of != Stuff::frame && x.of != Stuff::inertia) continue;
    const Anchor* a = &origin;
    if (x.of == Stuff::frame) {
      const Pair& pair = x.of_law ? s_.law_pairs()[x.at] : s_.constraints.pairs[x.at];
      a = x.b ? &pair.b : &pair.a;
    }
    const int joint = x.of == Stuff::frame ? a->joint : x.at;
    const double *o = m.rotation(joint), *at = m.position(joint);  // o by columns
    for (int k = 0; k < 3; ++k) {
      out[i].p[k] = o[k] * a->p[0] + o[3 + k] * a->p[1] + o[6 + k] * a->p[2] + at[k];
      for (int l = 0; l < 3; ++l)
        out[i].R[3 * k + l] = o[k] * a->R[l] + o[3 + k] * a->R[3 + l] + o[6 + k] * a->R[6 + l];
    }
  }
}

void ParameterSlopes::moved(const Pair& pair, const Turning& t, const std::vector<Six>& X) {
  const int a = pair.a.joint, b = pair.b.joint;
  Six relative, by_a{}, by_b{}, damping{};
  for (int i = 0; i < 6; ++i) relative[i] = X[b][i] - X[a][i];
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) {
      by_a[j] += relative[i] * t.Da[6 * i + j], by_b[j] += relative[i] * t.Db[6 * i + j];
      if (t.damped) damping[j] += relative[i] * t.C[6 * i + j];
    }
  for (const Moving& m : ends_.at(&pair)) {
    const Stuff& x = stuff_[m.stuff];
    Six g = m.b ? by_b : by_a;
    if (x.of == Stuff::place) {
      const int end = m.b ? b : a, before = s_.mechanics.parents[x.at];
      double Y[6], turned[6];
      for (int i = 0; i < 6; ++i) Y[i] = X[end][i] - X[before][i];
      wrench_cross(Y, t.F, turned);
      for (int i = 0; i < 6; ++i) g[i] += m.b ? turned[i] : -turned[i];
      if (t.damped) {
        for (int i = 0; i < 6; ++i) Y[i] = V_[end][i] - V_[before][i];
        wrench_cross(Y, damping.data(), turned);
        for (int i = 0; i < 6; ++i) g[i] += m.b ? turned[i] : -turned[i];
      }
    }
    for (int i = 0; i < 6; ++i) pull_[m.stuff][i] += g[i];
  }
}

void ParameterSlopes::shifted(const Pair& pair, const double* F) {
  for (const Moving& m : ends_.at(&pair))
    for (int i = 0; i < 6; ++i) pull_[m.stuff][i] += m.b ? F[i] : -F[i];
}

void ParameterSlopes::pulled(const std::vector<Placed>& placed) {
  for (size_t s = 0; s < stuff_.size(); ++s) {
    if (still(pull_[s])) continue;
    add_motion(placed[s].R, placed[s].p, pull_[s].data(), sums_[s].data());
    pull_[s] = Six{};
  }
}

void ParameterSlopes::momenta() {
  const int joints = s_.mechanics.joints;
  F_[0] = Six{};
  for (int j = 1; j < joints; ++j) {
    double turned[6];
    momentum(body_[j], A_[j].data(), F_[j].data()), momentum(body_[j], V_[j].data(), h_[j].data());
    wrench_cross(V_[j].data(), h_[j].data(), turned);
    for (int i = 0; i < 6; ++i) F_[j][i] += turned[i];
  }
  for (int j = joints - 1; j > 0; --j)
    for (int i = 0; i < 6; ++i) F_[s_.mechanics.parents[j]][i] += F_[j][i];
}

// With all that is behind a joint held, and what is before it moved by -xi: U, V, A there become U x xi, ...
void ParameterSlopes::bodies() {
  const int joints = s_.mechanics.joints;
  for (int j = 1; j < joints; ++j) {
    double VU[6], IVU[6], turned[6];
    const double *V = V_[j].data(), *U = U_[j].data();
    H_[j] = C_[j] = Six{};
    if (still(U_[j])) continue;
    momentum(body_[j], U, H_[j].data());
    if (!placing_) continue;
    motion_cross(V, U, VU), momentum(body_[j], VU, IVU);
    wrench_cross(V, H_[j].data(), C_[j].data()), wrench_cross(U, h_[j].data(), turned);
    for (int i = 0; i < 6; ++i) C_[j][i] -= turned[i] + IVU[i];
  }
  H_[0] = C_[0] = Six{};
  for (int j = joints - 1; j > 0; --j) {
    const int p = s_.mechanics.parents[j];
    for (int i = 0; i < 6; ++i) H_[p][i] += H_[j][i], C_[p][i] += C_[j][i];
  }
}

void ParameterSlopes::contract(const VariedPoint& point, const double* above, const double* nu) {
  const Mechanics& m = s_.mechanics;
  const int nv = s_.nv;
  if (kinematic_ && above) {
    twists(J_.data(), above, U_);
    bodies();
    for (const ActingWrench& w : point.wrenches) {
      if (ends_.at(w.pair).empty()) continue;
      const double power = w.conservative ? 0 : above[n_ - 1];
      for (int j = 0; j < m.joints; ++j)
        for (int i = 0; i < 6; ++i) X_[j][i] = U_[j][i] + power * V_[j][i];
      moved(*w.pair, w.turning, X_);
    }
    pulled(here_);
  }
  for (size_t i = 0; above && i < stuff_.size(); ++i) {
    const Stuff& x = stuff_[i];
    double* to = sums_[i].data();
    if (x.of == Stuff::armature)
      for (int k = 0; k < nv; ++k) to[k] -= above[k] * point.vdot[k];
    if (x.of == Stuff::gravity && point.loaded)
      for (int k = 0; k < 3; ++k) to[k] += H_[0][k];
    if (x.of == Stuff::inertia && !still(U_[x.at])) {
      double U[6], V[6], A[6], VU[6];
      local(here_[i].R, here_[i].p, U_[x.at].data(), U), local(here_[i].R, here_[i].p, V_[x.at].data(), V);
      local(here_[i].R, here_[i].p, A_[x.at].data(), A);
      motion_cross(V, U, VU);
      inertial(U, A, -1, to), inertial(VU, V, 1, to);
    }
    if (x.of == Stuff::place) {
      const int p = m.parents[x.at];
      if (still(U_[p]) && still(H_[x.at]) && still(C_[x.at])) continue;
      double turned[6], rest[6];
      Six g;
      wrench_cross(V_[p].data(), H_[x.at].data(), rest);
      for (int k = 0; k < 6; ++k) rest[k] = C_[x.at][k] - rest[k];
      wrench_cross(V_[p].data(), rest, g.data());
      wrench_cross(U_[p].data(), F_[x.at].data(), turned);
      for (int k = 0; k < 6; ++k) g[k] += turned[k];
      wrench_cross(A_[p].data(), H_[x.at].data(), turned);
      for (int k = 0; k < 6; ++k) g[k] += turned[k];
      add_motion(here_[i].R, here_[i].p, g.data(), to);
    }
  }
  for (size_t i = 0; nu && i < met_.size(); ++i) {
    for (const auto& [pair, rows] : met_[i].rows) {
      Turning sum;
      bool asked = false;
      for (const auto& [at, t] : rows) {
        const double w = met_[i].weight * nu[at];
        if (w == 0) continue;
        asked = true;
        for (int k = 0; k < 6; ++k) sum.F[k] += w * t.F[k];
        for (int k = 0; k < 36; ++k) sum.Da[k] += w * t.Da[k], sum.Db[k] += w * t.Db[k];
      }
      if (!asked) continue;
      if (met_[i].kind == VariedPoint::Met::gap)
        shifted(*pair, sum.F);
      else
        moved(*pair, sum, met_[i].V);
    }
    pulled(met_[i].placed);
  }
}

}  // namespace mbdae
