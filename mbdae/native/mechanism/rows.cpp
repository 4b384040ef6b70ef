// Rows of closures: constraint values, wrenches, rates and partials.
#include "mechanism/rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "mechanism/line_rows.hpp"
#include "mechanism/wrench_partials.hpp"
#include "math/vec3.hpp"

namespace mbdae {

namespace {

void frame_pose(const MultibodyTree& m, const Anchor& x, bool with_rotation, double* __restrict R, double* __restrict p) {
  if (!x.joint) return;  // fixed to the world: constant
  const double* __restrict o = m.rotation(x.joint), * __restrict origin = m.position(x.joint);  // o by columns
  for (int i = 0; i < 3; ++i) p[i] = o[i] * x.p[0] + o[3 + i] * x.p[1] + o[6 + i] * x.p[2] + origin[i];
  if (!with_rotation) return;
  if (x.is_identity) {
    for (int i = 0; i < 3; ++i) R[3 * i] = o[i], R[3 * i + 1] = o[3 + i], R[3 * i + 2] = o[6 + i];
    return;
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) R[3 * i + j] = o[i] * x.R[j] + o[3 + i] * x.R[3 + j] + o[6 + i] * x.R[6 + j];
}

Six difference(const double* a, const double* b) {  // b - a
  return {b[0] - a[0], b[1] - a[1], b[2] - a[2], b[3] - a[3], b[4] - a[4], b[5] - a[5]};
}

double angle(const double* q, const RowJoint& j) { return j.nq == 1 ? q[j.iq] : std::atan2(q[j.iq + 1], q[j.iq]); }

void horner(const std::vector<double>& c, double x, double& p, double& first, double& second) {
  p = first = second = 0;
  for (size_t i = c.size(); i-- > 0;) second = second * x + 2 * first, first = first * x + p, p = p * x + c[i];
}

}  // namespace

Pair::Pair(const Anchor& a_, const Anchor& b_, const std::vector<MultibodyTree::Support>& supports) : a(a_), b(b_) {
  std::map<std::pair<int, int>, double> all;
  for (const Anchor* x : {&a, &b}) {
    const auto& [velocities, from] = supports[x->joint];
    for (size_t k = 0; k < from.size(); ++k) all[{velocities[k], from[k]}] += x == &b ? 1 : -1;
  }
  for (const auto& [column, s] : all)
    columns.push_back(column.first), sources.push_back(column.second), sign.push_back(s);
  has_repeated_columns = std::adjacent_find(columns.begin(), columns.end()) != columns.end();
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (Anchor* x : {&a, &b}) x->is_identity = std::equal(identity, identity + 9, x->R);
  std::copy(a.R, a.R + 9, Ra), std::copy(a.p, a.p + 3, pa), std::copy(b.R, b.R + 9, Rb), std::copy(b.p, b.p + 3, pb);
}

void Pair::update_frames(const MultibodyTree& m) {
  frame_pose(m, a, needs_Ra, Ra, pa), frame_pose(m, b, needs_Rb, Rb, pb);
  contact_current_ = moving_contact_current_ = false, pose_stamp_ = m.pose_stamp();
}

void Pair::update_velocities(const MultibodyTree& m, bool minus_gravity) {
  double other[6];
  m.velocity(a.joint, Va), m.velocity(b.joint, Vb);
  const auto acceleration = minus_gravity ? &MultibodyTree::bias_minus_gravity : &MultibodyTree::acceleration;
  (m.*acceleration)(a.joint, other), (m.*acceleration)(b.joint, A);
  for (int i = 0; i < 6; ++i) A[i] -= other[i];
  moving_contact_current_ = false;
}

const Contact<double>& Pair::contact(const Shape& s) const {
  if (!contact_current_) contact_ = mbdae::contact_of(s, frames_of(*this)), contact_current_ = true;
  return contact_;
}

const Contact<Dual<1>>& Pair::moving_contact(const Shape& s) const {
  if (!moving_contact_current_)
    moving_contact_ = mbdae::contact_of(s, moving_frames(*this, difference(Va, Vb).data())),
    moving_contact_current_ = true;
  return moving_contact_;
}

void Pair::relative(const MultibodyTree& m, const double* v, double* out) const {
  std::fill(out, out + 6, 0.0);
  for (size_t k = 0; k < columns.size(); ++k) {
    const double f = sign[k] * v[columns[k]], *J = m.J() + 6 * sources[k];
    for (int i = 0; i < 6; ++i) out[i] += J[i] * f;
  }
}

void Pair::generalized_force(const MultibodyTree& m, const double* w, double factor, double* tau) const {
  for (size_t k = 0; k < columns.size(); ++k) {
    const double* J = m.J() + 6 * sources[k];
    tau[columns[k]] += factor * sign[k] * (dot(w, J) + dot(w + 3, J + 3));
  }
}

double unit_gap(const Pair& pair, double* n) {
  for (int i = 0; i < 3; ++i) n[i] = pair.pb[i] - pair.pa[i];
  const double d = std::sqrt(dot(n, n));
  if (!(d > 0)) {
    n[0] = 1, n[1] = n[2] = 0;
    return std::numeric_limits<double>::min();
  }
  for (int i = 0; i < 3; ++i) n[i] /= d;
  return d;
}

double Row::wrench_along_line(const Pair& pair, double* w) const {
  Wrench<double> line;
  const double g = line_wrench(*this, frames_of(pair), has_contact(*this) ? &pair.contact(shape) : nullptr, line);
  return read(line, w, nullptr), g;
}

double Row::wrench(const Pair& pair, double* w) const {
  if (along_line()) return wrench_along_line(pair, w);
  double g = 0;
  if (kind == dot_product_1) {
    double x[3], y[3];
    rotate(pair.Ra, a, x), rotate(pair.Rb, b, y);
    g = dot(x, y);
    w[0] = w[1] = w[2] = 0;
    cross(y, x, w + 3);
    return g;
  }
  if (kind == dot_product_2) {
    const double d[3] = {pair.pb[0] - pair.pa[0], pair.pb[1] - pair.pa[1], pair.pb[2] - pair.pa[2]};
    rotate(pair.Ra, a, w);
    g = dot(d, w);
  } else {
    g = unit_gap(pair, w) - length;
  }
  cross(pair.pb, w, w + 3);
  return g;
}

double Row::rate(const Pair& pair) const {
  double w[6], dw[6] = {0, 0, 0, 0, 0, 0}, out = 0;
  const Six relative = difference(pair.Va, pair.Vb);
  if (along_line()) {  // a common motion of both frames, V_a, changes w by V_a x* w
    Wrench<Dual<1>> line;
    double common[6];
    const auto frames = moving_frames(pair, relative.data());
    line_wrench(*this, frames, has_contact(*this) ? &pair.moving_contact(shape) : nullptr, line);
    read(line, w, dw), wrench_cross(pair.Va, w, common);
    for (int i = 0; i < 6; ++i) out += pair.A[i] * w[i] + relative[i] * (dw[i] + common[i]);
    return out;
  }
  wrench(pair, w);
  for (int i = 0; i < 6; ++i) out += pair.A[i] * w[i];
  if (kind == dot_product_1) {
    double x[3], y[3], dx[3], dy[3], s[3], u[3];
    rotate(pair.Ra, a, x), rotate(pair.Rb, b, y);
    cross(pair.Va + 3, x, dx), cross(pair.Vb + 3, y, dy);
    cross(dy, x, s), cross(y, dx, u);
    for (int i = 0; i < 3; ++i) dw[3 + i] = s[i] + u[i];
  } else {
    double dpb[3], s[3], u[3];
    cross(pair.Vb + 3, pair.pb, dpb);
    for (int i = 0; i < 3; ++i) dpb[i] += pair.Vb[i];
    if (kind == dot_product_2) {
      cross(pair.Va + 3, w, dw);
    } else {
      double dpa[3], n[3];
      cross(pair.Va + 3, pair.pa, dpa);
      const double d = unit_gap(pair, n);
      double along = 0;
      for (int i = 0; i < 3; ++i) dpa[i] += pair.Va[i], along += n[i] * (dpb[i] - dpa[i]);
      for (int i = 0; i < 3; ++i) dw[i] = (dpb[i] - dpa[i] - n[i] * along) / d;
    }
    cross(dpb, w, s), cross(pair.pb, dw, u);
    for (int i = 0; i < 3; ++i) dw[3 + i] = s[i] + u[i];
  }
  for (int i = 0; i < 6; ++i) out += relative[i] * dw[i];
  return out;
}

void Row::partials(const Pair& pair, WrenchPartials& t) const {
  if (along_line()) {
    const Frames<Dual<6>> frames = moving_frames(pair);
    Contact<Dual<6>> contact;
    Wrench<Dual<6>> line;
    if (has_contact(*this)) contact = mbdae::contact_of(shape, frames);
    line_wrench(*this, frames, &contact, line);
    return read(line, t.F, t.Db), t.complete();
  }
  wrench(pair, t.F);
  if (kind == distance) return distance_partials(pair, 1, t);
  double x[3], y[3], X[9], XX[9];
  rotate(pair.Ra, a, x);
  if (kind == dot_product_1) {
    rotate(pair.Rb, b, y);
    skew_product(y, x, XX), add_block(t.Da, 3, 3, XX, -1);
    skew_product(x, y, XX), add_block(t.Db, 3, 3, XX, 1);
    return;
  }
  skew(x, X), skew_product(pair.pb, x, XX);
  add_block(t.Da, 0, 3, X, -1), add_block(t.Da, 3, 3, XX, -1);
  line_point_partials(pair.pb, x, t.Db);
}

double Row::coordinate_value(const double* q, double* first) const {
  if (kind == ratio) {
    double first_derivative, second_derivative;
    horner(c, joints.size() < 3 ? 0 : angle(q, joints[2]), *first, first_derivative, second_derivative);
    return 0;
  }
  const double x = angle(q, joints[0]);
  double p = 0, second = 0;
  *first = 0;
  if (kind == curved) {
    const double reduced = reduced_coordinate(q, &p);
    *first = law.at(reduced, 1);
    return x - p - law.at(reduced);
  }
  if (kind == sum) {
    for (size_t k = 1; k < joints.size(); ++k) p += c[k] * angle(q, joints[k]);
    return x - c[0] - p;
  }
  if (joints.size() < 2) {
    for (double k : c) p += k;
    return x - p;
  }
  horner(c, angle(q, joints[1]), p, *first, second);
  return x - p;
}

double Row::coordinate_entries(const double* q, double* out) const {
  std::fill_n(out, columns.size(), 0.0);
  if (python) {
    Vector values(1 + python->iv.size());
    python->value(q, values);
    for (size_t k = 1; k < values.size(); ++k) out[entries[k - 1]] = values[k];
    return values[0];
  }
  double first;
  const double g = coordinate_value(q, &first);
  out[entries[0]] = 1;
  for (size_t k = 1; k < joints.size(); ++k)
    if (kind == sum || k == 1) out[entries[k]] = kind == sum ? -c[k] : -first;
  return g;
}

double Row::coordinate_bias(const double* q, const double* v) const {
  if (python) return python->bias(q, v);
  const size_t k = kind == ratio ? 2 : 1;
  return kind == sum || joints.size() <= k ? 0 : -bias_coefficient(q) * v[joints[1].iv] * v[joints[k].iv];
}

double Row::reduced_coordinate(const double* q, double* increase) const {
  const double x = angle(q, joints[1]), periods = fold[1] > 0 ? std::floor((x - fold[0]) / fold[1]) : 0;
  *increase = periods * fold[2];
  return x - periods * fold[1];
}

double Row::bias_coefficient(const double* q) const {
  if (kind == curved) {
    double increase;
    return law.at(reduced_coordinate(q, &increase), 2);
  }
  double p, first, second;
  const int k = kind == ratio ? 2 : 1;
  horner(c, angle(q, joints[k]), p, first, second);
  return kind == ratio ? first : second;
}

void Row::coordinate_partials(const double* q, const double* v, double lam, double* K, double* B, size_t width) const {
  if (python) {
    const std::vector<int>& iv = python->iv;
    const size_t n = iv.size();
    Vector D(n * n);
    python->partials(q, D);
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j < n; ++j) {
        if (K) K[iv[i] * width + iv[j]] += lam * D[i * n + j];
        if (B) B[iv[j]] += v[iv[i]] * D[i * n + j];
      }
    return;
  }
  const size_t last = kind == ratio ? 2 : 1;
  if (kind == sum || joints.size() <= last) return;
  const int j = joints[1].iv, k = joints[last].iv;
  const double coefficient = bias_coefficient(q);
  if (K) K[j * width + k] -= lam * coefficient;
  if (B) B[k] -= coefficient * v[j];
}

}  // namespace mbdae
