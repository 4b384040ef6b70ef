#include "mechanism/planar_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

struct Vector2 {  // along the first and the second direction of the basis of the plane
  double x = 0, y = 0;
};

// Featherstone's planar vectors: linear and angular velocity or acceleration of a motion; force and moment.
struct PlanarVector {
  double x = 0, y = 0, angular = 0;
};

inline double dot(const PlanarVector& a, const PlanarVector& b) {
  return a.x * b.x + a.y * b.y + a.angular * b.angular;
}

inline void add(PlanarVector& to, const PlanarVector& column, double factor) {
  to.x += factor * column.x, to.y += factor * column.y, to.angular += factor * column.angular;
}

class PlanarSweep final : public Sweep {
 public:
  PlanarSweep(std::vector<TreeJoint> joints, const InertiaPattern& pattern, const double* gravity, const double* armature,
              double tolerance)
      : model_(std::move(joints)),
        pattern_(pattern),
        gravity_(gravity),
        armature_(armature),
        tolerance_(tolerance),
        joints_(model_.size()),
        bodies_(model_.size()),
        columns_(pattern.starts.size() - 1),
        zero_(model_.size(), {1, 0, 0, 0, 1, 0, 0, 0, 1}) {
    for (size_t i = 0; i < model_.size(); ++i)
      if (model_[i].joint >= 0) carrier_.push_back(static_cast<int>(i));
  }

  bool refresh() override;
  bool planar() const override { return true; }
  void poses(const double* q, double* poses, double* J) override {
    outward<false, false, false>(q, nullptr, nullptr, poses, J);
  }
  void inertia(const double* q, double* poses, double* J, double* M) override {
    outward<false, true, false>(q, nullptr, nullptr, poses, J), inward<true, false>(M, nullptr);
  }
  void dynamics(const double* q, const double* v, double* poses, double* J, double* M, double* nle) override {
    set_base_acceleration(-1), outward<true, true, true>(q, v, nullptr, poses, J), inward<true, true>(M, nle);
  }
  void inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) override {
    set_base_acceleration(-1), outward<true, false, true>(q, v, a, poses, J), inward<false, true>(nullptr, out);
    for (size_t k = 0; a && k < columns_.size(); ++k) out[k] += armature_[k] * a[k];
  }
  void motions(const double* q, const double* v, const double* a, double* poses, double* J) override {
    set_base_acceleration(0), outward<true, false, false>(q, v, a, poses, J);
  }
  void velocity(int joint, double* out) const override {
    const Body& x = bodies_[carrier_[joint]];
    shift(joint, x.V, 0, out);
  }
  void acceleration(int joint, double* out) const override {
    const Body& x = bodies_[carrier_[joint]];
    shift(joint, x.A, normal_acceleration_, out);
  }

 private:
  struct Joint {  // and its child body, where all angles are zero
    double sense = 0;                           // of the rotation about the normal
    Vector2 offset, slides[2], lever;           // from the parent's position; of translations; of the centre of mass
    double mass = 0, inertia = 0;               // about the centre
    double fixed[9] = {}, cosine[9] = {}, sine[9] = {};  // R = fixed + cos cosine + sin sine, by columns
    double normal_offset[3] = {};               // of the position, along the normal
  };
  struct Body {
    double c = 1, s = 0;       // of its angle
    Vector2 arm, position, from;  // from the root's position; in the world; in the world when V and A were evaluated
    PlanarVector V, A, f;         // about the root's position, as all below: motion; wrench of the subtree
    double mass = 0, inertia = 0;  // of the subtree
    Vector2 moment;
  };

  static Vector2 rotated(const Body& body, const Vector2& x) {
    return {body.c * x.x - body.s * x.y, body.s * x.x + body.c * x.y};
  }
  // Apart from the sweep, so that the compiler knows that no array overlaps.
  static void rotation(const double* fixed, const double* cosine, const double* sine, double c, double s,
                   double* __restrict R) {
    for (int i = 0; i < 9; ++i) R[i] = fixed[i] + c * cosine[i] + s * sine[i];
  }
  Vector2 in_plane(const double* x) const { return {mbdae::dot(first_, x), mbdae::dot(second_, x)}; }
  void to_world(double x, double y, double* out) const {
    for (int i = 0; i < 3; ++i) out[i] = x * first_[i] + y * second_[i];
  }
  void set_base_acceleration(double factor) {  // against gravity, whose forces are then those of inertia
    bodies_[0].A = {factor * planar_gravity_.x, factor * planar_gravity_.y, 0};
    normal_acceleration_ = factor * normal_gravity_;
  }
  void shift(int joint, const PlanarVector& x, double normal, double* out) const {  // to the world's origin
    const Vector2& from = bodies_[model_[carrier_[joint]].root].from;
    to_world(x.x + from.y * x.angular, x.y - from.x * x.angular, out);
    for (int i = 0; i < 3; ++i) out[i] += normal * normal_[i], out[3 + i] = x.angular * normal_[i];
  }
  void set_basis(const double* axis);
  bool read_joint(size_t j, const double* R0, const double* parent_R0);
  template <bool with_motion, bool with_inertia, bool with_wrench>
  void outward(const double* q, const double* v, const double* a, double* poses, double* J);
  template <bool with_inertia, bool with_wrench>
  void inward(double* M, double* nle);
  void update_pose(const TreeJoint& m, const Joint& x, const double* q, const Body& before, Body& here);
  void update_columns(const TreeJoint& m, const Joint& x, const Body& here, bool rooted, double* J);
  template <bool with_inertia, bool with_wrench>
  void add_body(const Joint& x, Body& here);

  const std::vector<TreeJoint> model_;
  const InertiaPattern& pattern_;
  const double *gravity_, *armature_;
  const double tolerance_;
  double first_[3] = {}, second_[3] = {}, normal_[3] = {};  // the basis of the plane, and first x second
  Vector2 planar_gravity_;
  double normal_gravity_ = 0, normal_acceleration_ = 0;
  std::vector<int> carrier_;  // of each joint of the model: its index
  std::vector<Joint> joints_;
  std::vector<Body> bodies_;
  std::vector<PlanarVector> columns_;  // (nv,) of J, about the root's position
  std::vector<std::array<double, 9>> zero_;  // rotations where all angles are zero, by columns
};

