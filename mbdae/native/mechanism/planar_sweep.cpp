// The outward and inward pass through a planar mechanism.
#include "mechanism/planar_sweep.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

struct Vector2 {  // components in the basis of the plane
  double x = 0, y = 0;
};

// Featherstone's planar vectors: linear and angular part of a velocity, an acceleration or a wrench.
struct PlanarVector {
  double x = 0, y = 0, angular = 0;
};

inline double dot(const PlanarVector& a, const PlanarVector& b) {
  return a.x * b.x + a.y * b.y + a.angular * b.angular;
}

inline void add(PlanarVector& out, const PlanarVector& column, double factor) {
  out.x += factor * column.x, out.y += factor * column.y, out.angular += factor * column.angular;
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
      if (model_[i].joint >= 0) index_of_joint_.push_back(static_cast<int>(i));
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
    const Body& x = bodies_[index_of_joint_[joint]];
    shift(joint, x.V, 0, out);
  }
  void acceleration(int joint, double* out) const override {
    const Body& x = bodies_[index_of_joint_[joint]];
    shift(joint, x.A, normal_acceleration_, out);
  }

 private:
  struct Joint {                                         // a joint and its child body, at zero angles
    double sign = 0;                                     // sign of the axis of rotation along the normal
    Vector2 offset, translations[2], lever;              // from the parent; directions of translations; centre of mass
    double mass = 0, inertia = 0;                        // mass, and inertia about the centre of mass
    double fixed[9] = {}, cosine[9] = {}, sine[9] = {};  // R = fixed + cos cosine + sin sine, by columns
    double normal_offset[3] = {};                        // position along the normal
  };
  struct Body {
    double c = 1, s = 0;               // cosine and sine of its angle
    Vector2 arm, position, reference;  // from the root; in the world; in the world when V and A were evaluated
    PlanarVector V, A, f;              // velocity, acceleration, wrench of the subtree, about the root's position
    double mass = 0, inertia = 0;      // mass of the subtree, and its inertia about the root's position
    Vector2 moment;                    // first moment of the subtree
  };

  static Vector2 rotated(const Body& body, const Vector2& x) {
    return {body.c * x.x - body.s * x.y, body.s * x.x + body.c * x.y};
  }
  // A function, so that __restrict tells the compiler that no arrays overlap.
  static void rotation(const double* fixed, const double* cosine, const double* sine, double c, double s,
                   double* __restrict R) {
    for (int i = 0; i < 9; ++i) R[i] = fixed[i] + c * cosine[i] + s * sine[i];
  }
  Vector2 in_plane(const double* x) const { return {mbdae::dot(first_, x), mbdae::dot(second_, x)}; }
  void to_world(double x, double y, double* out) const {
    for (int i = 0; i < 3; ++i) out[i] = x * first_[i] + y * second_[i];
  }
  void set_base_acceleration(double factor) {  // -1: gravity acts as an inertial force
    bodies_[0].A = {factor * planar_gravity_.x, factor * planar_gravity_.y, 0};
    normal_acceleration_ = factor * normal_gravity_;
  }
  void shift(int joint, const PlanarVector& x, double normal, double* out) const {  // to the world's origin
    const Vector2& reference = bodies_[model_[index_of_joint_[joint]].root].reference;
    to_world(x.x + reference.y * x.angular, x.y - reference.x * x.angular, out);
    for (int i = 0; i < 3; ++i) out[i] += normal * normal_[i], out[3 + i] = x.angular * normal_[i];
  }
  void set_basis(const double* axis);
  bool read_joint(size_t j, const double* R0, const double* parent_R0);
  template <bool with_motion, bool with_inertia, bool with_wrench>
  void outward(const double* q, const double* v, const double* a, double* poses, double* J);
  template <bool with_inertia, bool with_wrench>
  void inward(double* M, double* nle);
  void update_pose(const TreeJoint& m, const Joint& x, const double* q, const Body& parent, Body& body);
  void update_columns(const TreeJoint& m, const Joint& x, const Body& body, bool rooted, double* J);
  template <bool with_inertia, bool with_wrench>
  void add_body(const Joint& x, Body& body);

  const std::vector<TreeJoint> model_;
  const InertiaPattern& pattern_;
  const double *gravity_, *armature_;
  const double tolerance_;
  double first_[3] = {}, second_[3] = {}, normal_[3] = {};  // the basis of the plane, and first x second
  Vector2 planar_gravity_;
  double normal_gravity_ = 0, normal_acceleration_ = 0;
  std::vector<int> index_of_joint_;  // index in joints_ of each joint of the model
  std::vector<Joint> joints_;
  std::vector<Body> bodies_;
  std::vector<PlanarVector> columns_;  // (nv,) of J, about the root's position
  std::vector<std::array<double, 9>> zero_;  // rotations at zero angles, by columns
};

