// Kinematics and dynamics of a tree of bodies, by a sweep or by other algorithms.
#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "mechanism/multibody_tree_workspace.hpp"
#include "mechanism/tree_coordinates.hpp"

namespace mbdae {

namespace {

std::vector<FlexibleBody> bind_bodies(std::vector<ModalBody> bodies, const TreeModel& m) {
  std::vector<FlexibleBody> out;
  int pose = static_cast<int>(m.joints.size()), column = m.nv;
  for (ModalBody& x : bodies) {
    std::vector<int> base, branch;
    for (int j = x.joint; j; j = m.joints[j].parent) branch.push_back(j);
    for (auto j = branch.rbegin(); j != branch.rend(); ++j)
      for (int i = 0; i < m.joints[*j].nv; ++i) base.push_back(m.joints[*j].iv + i);
    const int nodes = static_cast<int>(x.nodes.size()), modes = x.modes;
    out.emplace_back(std::move(x), std::move(base), pose, column);
    pose += nodes, column += nodes * modes;
  }
  return out;
}

}  // namespace

MultibodyTree::MultibodyTree(const void* model, const Tolerances& tolerances_, std::vector<ModalBody> flexible)
    : tolerances(tolerances_) {
  TreeModel m = tree_model(model);
  auto bodies = bind_bodies(std::move(flexible), m);
  w.reset(new Workspace(model, std::move(m), std::move(bodies)));
  nq = w->model.nq, nv = w->model.nv;
  joints = static_cast<int>(w->model.joints.size()), frames = static_cast<int>(w->poses.size() / 12);
  ancestors.resize(nv), tangent.assign(nq, 0);
  const auto supported = supports();
  for (int j = 0; j < joints; ++j) {
    const TreeModel::Joint& x = w->model.joints[j];
    parents.push_back(x.parent);
    if (j) tangent[x.iq] = x.iv;
    for (int i = 0; i < x.nv; ++i) {
      const auto& velocities = supported[j].velocities;
      const auto end = velocities.end() - x.nv + i;
      ancestors[x.iv + i].assign(std::make_reverse_iterator(end), velocities.rend());
    }
  }
  for (const FlexibleBody& x : w->flexible)  // zeros of M, and of its factors
    for (int i = 0; i < x.data.modes && x.data.orthogonal(); ++i)
      ancestors[x.data.iv + i].assign(x.base.rbegin(), x.base.rend());
  for (int k = 0; k < nv; ++k) {
    pattern.rows.push_back(k), pattern.rows.insert(pattern.rows.end(), ancestors[k].begin(), ancestors[k].end());
    pattern.starts.push_back(pattern.rows.size());
  }
  begin_sweep();
}

void MultibodyTree::begin_sweep() {
  const TreeModel& m = w->model;
  w->M.resize(pattern.rows.size());
  if (!m.tree.empty() && w->flexible.empty())
    w->sweep = planar_sweep(m.tree, pattern, m.gravity, m.armature, tolerances.sum_rounding);
  if (!m.tree.empty() && !w->sweep)
    w->sweep.reset(new TreeSweep(m.tree, pattern, m.gravity, m.armature, &w->flexible));
  if (!w->sweep && w->flexible.empty()) w->fallback = tree_algorithms(w->source);
  if (!w->sweep && !w->fallback) throw std::invalid_argument("flexible bodies need joints with fixed axes");
}

bool MultibodyTree::planar() const { return w->sweep && w->sweep->planar(); }

void MultibodyTree::refresh() {
  if (w->sweep && !w->sweep->refresh()) w->sweep.reset(), begin_sweep();
}

double* MultibodyTree::body_parameter(int joint, int i) {
  if (joint < 1 || joint >= joints || i < 0 || i >= 1 + 3 + 6) return nullptr;
  const TreeModel::Joint& body = w->model.joints[joint];
  return const_cast<double*>(i < 1 ? body.mass : i < 4 ? body.lever + i - 1 : body.I + i - 4);
}

double* MultibodyTree::gravity_parameter(int i) {
  return i < 0 || i >= 3 ? nullptr : const_cast<double*>(w->model.gravity + i);
}

const void* MultibodyTree::source() const { return w->source; }

void MultibodyTree::write(const void* model, const Tolerances& tolerances_, std::vector<ModalBody> flexible) {
  ++motion_stamp_, ++pose_stamp_, tolerances = tolerances_;
  if (model == w->source) return refresh();
  auto partials = std::move(w->partials);
  TreeModel m = tree_model(model);
  auto bodies = bind_bodies(std::move(flexible), m);
  w.reset(new Workspace(model, std::move(m), std::move(bodies))), begin_sweep();
  w->partials = std::move(partials);
}

bool MultibodyTree::has_same_structure(const std::vector<ModalBody>& bodies) const {
  const auto same = [](const ModalBody& a, const FlexibleBody& b) {
    return a.joint == b.data.joint && a.modes == b.data.modes && a.nodes.size() == b.data.nodes.size() &&
           a.orthogonal() == b.data.orthogonal();
  };
  return std::equal(bodies.begin(), bodies.end(), w->flexible.begin(), w->flexible.end(), same);
}

MultibodyTree::~MultibodyTree() = default;

std::vector<MultibodyTree::Support> MultibodyTree::supports() const {
  std::vector<Support> out(frames);
  for (int j = 1; j < joints; ++j) {
    auto& x = out[j].velocities;
    x = out[w->model.joints[j].parent].velocities;
    for (int i = 0; i < w->model.joints[j].nv; ++i) x.push_back(w->model.joints[j].iv + i);
    out[j].columns = x;
  }
  for (const FlexibleBody& body : w->flexible)
    for (int i = 0, column = body.first_column; i < static_cast<int>(body.data.nodes.size()); ++i) {
      Support& x = out[body.first_pose + i] = out[body.data.joint];
      for (int k = 0; k < body.data.modes; ++k)
        x.velocities.push_back(body.data.iv + k), x.columns.push_back(column++);
    }
  return out;
}

void MultibodyTree::use_nodes(const std::vector<int>& used) {
  for (FlexibleBody& body : w->flexible) {
    std::vector<bool> nodes(body.data.nodes.size());
    for (int frame : used)
      if (frame >= body.first_pose && frame < body.first_pose + static_cast<int>(nodes.size())) nodes[frame - body.first_pose] = true;
    body.use(nodes);
  }
}

const FlexibleBody::Node* MultibodyTree::node(int frame, const FlexibleBody*& body, int& i) const {
  if (frame < joints) return nullptr;
  for (const FlexibleBody& x : w->flexible)
    if (i = frame - x.first_pose, i < static_cast<int>(x.data.nodes.size())) return body = &x, &x.node(i);
  return nullptr;
}

void MultibodyTree::inertia(const double* q) {
  ++pose_stamp_;
  w->sweep ? w->sweep->inertia(q, w->poses.data(), w->J.data(), w->M.data())
           : set_M(w->fallback->inertia(q, w->poses.data(), w->J.data()));
}

void MultibodyTree::dynamics(const double* q, const double* v) {
  if (!w->sweep) return inertia(q), bias(q, v);
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->dynamics(q, v, w->poses.data(), w->J.data(), w->M.data(), w->nle.data());
}

void MultibodyTree::poses(const double* q) {
  ++pose_stamp_;
  w->sweep ? w->sweep->poses(q, w->poses.data(), w->J.data()) : w->fallback->poses(q, w->poses.data(), w->J.data());
}

void MultibodyTree::save_poses() { ++pose_stamp_, std::swap(w->poses, w->saved_poses); }
void MultibodyTree::restore_poses() { ++pose_stamp_, w->poses = w->saved_poses; }

void MultibodyTree::motions(const double* q, const double* v) { motions(q, v, nullptr); }

void MultibodyTree::motions(const double* q, const double* v, const double* a) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->motions(q, v, a, w->poses.data(), w->J.data()) : w->fallback->motions(q, v, a, w->poses.data());
}