void PlanarSweep::set_basis(const double* axis) {
  const double length = norm(axis, 3);
  int least = 0;
  for (int i = 0; i < 3; ++i) {
    normal_[i] = axis[i] / length;
    if (std::fabs(axis[i]) < std::fabs(axis[least])) least = i;
  }
  double unit[3] = {};
  unit[least] = 1;
  cross(normal_, unit, first_);
  const double sine = norm(first_, 3);
  for (double& x : first_) x /= sine;
  cross(normal_, first_, second_);
}

bool PlanarSweep::refresh() {
  bool has_basis = false;
  for (size_t j = 1; j < model_.size(); ++j) {
    const TreeJoint& m = model_[j];
    const double* before = zero_[m.parent].data();
    for (int k = 0; k < 3; ++k) rotate_by_columns(before, m.R + 3 * k, &zero_[j][3 * k]);
    if (has_basis || m.rotation == TreeJoint::none) continue;
    double axis[3];
    rotate_by_columns(zero_[j].data(), m.axis, axis);
    set_basis(axis), has_basis = true;
  }
  if (!has_basis) return false;
  planar_gravity_ = in_plane(gravity_), normal_gravity_ = mbdae::dot(normal_, gravity_);
  for (size_t j = 1; j < model_.size(); ++j)
    if (!read_joint(j, zero_[j].data(), zero_[model_[j].parent].data())) return false;
  return true;
}