void PlanarSweep::set_basis(const double* axis) {
  const double length = norm(axis, 3);
  int smallest = 0;
  for (int i = 0; i < 3; ++i) {
    normal_[i] = axis[i] / length;
    if (std::fabs(axis[i]) < std::fabs(axis[smallest])) smallest = i;
  }
  double unit[3] = {};
  unit[smallest] = 1;
  cross(normal_, unit, first_);
  const double sine = norm(first_, 3);
  for (double& x : first_) x /= sine;
  cross(normal_, first_, second_);
}

bool PlanarSweep::refresh() {
  bool has_basis = false;
  for (size_t j = 1; j < model_.size(); ++j) {
    const TreeJoint& m = model_[j];
    const double* parent_R = zero_[m.parent].data();
    for (int k = 0; k < 3; ++k) rotate_by_columns(parent_R, m.R + 3 * k, &zero_[j][3 * k]);
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
    double misalignment[3];
    rotate_by_columns(R0, m.axis, a), cross(a, normal_, misalignment);
    if (largest(misalignment, 3) > tolerance_) return false;
    x.sign = mbdae::dot(a, normal_) > 0 ? 1 : -1;
  }
  for (int k = 0; k < m.translations; ++k) {
    if (m.translations == 1)
      rotate_by_columns(R0, m.axis, a);
    else
      std::copy_n(R0 + 3 * k, 3, a);
    if (std::fabs(mbdae::dot(a, normal_)) > tolerance_) return false;
    x.translations[k] = in_plane(a);
  }
  rotate_by_columns(parent_R0, m.p, a), x.offset = in_plane(a);
  const double height = mbdae::dot(a, normal_);
  for (int i = 0; i < 3; ++i) x.normal_offset[i] = joints_[m.parent].normal_offset[i] + height * normal_[i];
  for (int k = 0; k < 3; ++k) {
    const double normal_part = mbdae::dot(normal_, R0 + 3 * k);
    cross(normal_, R0 + 3 * k, x.sine + 3 * k);
    for (int i = 0; i < 3; ++i)
      x.fixed[3 * k + i] = normal_part * normal_[i], x.cosine[3 * k + i] = R0[3 * k + i] - x.fixed[3 * k + i];
  }
  if (m.joint < 0) return true;
  double normal[3], I_normal[3];  // in the axes of the body
  for (int k = 0; k < 3; ++k) normal[k] = mbdae::dot(normal_, R0 + 3 * k);
  rotate_by_columns(R0, m.lever, a), x.lever = in_plane(a);
  symmetric(m.I, normal, I_normal), x.mass = *m.mass, x.inertia = mbdae::dot(normal, I_normal);
  return true;
}

inline void PlanarSweep::update_pose(const TreeJoint& m, const Joint& x, const double* q, const Body& parent,
                                     Body& body) {
  const double* qj = q + m.q;
  Vector2 step = rotated(parent, x.offset);
  for (int k = 0; k < m.translations; ++k) {
    const Vector2 translation = rotated(parent, x.translations[k]);
    step.x += *qj * translation.x, step.y += *qj++ * translation.y;
  }
  body.position = {parent.position.x + step.x, parent.position.y + step.y};
  body.arm = m.parent ? Vector2{parent.arm.x + step.x, parent.arm.y + step.y} : Vector2{};
  body.c = parent.c, body.s = parent.s;
  if (m.rotation == TreeJoint::none) return;
  const bool angle = m.rotation == TreeJoint::angle;
  const double c = angle ? std::cos(qj[0]) : qj[0], s = x.sign * (angle ? std::sin(qj[0]) : qj[1]);
  body.c = parent.c * c - parent.s * s, body.s = parent.s * c + parent.c * s;
}

// The columns of translations come first, then the column of rotation; sets columns_ if `rooted`.
inline void PlanarSweep::update_columns(const TreeJoint& m, const Joint& x, const Body& body, bool rooted, double* J) {
  int k = m.v;
  for (int i = 0; i < m.translations; ++i, ++k) {
    const Vector2 translation = rotated(body, x.translations[i]);
    if (rooted) columns_[k] = {translation.x, translation.y, 0};
    to_world(translation.x, translation.y, J + 6 * k), std::fill_n(J + 6 * k + 3, 3, 0.0);
  }
  if (m.rotation == TreeJoint::none) return;
  if (rooted) columns_[k] = {x.sign * body.arm.y, -x.sign * body.arm.x, x.sign};
  to_world(x.sign * body.position.y, -x.sign * body.position.x, J + 6 * k);
  for (int i = 0; i < 3; ++i) J[6 * k + 3 + i] = x.sign * normal_[i];
}

