// Flexible bodies: node poses and motions, terms of M and nle, partials of inertial forces.
#include "mechanism/flexible_body.hpp"

#include <algorithm>
#include <cmath>

namespace mbdae {

namespace {

constexpr int TERMS = 20;  // number of terms of each series: exact to rounding up to 5 rad

struct Series {  // (-1)^m/(2m + 2)!, (-1)^m/(2m + 3)!
  double a[TERMS], b[TERMS];
};

constexpr Series coefficients() {
  Series out{};
  double u = 0.5;
  for (int m = 0; m < TERMS; ++m) out.a[m] = u, out.b[m] = u / (2 * m + 3), u = -out.b[m] / (2 * m + 4);
  return out;
}

constexpr Series SERIES = coefficients();

void rotate_transposed(const double* R, const double* x, double* out) {  // R^T x
  for (int i = 0; i < 3; ++i) out[i] = dot(R + 3 * i, x);
}

void set_rotation(FlexibleBody::Node& n) {
  const double x2 = dot(n.theta, n.theta);
  double *f = n.functions, power = 1, previous_power = 0;  // x2^m, x2^(m - 1)
  std::fill(f, f + 4, 0.0);
  for (int m = 0; m < TERMS; ++m) {
    const double u = SERIES.a[m], w = SERIES.b[m], a = f[0] + u * power, a1 = f[2] + 2 * m * u * previous_power;
    const bool converged = m > 1 && a == f[0] && a1 == f[2];
    if (converged) break;
    f[0] = a, f[1] += w * power, f[2] = a1, f[3] += 2 * m * w * previous_power;
    previous_power = power, power *= x2;
  }
  double X[9], XX[9];
  skew(n.theta, X), skew_product(n.theta, n.theta, XX);
  for (int i = 0; i < 9; ++i) {
    const double identity = i % 4 == 0;
    n.E[i] = identity + (1 - f[1] * x2) * X[i] + f[0] * XX[i], n.Jr[i] = identity - f[0] * X[i] + f[1] * XX[i];
  }
}

}  // namespace

void FramePose::from_motion(const double* V, double* out) const {
  double linear[3] = {V[0], V[1], V[2]};
  add_cross(V + 3, arm, linear);
  rotate_transposed(pose, linear, out), rotate_transposed(pose, V + 3, out + 3);
}

void FramePose::to_motion(const double* V, double* out) const {
  rotate_by_columns(pose, V, out), rotate_by_columns(pose, V + 3, out + 3);
  add_cross(arm, out + 3, out);
}

void FramePose::to_wrench(const double* F, double* out) const {
  rotate_by_columns(pose, F, out), rotate_by_columns(pose, F + 3, out + 3);
  add_cross(arm, out, out + 3);
}

void rotation_jacobian_rate(const FlexibleBody::Node& n, const double* z, const double* x, double* out) {
  const double* f = n.functions;
  double c[3], cc[3], zx[3], cx[3], tzx[3];
  cross(n.theta, z, c), cross(n.theta, c, cc), cross(z, x, zx), cross(c, x, cx), cross(n.theta, zx, tzx);
  const double along = dot(n.theta, x);
  for (int i = 0; i < 3; ++i) out[i] = (f[3] * cc[i] - f[2] * c[i]) * along + f[0] * zx[i] - f[1] * (cx[i] + tzx[i]);
}

FlexibleBody::FlexibleBody(ModalBody data_, std::vector<int> base_, int first_pose_, int first_column_)
    : data(std::move(data_)),
      base(std::move(base_)),
      first_pose(first_pose_),
      first_column(first_column_),
      nodes_(data.nodes.size()),
      deformation_(data),
      nu_(6 + data.modes),
      F_(6 + data.modes),
      columns_(base.size()) {
  deformation_q_.assign(data.modes, NAN), nodes_q_ = deformation_q_;
  use(std::vector<bool>(nodes_.size(), true));
  for (size_t i = 0; i < nodes_.size(); ++i)
    nodes_[i].Phi = data.nodes[i].Phi, nodes_[i].curved = !is_zero(data.nodes[i].Phi2);
}

void FlexibleBody::use(const std::vector<bool>& nodes) {
  used_.clear(), nodes_q_.assign(data.modes, NAN);
  for (size_t i = 0; i < nodes.size(); ++i)
    if (nodes[i]) used_.push_back(static_cast<int>(i));
}

void FlexibleBody::set_pose(const double* joint_pose, const double* arm) {
  for (int c = 0; c < 12; c += 3) rotate_by_columns(joint_pose, data.placement + c, frame_.pose + c);
  for (int l = 0; l < 3; ++l) frame_.arm[l] = arm[l] + frame_.pose[9 + l], frame_.pose[9 + l] += joint_pose[9 + l];
}

void FlexibleBody::deform(const double* q) {
  const double* x = q + data.iq;
  if (std::equal(x, x + data.modes, deformation_q_.begin())) return;
  std::copy(x, x + data.modes, deformation_q_.begin()), deformation_.update(data, x);
}

void FlexibleBody::update_nodes(const double* q) {
  const double* x = q + data.iq;
  if (std::equal(x, x + data.modes, nodes_q_.begin())) return;
  std::copy(x, x + data.modes, nodes_q_.begin());
  const int k = data.modes;
  for (int index : used_) {
    Node& n = nodes_[index];
    const ModalNode& mode_shapes = data.nodes[index];
    if (n.curved) n.Phi = mode_shapes.Phi, add_combination(mode_shapes.Phi2, x, k, 3 * k, n.Phi.data());
    std::copy(mode_shapes.r, mode_shapes.r + 3, n.d), std::fill(n.theta, n.theta + 3, 0.0);
    add_polynomial(mode_shapes.Phi, n.Phi, x, k, 3, n.d), add_combination(mode_shapes.Psi, x, k, 3, n.theta);
    set_rotation(n);
  }
}

void FlexibleBody::write_node_poses(double* poses, double* J) const {
  const int k = data.modes;
  const double* R = frame_.pose;
  for (int i : used_) {
    const Node& n = nodes_[i];
    double *pose = poses + 12 * (first_pose + i), *column = J + 6 * (first_column + i * k);
    rotate_by_columns(R, n.d, pose + 9);
    for (int l = 0; l < 3; ++l) pose[9 + l] += R[9 + l];
    for (int c = 0; c < 3; ++c) {
      const double e[3] = {n.E[c], n.E[3 + c], n.E[6 + c]};
      rotate_by_columns(R, e, pose + 3 * c);
    }
    for (int m = 0; m < k; ++m, column += 6) {
      double axis[3];
      rotate(n.Jr, &data.nodes[i].Psi[3 * m], axis);
      rotate_by_columns(pose, axis, column + 3), rotate_by_columns(R, &n.Phi[3 * m], column);
      add_cross(pose + 9, column + 3, column);
    }
  }
}

void FlexibleBody::node_motion(int index, const double* V, const double* A, const double* u, const double* du,
                               double* V_node, double* A_node) const {
  const Node& n = nodes_[index];
  const ModalNode& x = data.nodes[index];
  const int k = data.modes;
  // The velocity of the node relative to the frame and its rate, in the axes of the frame and about its origin.
  double relative[6] = {}, rate[6] = {}, d[3] = {}, s[3] = {}, ds[3] = {}, w[3], dw[3], dJr_s[3];
  add_combination(n.Phi, u, k, 3, d), add_combination(x.Psi, u, k, 3, s);
  if (du) add_combination(n.Phi, du, k, 3, rate), add_combination(x.Psi, du, k, 3, ds);
  if (n.curved) add_quadratic(x.Phi2, u, k, 3, rate);
  rotate(n.Jr, s, w), rotate(n.Jr, ds, dw), rotation_jacobian_rate(n, s, s, dJr_s);
  for (int l = 0; l < 3; ++l) relative[l] = d[l], dw[l] += dJr_s[l];
  rotate(n.E, w, relative + 3), rotate(n.E, dw, rate + 3);
  add_cross(n.d, relative + 3, relative), add_cross(d, relative + 3, rate), add_cross(n.d, rate + 3, rate);
  double W[6], dW[6];
  frame_.to_motion(relative, W), frame_.to_motion(rate, dW);
  motion_cross(V, W, A_node);
  for (int l = 0; l < 6; ++l) V_node[l] = V[l] + W[l], A_node[l] += A[l] + dW[l];
}

void FlexibleBody::add_inertia(const Six* J_root, const std::vector<size_t>& starts, double* M) const {
  const int k = data.modes;
  const Vec3<double>& S = deformation_.moment;
  std::vector<Six>& local = columns_;
  for (size_t c = 0; c < base.size(); ++c) {
    Six& x = local[c];
    frame_.from_motion(J_root[base[c]].data(), x.data());
    const Vec3<double> v(x.data()), w(x.data() + 3), f = cross(w, S), m = cross(S, v) + symmetric(deformation_.I, w);
    double* entry = M + starts[base[c]];
    for (size_t d = c + 1; d-- > 0; ++entry) *entry += dot(f.x, local[d].data()) + dot(m.x, local[d].data() + 3);
  }
  for (int i = 0; i < k; ++i) {
    const size_t mode = data.iv + i, coupled = starts[mode + 1] - starts[mode] - base.size();  // modes, with itself
    double* entry = M + starts[mode];
    for (size_t j = 0; j < coupled; ++j) *entry++ = deformation_.Mq[i * k + i - j];
    for (size_t c = base.size(); c-- > 0;)
      *entry++ = dot(&deformation_.C[3 * i], local[c].data()) + dot(&deformation_.H[3 * i], local[c].data() + 3);
  }
}

void FlexibleBody::add_force(const Six* J_root, const double* V, const double* A, const double* u, const double* du,
                             double* out) const {
  double local[6], F[6];
  frame_.from_motion(V, nu_.data()), frame_.from_motion(A, local), std::copy(u, u + data.modes, nu_.begin() + 6);
  inertial_force(data, deformation_, nu_.data(), local, du, F_.data());
  frame_.to_wrench(F_.data(), F);
  for (int c : base) out[c] += dot6(F, J_root[c].data());
  for (int i = 0; i < data.modes; ++i) out[data.iv + i] += F_[6 + i];
}

void FlexibleBody::rotate_to_world(const double* joint_rotation, const double* x, double* out) const {
  double local[3];
  rotate_by_columns(data.placement, x, local), rotate_by_columns(joint_rotation, local, out);
}

double FlexibleBody::potential(const double* joint_rotation, const double* gravity) const {
  double world[3];
  rotate_to_world(joint_rotation, deformation_.moment.x, world);
  return -dot(gravity, world);
}

void FlexibleBody::add_partials(const Six* J_root, const int* expanded_joints, const double* q, const double* v,
                                const double* a, const Six& base_acceleration, double* dtau_dq, double* dtau_dv,
                                size_t nv) const {
  using D = Dual<1>;
  struct Column {
    Six psi_dot, psi_ddot, rate;  // as in rnea_partials.hpp; rate: V_parent x J plus that of J
  };
  const int k = data.modes, n = static_cast<int>(base.size());
  std::vector<Column> columns(n);
  Six V{}, A = base_acceleration;
  for (int first = 0, end; first < n; first = end) {
    const Six Vp = V, Ap = A;
    for (end = first; end < n && expanded_joints[base[end]] == expanded_joints[base[first]]; ++end) {
      const double* J = J_root[base[end]].data();
      Column& c = columns[end];
      double coriolis[6];
      motion_cross(Vp.data(), J, c.psi_dot.data()), motion_cross(Ap.data(), J, c.psi_ddot.data());
      motion_cross(Vp.data(), c.psi_dot.data(), coriolis);
      for (int i = 0; i < 6; ++i) c.psi_ddot[i] += coriolis[i], V[i] += J[i] * v[base[end]];
    }
    for (int i = first; i < end; ++i) {
      const double* J = J_root[base[i]].data();
      double product[6];
      motion_cross(V.data(), J, product);
      for (int l = 0; l < 6; ++l) {
        columns[i].rate[l] = columns[i].psi_dot[l] + product[l];
        A[l] += product[l] * v[base[i]] + J[l] * a[base[i]];
      }
    }
  }
  std::vector<D> x(k), nu(6 + k), acceleration(6 + k), F(6 + k);
  Deformation<D> deformation(data);
  double local[6];
  const auto set_value = [&](const double* motion, const double* modal, std::vector<D>& out) {
    frame_.from_motion(motion, local);
    for (int i = 0; i < 6; ++i) out[i] = local[i];
    for (int i = 0; i < k; ++i) out[6 + i] = modal[data.iv + i];
  };
  const auto set_direction = [&](const double* motion, std::vector<D>& out) {
    frame_.from_motion(motion, local);
    for (int i = 0; i < 6; ++i) out[i].d[0] = local[i];
  };
  for (int i = 0; i < k; ++i) x[i] = q[data.iq + i];
  set_value(V.data(), v, nu), set_value(A.data(), a, acceleration);
  deformation.update(data, x.data());
  inertial_force(data, deformation, nu.data(), acceleration.data(), acceleration.data() + 6, F.data());
  double wrench[6];
  for (int i = 0; i < 6; ++i) local[i] = F[i].x;
  frame_.to_wrench(local, wrench);
  const auto add = [&](int m, double* out) {  // the directional derivative of F, to column m
    inertial_force(data, deformation, nu.data(), acceleration.data(), acceleration.data() + 6, F.data());
    double dF[6], local_dF[6];
    for (int i = 0; i < 6; ++i) local_dF[i] = F[i].d[0];
    frame_.to_wrench(local_dF, dF);
    for (int c : base) out[c * nv + m] += dot6(J_root[c].data(), dF);
    for (int i = 0; i < k; ++i) out[(data.iv + i) * nv + m] += F[6 + i].d[0];
  };
  for (int m = 0; m < n; ++m) {
    Column& c = columns[m];
    double product[6];
    motion_cross(c.psi_dot.data(), V.data(), product);
    for (int i = 0; i < 6; ++i) c.psi_ddot[i] += product[i];
    motion_cross(J_root[base[m]].data(), V.data(), product);
    for (int i = 0; i < 6; ++i) c.rate[i] += product[i];
    set_direction(c.psi_dot.data(), nu), set_direction(c.psi_ddot.data(), acceleration), add(base[m], dtau_dq);
    double JxF[6];
    wrench_cross(J_root[base[m]].data(), wrench, JxF);
    for (int k = 0; k < m; ++k)
      if (expanded_joints[base[k]] != expanded_joints[base[m]])
        dtau_dq[base[k] * nv + base[m]] += dot6(J_root[base[k]].data(), JxF);
    set_direction(J_root[base[m]].data(), nu), set_direction(c.rate.data(), acceleration), add(base[m], dtau_dv);
  }
  for (auto* y : {&nu, &acceleration})
    for (D& z : *y) z.d[0] = 0;
  for (int m = 0; m < k; ++m) {
    nu[6 + m].d[0] = 1, add(data.iv + m, dtau_dv), nu[6 + m].d[0] = 0;
    x[m].d[0] = 1, deformation.update(data, x.data()), add(data.iv + m, dtau_dq), x[m].d[0] = 0,
    deformation.update(data, x.data());
  }
}

}  // namespace mbdae
