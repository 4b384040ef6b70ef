#include "lines.hpp"

#include <algorithm>

#include "vec3.hpp"

namespace mbdae {

namespace {

// The line of a row: a direction e through p; and their rates where both velocities are given.
struct Line {
  double e[3], p[3], de[3], dp[3];
};

Line line_of(const Row& r, const Pair& pair, const double* Va, const double* Vb, const Touch* touch) {
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
  if (r.kind == Row::knife_edge) {
    turn(pair.Rb, r.b, out.e), cross(Vb + 3, out.e, out.de);
    return out;
  }
  turn(pair.Ra, r.a, out.e), cross(Va + 3, out.e, out.de);
  if (r.kind == Row::screw) return out;
  double d[3], dd[3], va[3], k[3], dk[3];
  at(Va, pair.pa, va), std::copy(out.e, out.e + 3, k), std::copy(out.de, out.de + 3, dk);
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
  return r.shape.surface == Shape::plane ? g : g - r.shape.curve;
}

void line_rate(const Row& r, const Pair& pair, const double* Va, const double* Vb, const Touch* touch, double* dw) {
  const Line l = line_of(r, pair, Va, Vb, touch);
  double more[3];
  std::copy(l.de, l.de + 3, dw), cross(l.dp, l.e, dw + 3), cross(l.p, l.de, more);
  for (int i = 0; i < 3; ++i) dw[3 + i] += more[i] - (r.kind == Row::screw ? r.length * l.de[i] : 0);
}


void slopes_of_line(const Row& r, const Pair& pair, Turning& t) {
  double V[2][6] = {{0, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}}, dw[6];
  Touch here;
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