void MultibodyTree::bias(const double* q, const double* v) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->inverse(q, v, nullptr, w->poses.data(), w->J.data(), w->nle.data())
           : w->fallback->bias(q, v, w->nle.data());
}

void MultibodyTree::inverse(const double* q, const double* v, const double* a, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->inverse(q, v, a, w->poses.data(), w->J.data(), out)
           : w->fallback->inverse(q, v, a, w->poses.data(), w->J.data(), out);
}

void MultibodyTree::add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a,
                           const double* gravity, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->add_forces(bodies, q, v, a, gravity, w->poses.data(), w->J.data(), out);
}

std::vector<FlexibleBody> MultibodyTree::bind(std::vector<ModalBody> bodies) const {
  return bind_bodies(std::move(bodies), w->model);
}

double MultibodyTree::potential() const {
  double out = 0;
  const Vector3 gravity(w->model.gravity);
  for (int j = 1; j < joints; ++j) {
    const TreeModel::Joint& x = w->model.joints[j];
    out -= *x.mass * gravity.dot(w->rotation(j) * Vector3(x.lever) + w->position(j));
  }
  for (const FlexibleBody& x : w->flexible) out += x.potential(rotation(x.data.joint), w->model.gravity);
  return out;
}

const double* MultibodyTree::M() const { return w->M.data(); }