template <bool with_inertia, bool with_wrench>
inline void PlanarSweep::add_body(const Joint& x, Body& body) {
  const Vector2 lever = rotated(body, x.lever), c{body.arm.x + lever.x, body.arm.y + lever.y};
  if (with_wrench) {  // mass times the acceleration of the centre, and Euler's equation
    const PlanarVector &V = body.V, &A = body.A;
    const Vector2 u{V.x - V.angular * c.y, V.y + V.angular * c.x};
    body.f.x = x.mass * (A.x - A.angular * c.y - V.angular * u.y);
    body.f.y = x.mass * (A.y + A.angular * c.x + V.angular * u.x);
    body.f.angular = x.inertia * A.angular + c.x * body.f.y - c.y * body.f.x;
  }
  if (with_inertia) {
    body.mass = x.mass, body.moment = {x.mass * c.x, x.mass * c.y};
    body.inertia = x.inertia + body.moment.x * c.x + body.moment.y * c.y;
  }
}

template <bool with_motion, bool with_inertia, bool with_wrench>
void PlanarSweep::outward(const double* q, const double* v, const double* a, double* poses, double* J) {
  for (size_t j = 1; j < joints_.size(); ++j) {
    const TreeJoint& m = model_[j];
    const Joint& x = joints_[j];
    const Body& parent = bodies_[m.parent];
    Body& body = bodies_[j];
    update_pose(m, x, q, parent, body), update_columns(m, x, body, with_motion || with_inertia || with_wrench, J);
    if (m.joint >= 0) {
      double* pose = poses + 12 * m.joint;
      rotation(x.fixed, x.cosine, x.sine, body.c, body.s, pose);
      to_world(body.position.x, body.position.y, pose + 9);
      for (int i = 0; i < 3; ++i) pose[9 + i] += x.normal_offset[i];
    }
    if (with_motion) {
      PlanarVector relative, A = parent.A;
      for (int k = m.v; k < m.v + m.nv; ++k) add(relative, columns_[k], v[k]);
      const PlanarVector& V = parent.V;
      A.x += V.y * relative.angular - V.angular * relative.y, A.y += V.angular * relative.x - V.x * relative.angular;
      for (int k = m.v; a && k < m.v + m.nv; ++k) add(A, columns_[k], a[k]);
      body.V = {V.x + relative.x, V.y + relative.y, V.angular + relative.angular}, body.A = A;
      body.reference = body.position;
    }
    if (with_inertia || with_wrench) add_body<with_inertia, with_wrench>(x, body);
  }
}

template <bool with_inertia, bool with_wrench>
void PlanarSweep::inward(double* M, double* nle) {
  for (size_t j = joints_.size(); --j > 0;) {
    const TreeJoint& m = model_[j];
    const Body& body = bodies_[j];
    for (int k = m.v; k < m.v + m.nv; ++k) {
      const PlanarVector& J = columns_[k];
      if (with_wrench) nle[k] = dot(body.f, J);
      if (!with_inertia) continue;
      const PlanarVector F{body.mass * J.x - J.angular * body.moment.y, body.mass * J.y + J.angular * body.moment.x,
                           body.inertia * J.angular + body.moment.x * J.y - body.moment.y * J.x};
      for (size_t i = pattern_.starts[k]; i < pattern_.starts[k + 1]; ++i) M[i] = dot(F, columns_[pattern_.rows[i]]);
      M[pattern_.starts[k]] += armature_[k];
    }
    if (!m.parent) continue;
    Body& parent = bodies_[m.parent];
    if (with_wrench) add(parent.f, body.f, 1);
    if (!with_inertia) continue;
    parent.mass += body.mass, parent.inertia += body.inertia, parent.moment.x += body.moment.x,
        parent.moment.y += body.moment.y;
  }
}

}  // namespace

std::unique_ptr<Sweep> planar_sweep(const std::vector<TreeJoint>& joints, const InertiaPattern& pattern,
                                    const double* gravity, const double* armature, double tolerance) {
  auto out = std::make_unique<PlanarSweep>(joints, pattern, gravity, armature, tolerance);
  return out->refresh() ? std::move(out) : nullptr;
}

}  // namespace mbdae