bool PlanarSweep::read_joint(size_t j, const double* R0, const double* parent_R0) {
  const TreeJoint& m = model_[j];
  Joint& x = joints_[j];
  double a[3];
  if (m.pitch != 0 || m.translations == 3 || m.rotation == TreeJoint::quaternion) return false;
  if (m.rotation != TreeJoint::none) {
    double off[3];
    rotate_by_columns(R0, m.axis, a), cross(a, normal_, off);
    if (largest(off, 3) > tolerance_) return false;
    x.sense = mbdae::dot(a, normal_) > 0 ? 1 : -1;
  }
  for (int k = 0; k < m.translations; ++k) {
    if (m.translations == 1)
      rotate_by_columns(R0, m.axis, a);
    else
      std::copy_n(R0 + 3 * k, 3, a);
    if (std::fabs(mbdae::dot(a, normal_)) > tolerance_) return false;
    x.slides[k] = in_plane(a);
  }
  rotate_by_columns(parent_R0, m.p, a), x.offset = in_plane(a);
  const double along = mbdae::dot(a, normal_);
  for (int i = 0; i < 3; ++i) x.normal_offset[i] = joints_[m.parent].normal_offset[i] + along * normal_[i];
  for (int k = 0; k < 3; ++k) {
    const double part = mbdae::dot(normal_, R0 + 3 * k);
    cross(normal_, R0 + 3 * k, x.sine + 3 * k);
    for (int i = 0; i < 3; ++i)
      x.fixed[3 * k + i] = part * normal_[i], x.cosine[3 * k + i] = R0[3 * k + i] - x.fixed[3 * k + i];
  }
  if (m.joint < 0) return true;
  double own[3], I_own[3];  // the normal in the body
  for (int k = 0; k < 3; ++k) own[k] = mbdae::dot(normal_, R0 + 3 * k);
  rotate_by_columns(R0, m.lever, a), x.lever = in_plane(a);
  symmetric(m.I, own, I_own), x.mass = *m.mass, x.inertia = mbdae::dot(own, I_own);
  return true;
}

inline void PlanarSweep::update_pose(const TreeJoint& m, const Joint& x, const double* q, const Body& before,
                                     Body& here) {
  const double* at = q + m.q;
  Vector2 step = rotated(before, x.offset);
  for (int k = 0; k < m.translations; ++k) {
    const Vector2 slide = rotated(before, x.slides[k]);
    step.x += *at * slide.x, step.y += *at++ * slide.y;
  }
  here.position = {before.position.x + step.x, before.position.y + step.y};
  here.arm = m.parent ? Vector2{before.arm.x + step.x, before.arm.y + step.y} : Vector2{};
  here.c = before.c, here.s = before.s;
  if (m.rotation == TreeJoint::none) return;
  const bool angle = m.rotation == TreeJoint::angle;
  const double c = angle ? std::cos(at[0]) : at[0], s = x.sense * (angle ? std::sin(at[0]) : at[1]);
  here.c = before.c * c - before.s * s, here.s = before.s * c + before.c * s;
}

// Columns of translation come first, then that of rotation; `columns_` if `rooted`.
inline void PlanarSweep::update_columns(const TreeJoint& m, const Joint& x, const Body& here, bool rooted, double* J) {
  int k = m.v;
  for (int i = 0; i < m.translations; ++i, ++k) {
    const Vector2 slide = rotated(here, x.slides[i]);
    if (rooted) columns_[k] = {slide.x, slide.y, 0};
    to_world(slide.x, slide.y, J + 6 * k), std::fill_n(J + 6 * k + 3, 3, 0.0);
  }
  if (m.rotation == TreeJoint::none) return;
  if (rooted) columns_[k] = {x.sense * here.arm.y, -x.sense * here.arm.x, x.sense};
  to_world(x.sense * here.position.y, -x.sense * here.position.x, J + 6 * k);
  for (int i = 0; i < 3; ++i) J[6 * k + 3 + i] = x.sense * normal_[i];
}

