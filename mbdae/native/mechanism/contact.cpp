#include "mechanism/contact.hpp"

#include <cmath>

#include "mechanism/mechanics.hpp"
#include "mechanism/rows.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

const double NONE[6] = {0, 0, 0, 0, 0, 0};

// x := x/|x|, dx := its rate; |x|
double unit(double* x, double* dx) {
  const double size = norm(x, 3);
  for (int i = 0; i < 3; ++i) x[i] /= size;
  const double along = dot(x, dx, 3);
  for (int i = 0; i < 3; ++i) dx[i] = (dx[i] - x[i] * along) / size;
  return size;
}

void moved(const double* V, const double* p, double* out) {
  cross(V + 3, p, out);
  for (int i = 0; i < 3; ++i) out[i] += V[i];
}

void column(const double* R, int k, double* out) { out[0] = R[k], out[1] = R[3 + k], out[2] = R[6 + k]; }

// out := a x b, dout := its rate
void crossed(const double* a, const double* da, const double* b, const double* db, double* out, double* dout) {
  double more[3];
  cross(a, b, out), cross(da, b, dout), cross(a, db, more);
  for (int i = 0; i < 3; ++i) dout[i] += more[i];
}

void normal(const Shape& s, const Pair& pair, const double* Va, const double* Vb, ContactKinematics& out) {
  double z[3], dz[3];
  column(pair.Ra, 2, z), cross(Va + 3, z, dz);
  if (s.surface == Shape::plane) {
    for (int i = 0; i < 3; ++i) out.n[i] = z[i], out.dn[i] = dz[i];
    return;
  }
  double va[3];
  moved(Vb, pair.pb, out.dn), moved(Va, pair.pa, va);
  for (int i = 0; i < 3; ++i) out.n[i] = pair.pb[i] - pair.pa[i], out.dn[i] -= va[i];
  if (s.surface == Shape::cylinder) {
    const double along = dot(z, out.n, 3), rate = dot(dz, out.n, 3) + dot(z, out.dn, 3);
    for (int i = 0; i < 3; ++i) out.n[i] -= along * z[i], out.dn[i] -= along * dz[i] + rate * z[i];
  }
  if (!(unit(out.n, out.dn) > 0)) throw FallBackToPython();
  if (s.curve < 0)
    for (int i = 0; i < 3; ++i) out.n[i] = -out.n[i], out.dn[i] = -out.dn[i];
}

void lowest_of_ellipsoid(const Shape& s, const Pair& pair, const double* Vb, ContactKinematics& out) {
  const double *R = pair.Rb, *w = Vb + 3;
  double c[3], dc[3], Dn[3], dDn[3], spin[3], local[3], more[3];
  auto stretch = [&](const double* x, double* y) {  // y = R D R^T x
    for (int i = 0; i < 3; ++i) local[i] = s.squares[i] * (R[i] * x[0] + R[3 + i] * x[1] + R[6 + i] * x[2]);
    turn(R, local, y);
  };
  turn(R, s.centre, c), cross(w, c, dc), stretch(out.n, Dn), cross(w, out.n, spin);
  for (int i = 0; i < 3; ++i) spin[i] = out.dn[i] - spin[i];
  const double size = std::sqrt(dot(out.n, Dn, 3));
  stretch(spin, dDn), cross(w, Dn, more);
  const double along = dot(Dn, spin, 3) / size;
  for (int i = 0; i < 3; ++i) {
    out.p[i] += c[i] - Dn[i] / size;
    out.dp[i] += dc[i] - (dDn[i] + more[i] - Dn[i] / size * along) / size;
  }
}

}  // namespace

void touch(const Shape& s, const Pair& pair, const double* Va, const double* Vb, ContactKinematics& out) {
  if (!Va) Va = Vb = NONE;
  normal(s, pair, Va, Vb, out);
  const double *n = out.n, *dn = out.dn;
  for (int i = 0; i < 3; ++i) out.p[i] = pair.pb[i];
  moved(Vb, pair.pb, out.dp);
  double axle[3], daxle[3];
  if (s.body == Shape::ellipsoid) lowest_of_ellipsoid(s, pair, Vb, out);
  for (int i = 0; i < 3; ++i) out.p[i] -= s.tyre * n[i], out.dp[i] -= s.tyre * dn[i];
  if (s.body == Shape::wheel) {
    turn(pair.Rb, s.axle, axle), cross(Vb + 3, axle, daxle);
    crossed(axle, daxle, n, dn, out.ahead, out.dahead);
    if (!(unit(out.ahead, out.dahead) > s.flat)) throw FallBackToPython();
    if (s.rim > 0) {  // u = ahead x axle, the unit vector along n - (n . s) s
      double u[3], du[3];
      crossed(out.ahead, out.dahead, axle, daxle, u, du);
      for (int i = 0; i < 3; ++i) out.p[i] -= s.rim * u[i], out.dp[i] -= s.rim * du[i];
    }
  } else if (s.surface == Shape::plane) {
    column(pair.Ra, 0, out.ahead), cross(Va + 3, out.ahead, out.dahead);
  } else {
    double d[3], dd[3];
    column(pair.Ra, 2, d);
    if (s.surface == Shape::ball && std::fabs(dot(n, d, 3)) > s.polar) column(pair.Ra, 0, d);
    cross(Va + 3, d, dd), crossed(d, dd, n, dn, out.ahead, out.dahead), unit(out.ahead, out.dahead);
  }
  crossed(n, dn, out.ahead, out.dahead, out.left, out.dleft);
}

}  // namespace mbdae
