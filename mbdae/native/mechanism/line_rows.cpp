#include "mechanism/line_rows.hpp"

#include <algorithm>

#include "math/vec3.hpp"

namespace mbdae {

namespace {

// The line of a row: a direction e through p; with rates if both velocities are given.
struct Line {
  double e[3], p[3], de[3], dp[3];
  double g;  // of rows on profiles
};

// The x and y of to - from along the axes of a.
void in_plane(const Pair& pair, const double* to, const double* from, double* out) {
  for (int j = 0; j < 2; ++j) {
    out[j] = 0;
    for (int i = 0; i < 3; ++i) out[j] += pair.Ra[3 * i + j] * (to[i] - from[i]);
  }
}

const double* in_world(const Pair& pair, double x, double y, double* out) {
  for (int i = 0; i < 3; ++i) out[i] = pair.Ra[3 * i] * x + pair.Ra[3 * i + 1] * y;
  return out;
}

// Solves x . n_i = y_i for three rows n_i.
void meet(const double* n, const double* y, double* x) {
  double c[3][3];
  for (int i = 0; i < 3; ++i) cross(n + 3 * ((i + 1) % 3), n + 3 * ((i + 2) % 3), c[i]);
  const double volume = dot(n, c[0]);
  for (int j = 0; j < 3; ++j) x[j] = (y[0] * c[0][j] + y[1] * c[1][j] + y[2] * c[2][j]) / volume;
}

// Through the point at the distances of the radii from both axes, perpendicular to them (line_rows.py: Bevel).
Line of_bevel(const Row& r, const Pair& pair, const double* va, const double* vb, const double* wa, const double* wb) {
  Line out;
  double ka[3], kb[3], dka[3], dkb[3], n[9], dn[9], y[3], dy[3], more[3];
  turn(pair.Ra, r.a, ka), turn(pair.Rb, r.b, kb), cross(wa, ka, dka), cross(wb, kb, dkb);
  cross(ka, kb, out.e), cross(dka, kb, out.de), cross(ka, dkb, more);
  const double size = norm(out.e, 3);
  double along = 0;
  for (int i = 0; i < 3; ++i) out.e[i] /= size, out.de[i] += more[i], along += out.e[i] * out.de[i];
  for (int i = 0; i < 3; ++i) out.de[i] = (out.de[i] - out.e[i] * along) / size;
  cross(out.e, ka, n), cross(out.de, ka, dn), cross(out.e, dka, more);
  for (int i = 0; i < 3; ++i) dn[i] += more[i];
  cross(kb, out.e, n + 3), cross(dkb, out.e, dn + 3), cross(kb, out.de, more);
  for (int i = 0; i < 3; ++i) dn[3 + i] += more[i];
  std::copy(out.e, out.e + 3, n + 6), std::copy(out.de, out.de + 3, dn + 6);
  const double *at[3] = {pair.pa, pair.pb, pair.pa}, *speed[3] = {va, vb, va}, radius[3] = {r.length, r.other_length, 0};
  for (int i = 0; i < 3; ++i) {
    y[i] = dot(n + 3 * i, at[i]) + radius[i];
    dy[i] = dot(dn + 3 * i, at[i]) + dot(n + 3 * i, speed[i]);
  }
  meet(n, y, out.p);
  for (int i = 0; i < 3; ++i) dy[i] -= dot(dn + 3 * i, out.p);
  meet(n, dy, out.dp);
  return out;
}

Line line_of(const Row& r, const Pair& pair, const double* Va, const double* Vb, const ContactKinematics* touch) {
  Line out;
  double more[3];
  auto at = [](const double* V, const double* p, double* dp) {
    cross(V + 3, p, dp);
    for (int i = 0; i < 3; ++i) dp[i] += V[i];
  };
  if (touch) {
    const bool up = r.kind == Row::height;
    for (int i = 0; i < 3; ++i) {
      out.e[i] = up ? touch->n[i] : r.share[0] * touch->ahead[i] + r.share[1] * touch->left[i];
      out.de[i] = up ? touch->dn[i] : r.share[0] * touch->dahead[i] + r.share[1] * touch->dleft[i];
      out.p[i] = touch->p[i], out.dp[i] = touch->dp[i];
    }
    return out;
  }
  std::copy(pair.pb, pair.pb + 3, out.p), at(Vb, pair.pb, out.dp);
  if (r.kind == Row::roller) {
    double x[2], rate[2], va[3], t[2], dt[2];
    at(Va, pair.pb, va), in_plane(pair, out.p, pair.pa, x), in_plane(pair, out.dp, va, rate);
    const Profile::Place c = r.profile->nearest(x);
    const double off[2] = {x[0] - c.c[0], x[1] - c.c[1]}, size = norm(c.d, 2);
    const double ds = dot(rate, c.d, 2) / (size * size - dot(off, c.dd, 2));
    for (int i = 0; i < 2; ++i) t[i] = c.d[i] / size;
    const double along = dot(t, c.dd, 2), side = r.profile->side;
    for (int i = 0; i < 2; ++i) dt[i] = (c.dd[i] - t[i] * along) * ds / size;
    cross(Va + 3, in_world(pair, side * t[1], -side * t[0], out.e), out.de);
    in_world(pair, side * dt[1], -side * dt[0], more);
    for (int i = 0; i < 3; ++i) out.de[i] += more[i];
    out.g = side * (off[0] * t[1] - off[1] * t[0]) - r.length;
    return out;
  }
  if (r.kind == Row::flat_face) {
    double n[2], dn[2], spin[3], c[3];
    turn(pair.Rb, r.b, out.e), cross(Vb + 3, out.e, out.de), cross(Va + 3, out.e, spin);
    const double none[3] = {0, 0, 0};
    in_plane(pair, out.e, none, n), in_plane(pair, out.de, spin, dn);
    const Profile::Place p = r.profile->support(n);
    const double ds = -dot(p.d, dn, 2) / dot(p.dd, n, 2);
    in_world(pair, p.c[0], p.c[1], c), in_world(pair, p.d[0] * ds, p.d[1] * ds, more);
    out.g = 0;
    for (int i = 0; i < 3; ++i) out.p[i] = pair.pa[i] + c[i], out.g += out.e[i] * (pair.pb[i] - out.p[i]);
    at(Va, out.p, out.dp);
    for (int i = 0; i < 3; ++i) out.dp[i] += more[i];
    return out;
  }
  if (r.kind == Row::knife_edge) {
    turn(pair.Rb, r.b, out.e), cross(Vb + 3, out.e, out.de);
    return out;
  }
  double d[3], dd[3], va[3], k[3], dk[3];
  at(Va, pair.pa, va);
  if (r.kind == Row::bevel) return of_bevel(r, pair, va, out.dp, Va + 3, Vb + 3);
  turn(pair.Ra, r.a, out.e), cross(Va + 3, out.e, out.de);
  if (r.kind == Row::screw) return out;
  std::copy(out.e, out.e + 3, k), std::copy(out.de, out.de + 3, dk);
  for (int i = 0; i < 3; ++i) {
    d[i] = pair.pb[i] - pair.pa[i], dd[i] = out.dp[i] - va[i];
    out.p[i] = pair.pa[i] + r.length * d[i], out.dp[i] = va[i] + r.length * dd[i];
  }
  cross(k, d, out.e), cross(dk, d, out.de), cross(k, dd, more);
  const double size = norm(out.e, 3);
  double along = 0;
  for (int i = 0; i < 3; ++i) out.e[i] /= size, out.de[i] += more[i], along += out.e[i] * out.de[i];
  for (int i = 0; i < 3; ++i) out.de[i] = (out.de[i] - out.e[i] * along) / size;
  return out;
}

}  // namespace

bool touches(const Row& r) { return r.kind == Row::height || r.kind == Row::grip; }

double line_wrench(const Row& r, const Pair& pair, double* w) {
  const double still[6] = {0, 0, 0, 0, 0, 0};
  const Line l = line_of(r, pair, still, still, touches(r) ? &pair.touch(r.shape, false) : nullptr);
  double g = 0;
  std::copy(l.e, l.e + 3, w), cross(l.p, l.e, w + 3);
  for (int i = 0; i < 3; ++i) {
    if (r.kind == Row::screw) w[3 + i] -= r.length * l.e[i];
    g += l.e[i] * (l.p[i] - pair.pa[i]);
  }
  if (r.profile) return l.g;
  return r.shape.surface == Shape::plane ? g : g - r.shape.curve;
}

void line_rate(const Row& r, const Pair& pair, const double* Va, const double* Vb, const ContactKinematics* touch, double* dw) {
  const Line l = line_of(r, pair, Va, Vb, touch);
  double more[3];
  std::copy(l.de, l.de + 3, dw), cross(l.dp, l.e, dw + 3), cross(l.p, l.de, more);
  for (int i = 0; i < 3; ++i) dw[3 + i] += more[i] - (r.kind == Row::screw ? r.length * l.de[i] : 0);
}


void line_partials(const Row& r, const Pair& pair, WrenchPartials& t) {
  double V[2][6] = {{0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}}, dw[6];
  ContactKinematics here;
  for (int side = 0; side < 2; ++side)
    for (int j = 0; j < 6; ++j) {
      V[side][j] = 1;
      if (touches(r)) touch(r.shape, pair, V[0], V[1], here);
      line_rate(r, pair, V[0], V[1], touches(r) ? &here : nullptr, dw);
      V[side][j] = 0;
      for (int i = 0; i < 6; ++i) (side ? t.Db : t.Da)[6 * i + j] = dw[i];
    }
}

}  // namespace mbdae