template <bool with_inertia, bool with_wrench>
inline void PlanarSweep::add_body(const Joint& x, Body& here) {
  const Vector2 lever = rotated(here, x.lever), c{here.arm.x + lever.x, here.arm.y + lever.y};
  if (with_wrench) {  // mass times the acceleration of the centre, and Euler's equation
    const PlanarVector &V = here.V, &A = here.A;
    const Vector2 u{V.x - V.angular * c.y, V.y + V.angular * c.x};
    here.f.x = x.mass * (A.x - A.angular * c.y - V.angular * u.y);
    here.f.y = x.mass * (A.y + A.angular * c.x + V.angular * u.x);
    here.f.angular = x.inertia * A.angular + c.x * here.f.y - c.y * here.f.x;
  }
  if (with_inertia) {
    here.mass = x.mass, here.moment = {x.mass * c.x, x.mass * c.y};
    here.inertia = x.inertia + here.moment.x * c.x + here.moment.y * c.y;
  }
}

template <bool with_motion, bool with_inertia, bool with_wrench>
void PlanarSweep::outward(const double* q, const double* v, const double* a, double* poses, double* J) {
  for (size_t j = 1; j < joints_.size(); ++j) {
    const TreeJoint& m = model_[j];
    const Joint& x = joints_[j];
    const Body& before = bodies_[m.parent];
    Body& here = bodies_[j];
    update_pose(m, x, q, before, here), update_columns(m, x, here, with_motion || with_inertia || with_wrench, J);
    if (m.joint >= 0) {
      double* pose = poses + 12 * m.joint;
      rotation(x.fixed, x.cosine, x.sine, here.c, here.s, pose);
      to_world(here.position.x, here.position.y, pose + 9);
      for (int i = 0; i < 3; ++i) pose[9 + i] += x.normal_offset[i];
    }
    if (with_motion) {
      PlanarVector own, A = before.A;
      for (int k = m.v; k < m.v + m.nv; ++k) add(own, columns_[k], v[k]);
      const PlanarVector& V = before.V;
      A.x += V.y * own.angular - V.angular * own.y, A.y += V.angular * own.x - V.x * own.angular;
      for (int k = m.v; a && k < m.v + m.nv; ++k) add(A, columns_[k], a[k]);
      here.V = {V.x + own.x, V.y + own.y, V.angular + own.angular}, here.A = A, here.from = here.position;
    }
    if (with_inertia || with_wrench) add_body<with_inertia, with_wrench>(x, here);
  }
}

template <bool with_inertia, bool with_wrench>
void PlanarSweep::inward(double* M, double* nle) {
  for (size_t j = joints_.size(); --j > 0;) {
    const TreeJoint& m = model_[j];
    const Body& own = bodies_[j];
    for (int k = m.v; k < m.v + m.nv; ++k) {
      const PlanarVector& J = columns_[k];
      if (with_wrench) nle[k] = dot(own.f, J);
      if (!with_inertia) continue;
      const PlanarVector F{own.mass * J.x - J.angular * own.moment.y, own.mass * J.y + J.angular * own.moment.x,
                           own.inertia * J.angular + own.moment.x * J.y - own.moment.y * J.x};
      for (size_t i = pattern_.starts[k]; i < pattern_.starts[k + 1]; ++i) M[i] = dot(F, columns_[pattern_.rows[i]]);
      M[pattern_.starts[k]] += armature_[k];
    }
    if (!m.parent) continue;
    Body& to = bodies_[m.parent];
    if (with_wrench) add(to.f, own.f, 1);
    if (!with_inertia) continue;
    to.mass += own.mass, to.inertia += own.inertia, to.moment.x += own.moment.x, to.moment.y += own.moment.y;
  }
}

}  // namespace

std::unique_ptr<Sweep> planar_sweep(const std::vector<TreeJoint>& joints, const InertiaPattern& pattern,
                                    const double* gravity, const double* armature, double tolerance) {
  auto out = std::make_unique<PlanarSweep>(joints, pattern, gravity, armature, tolerance);
  return out->refresh() ? std::move(out) : nullptr;
}

}  // namespace mbdae
