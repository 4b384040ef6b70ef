#include "manifold.hpp"

#include <algorithm>
#include <cmath>

#include "signals.hpp"
#include "vec3.hpp"

namespace mbdae {

void inverse_jacobian(const Limits& limits, int n, const double* ad, const double* x, double* y) {
  double term[6], next[6], size = 0;
  auto apply = [&](const double* in, double* out) {
    for (int i = 0; i < n; ++i) {
      double s = 0;
      for (int j = 0; j < n; ++j) s += ad[i * n + j] * in[j];
      out[i] = s;
    }
  };
  apply(x, next);
  for (int i = 0; i < n; ++i) y[i] = x[i] + 0.5 * next[i], size = std::max(size, std::fabs(x[i])), term[i] = x[i];
  for (double b : limits.series) {
    apply(term, next), apply(next, term);
    double largest = 0;
    for (int i = 0; i < n; ++i) y[i] += b * term[i], largest = std::max(largest, std::fabs(term[i]));
    if (largest * std::fabs(b) <= limits.series_end * size) break;
  }
}

Manifold::Manifold(Mechanics& m, bool flat_, std::vector<Block> blocks, std::vector<int> turning)
    : flat(flat_), m_(m), blocks_(std::move(blocks)), turning_(std::move(turning)), neutral_(m.nq) {
  m.neutral(neutral_.data());
}

void Manifold::integrate(const double* q, const double* x, double* out) const {
  if (!flat) return m_.integrate(q, x, out);
  for (int i = 0; i < m_.nq; ++i) out[i] = q[i] + x[i];
}

void Manifold::difference(const double* q0, const double* q1, double* out) const {
  if (!flat) return m_.difference(q0, q1, out);
  for (int i = 0; i < m_.nv; ++i) out[i] = q1[i] - q0[i];
}

void Manifold::size(const double* q, double* out) const {
  if (!flat) m_.difference(neutral_.data(), q, out);
  for (int i = 0; i < m_.nv; ++i) out[i] = flat ? std::fabs(q[i]) : turning_[i] ? 1.0 : std::fabs(out[i]);
}

void Manifold::within(const double* x) const {
  for (const Block& b : blocks_) {
    const double turn =
        b.kind == Block::se2 ? std::fabs(x[b.at + 2]) : norm(x + b.at + (b.kind == Block::se3 ? 3 : 0), 3);
    if (turn > m_.limits.largest_turn) throw Trouble();
  }
}

void Manifold::tangent(const double* x, double* dx) const {
  if (blocks_.empty()) return;
  within(x);
  for (const Block& b : blocks_) {
    const double* p = x + b.at;
    double ad[36] = {0}, out[6];
    int n = 3;
    auto skew = [&](const double* w, int row, int column, int width) {
      ad[row * width + column + 1] = -w[2], ad[row * width + column + 2] = w[1];
      ad[(row + 1) * width + column] = w[2], ad[(row + 1) * width + column + 2] = -w[0];
      ad[(row + 2) * width + column] = -w[1], ad[(row + 2) * width + column + 1] = w[0];
    };
    if (b.kind == Block::so3) {
      skew(p, 0, 0, 3);
    } else if (b.kind == Block::se3) {
      n = 6, skew(p + 3, 0, 0, 6), skew(p, 0, 3, 6), skew(p + 3, 3, 3, 6);
    } else {
      ad[1] = -p[2], ad[2] = p[1], ad[3] = p[2], ad[5] = -p[0];
    }
    inverse_jacobian(m_.limits, n, ad, dx + b.at, out);
    std::copy(out, out + n, dx + b.at);
  }
}

}  // namespace mbdae