void MultibodyTree::set_M(const double* dense) {
  for (size_t k = 0; k + 1 < pattern.starts.size(); ++k)
    for (size_t i = pattern.starts[k]; i < pattern.starts[k + 1]; ++i) w->M[i] = dense[k * nv + pattern.rows[i]];
}

void MultibodyTree::dense_M(double* out) const {
  const size_t n = nv;
  std::fill_n(out, n * n, 0.0);
  for (size_t k = 0; k < n; ++k)
    for (size_t i = pattern.starts[k]; i < pattern.starts[k + 1]; ++i)
      out[n * k + pattern.rows[i]] = out[n * pattern.rows[i] + k] = w->M[i];
}

double MultibodyTree::kinetic_energy(const double* v) const {
  double sum = 0;
  const double* entry = w->M.data();
  for (int k = 0; k < nv; ++k) {
    double momentum = 0.5 * *entry++ * v[k];
    for (int i : ancestors[k]) momentum += *entry++ * v[i];
    sum += momentum * v[k];
  }
  return sum;
}

void MultibodyTree::add_inertial_force(const double* a, double* out) const {
  const double* entry = w->M.data();
  for (int k = 0; k < nv; ++k) {
    out[k] += *entry++ * a[k];
    for (int i : ancestors[k]) out[k] += *entry * a[i], out[i] += *entry++ * a[k];
  }
}

const double* MultibodyTree::J() const { return w->J.data(); }
const double* MultibodyTree::rotation(int j) const { return &w->poses[12 * j]; }
const double* MultibodyTree::position(int j) const { return &w->poses[12 * j + 9]; }

void MultibodyTree::velocity(int j, double* out) const {
  w->sweep ? w->sweep->velocity(j, out) : w->fallback->velocity(j, w->poses.data(), out);
}

void MultibodyTree::acceleration(int j, double* out) const {
  w->sweep ? w->sweep->acceleration(j, out) : w->fallback->acceleration(j, w->poses.data(), out);
}

void MultibodyTree::bias_minus_gravity(int j, double* out) const {
  w->sweep ? w->sweep->acceleration(j, out) : w->fallback->bias_minus_gravity(j, w->poses.data(), out);
}

void MultibodyTree::gravity(double* out) const { std::copy_n(w->model.gravity, 3, out); }

void MultibodyTree::placement(int j, double* R, double* p) const {
  const TreeModel::Joint& x = w->model.joints[j];
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R, 3, 3) = w->rotation(x.parent) * Matrix3(x.R);
  Eigen::Map<Eigen::Vector3d>(p, 3) = w->rotation(x.parent) * Vector3(x.p) + w->position(x.parent);
}

Body MultibodyTree::body(int j) const {
  const TreeModel::Joint& x = w->model.joints[j];
  const auto R = w->rotation(j);
  Eigen::Matrix3d I;
  I << x.I[0], x.I[1], x.I[3], x.I[1], x.I[2], x.I[4], x.I[3], x.I[4], x.I[5];
  const Eigen::Matrix3d RI = R * I;
  Body out;
  out.mass = *x.mass;
  Eigen::Map<Eigen::Vector3d>(out.centre, 3).noalias() = R * Vector3(x.lever) + w->position(j);
  Eigen::Map<Eigen::Matrix3d>(out.I, 3, 3).noalias() = RI * R.transpose();
  return out;
}

void MultibodyTree::integrate(const double* q, const double* x, double* out) {
  w->sweep ? mbdae::integrate(w->model.tree, q, x, out) : w->fallback->integrate(q, x, out);
}

void MultibodyTree::difference(const double* q0, const double* q1, double* out) {
  w->sweep ? mbdae::difference(w->model.tree, q0, q1, out) : w->fallback->difference(q0, q1, out);
}

void MultibodyTree::normalize(double* q) { w->sweep ? mbdae::normalize(w->model.tree, q) : w->fallback->normalize(q); }

void MultibodyTree::tangent_map(const double* q, const double* v, double* dq) {
  w->sweep ? mbdae::tangent_map(w->model.tree, q, v, dq) : w->fallback->tangent_map(q, v, dq);
}

void MultibodyTree::neutral(double* q) { w->sweep ? mbdae::neutral(w->model.tree, q) : w->fallback->neutral(q); }

}  // namespace mbdae
