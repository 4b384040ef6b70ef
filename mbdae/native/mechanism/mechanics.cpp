#include "mechanism/mechanics.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "math/eigen_types.hpp"
#include "mechanism/tree_coordinates.hpp"
#include "mechanism/tree_model.hpp"
#include "mechanism/tree_sweep.hpp"

namespace mbdae {

namespace {

using Matrix3 = Eigen::Map<const Eigen::Matrix3d>;
using Vector3 = Eigen::Map<const Eigen::Vector3d>;

std::vector<FlexibleBody> bound(std::vector<ModalBody> bodies, const TreeModel& m) {
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

struct Mechanics::Workspace {
  Workspace(const void* source_, TreeModel m, std::vector<FlexibleBody> flexible_)
      : source(source_), model(std::move(m)), flexible(std::move(flexible_)) {
    size_t frames = model.joints.size(), columns = model.nv;
    for (const FlexibleBody& x : flexible) {
      const size_t nodes = x.data.nodes.size();
      frames += nodes, columns += nodes * x.data.modes;
    }
    for (size_t i = 0; i < frames; ++i)
      for (int k = 0; k < 12; ++k) poses.push_back(k == 0 || k == 4 || k == 8 ? 1 : 0);
    saved_poses = poses, J.assign(6 * columns, 0.0);
    M.assign(static_cast<size_t>(model.nv) * model.nv, 0.0), nle.assign(model.nv, 0.0);
    zero = nle;
  }

  Matrix3 rotation(int j) const { return Matrix3(&poses[12 * j]); }
  Vector3 position(int j) const { return Vector3(&poses[12 * j + 9]); }

  const void* source;
  const TreeModel model;
  std::vector<FlexibleBody> flexible;
  std::unique_ptr<TreeSweep> sweep;
  std::unique_ptr<TreeAlgorithms> other;  // where there is no sweep
  Numbers poses, saved_poses;             // (frames, 12) R by columns, and p
  Numbers J, M, nle, zero;                // (6, nv and nodes), (nv, nv) by columns, (nv,), (nv,)
  struct Begun {  // partials at (q, v): terms known so far
    Numbers q, v, J, about, M, poses;  // J about the world's origin, and about the reference point of the partials
  } begun;
  std::unique_ptr<RneaPartials> partials;
};

Mechanics::Mechanics(const void* model, const Tolerances& limits_, std::vector<ModalBody> flexible)
    : limits(limits_) {
  TreeModel m = tree_model(model);
  auto bodies = bound(std::move(flexible), m);
  w.reset(new Workspace(model, std::move(m), std::move(bodies)));
  nq = w->model.nq, nv = w->model.nv;
  joints = static_cast<int>(w->model.joints.size()), frames = static_cast<int>(w->poses.size() / 12);
  ancestors.resize(nv), tangent.assign(nq, 0);
  const auto above = supports();
  for (int j = 0; j < joints; ++j) {
    const TreeModel::Joint& x = w->model.joints[j];
    parents.push_back(x.parent);
    if (j) tangent[x.iq] = x.iv;
    for (int i = 0; i < x.nv; ++i) {
      const auto& own = above[j].velocities;
      const auto end = own.end() - x.nv + i;
      ancestors[x.iv + i].assign(std::make_reverse_iterator(end), own.rend());
    }
  }
  for (const FlexibleBody& x : w->flexible)  // zeros of M: its factors have no others
    for (int i = 0; i < x.data.modes && x.data.orthogonal(); ++i)
      ancestors[x.data.iv + i].assign(x.base.rbegin(), x.base.rend());
  begin_sweep();
}

void Mechanics::begin_sweep() {
  const TreeModel& m = w->model;
  if (!m.tree.empty())
    w->sweep.reset(new TreeSweep(m.tree, ancestors, m.gravity, m.armature, &w->flexible));
  else if (w->flexible.empty())
    w->other = tree_algorithms(w->source);
  else
    throw std::invalid_argument("flexible bodies need joints with fixed axes");
}

void Mechanics::write(const void* model, const Tolerances& limits_, std::vector<ModalBody> flexible) {
  ++motion_stamp_, ++pose_stamp_, limits = limits_;
  if (model == w->source) return;
  auto partials = std::move(w->partials);
  TreeModel m = tree_model(model);
  auto bodies = bound(std::move(flexible), m);
  w.reset(new Workspace(model, std::move(m), std::move(bodies))), begin_sweep();
  w->partials = std::move(partials);
}

bool Mechanics::has_same_structure(const std::vector<ModalBody>& bodies) const {
  const auto same = [](const ModalBody& a, const FlexibleBody& b) {
    return a.joint == b.data.joint && a.modes == b.data.modes && a.nodes.size() == b.data.nodes.size() &&
           a.orthogonal() == b.data.orthogonal();
  };
  return std::equal(bodies.begin(), bodies.end(), w->flexible.begin(), w->flexible.end(), same);
}

Mechanics::~Mechanics() = default;

std::vector<Mechanics::Support> Mechanics::supports() const {
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

void Mechanics::use_nodes(const std::vector<int>& used) {
  for (FlexibleBody& body : w->flexible) {
    std::vector<bool> nodes(body.data.nodes.size());
    for (int frame : used)
      if (frame >= body.first_pose && frame < body.first_pose + static_cast<int>(nodes.size())) nodes[frame - body.first_pose] = true;
    body.use(nodes);
  }
}

const FlexibleBody::Node* Mechanics::node(int frame, const FlexibleBody*& body, int& i) const {
  if (frame < joints) return nullptr;
  for (const FlexibleBody& x : w->flexible)
    if (i = frame - x.first_pose, i < static_cast<int>(x.data.nodes.size())) return body = &x, &x.node(i);
  return nullptr;
}

void Mechanics::inertia(const double* q) {
  ++pose_stamp_;
  w->sweep ? w->sweep->inertia(q, w->poses.data(), w->J.data(), w->M.data())
           : w->other->inertia(q, w->poses.data(), w->J.data(), w->M.data());
}

void Mechanics::dynamics(const double* q, const double* v) {
  if (!w->sweep) return inertia(q), bias(q, v);
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->dynamics(q, v, w->poses.data(), w->J.data(), w->M.data(), w->nle.data());
}

void Mechanics::poses(const double* q) {
  ++pose_stamp_;
  w->sweep ? w->sweep->poses(q, w->poses.data(), w->J.data()) : w->other->poses(q, w->poses.data(), w->J.data());
}

void Mechanics::save_poses() { ++pose_stamp_, std::swap(w->poses, w->saved_poses); }
void Mechanics::restore_poses() { ++pose_stamp_, w->poses = w->saved_poses; }

void Mechanics::motions(const double* q, const double* v) { motions(q, v, nullptr); }

void Mechanics::motions(const double* q, const double* v, const double* a) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->motions(q, v, a, w->poses.data(), w->J.data())
           : w->other->motions(q, v, a, w->poses.data());
}

void Mechanics::bias(const double* q, const double* v) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->inverse(q, v, nullptr, w->poses.data(), w->J.data(), w->nle.data())
           : w->other->bias(q, v, w->nle.data());
}

void Mechanics::inverse(const double* q, const double* v, const double* a, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep ? w->sweep->inverse(q, v, a, w->poses.data(), w->J.data(), out)
           : w->other->inverse(q, v, a, w->poses.data(), w->J.data(), out);
}

void Mechanics::add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a,
                           const double* gravity, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->add_forces(bodies, q, v, a, gravity, w->poses.data(), w->J.data(), out);
}

std::vector<FlexibleBody> Mechanics::bind(std::vector<ModalBody> bodies) const {
  return bound(std::move(bodies), w->model);
}

void Mechanics::expand(const void* model) {
  const TreeModel tree = tree_model(model);
  std::vector<int> before;
  std::vector<std::vector<int>> own(tree.joints.size() - 1);
  expanded_joints.resize(nv);
  for (size_t j = 1; j < tree.joints.size(); ++j) {
    const TreeModel::Joint& x = tree.joints[j];
    before.push_back(x.parent - 1);
    for (int i = 0; i < x.nv; ++i) own[j - 1].push_back(x.iv + i), expanded_joints[x.iv + i] = static_cast<int>(j);
  }
  w->partials.reset(new RneaPartials(std::move(before), std::move(own)));
}

bool Mechanics::partials_begun(const double* q, const double* v) const {
  const auto& begun = w->begun;
  return !begun.q.empty() && std::equal(q, q + nq, begun.q.data()) && std::equal(v, v + nv, begun.v.data());
}

void Mechanics::inertia(const double* q, const double* v) {
  auto& begun = w->begun;
  poses(q);
  // About a point among the bodies: far from the world's origin, digits would cancel.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  int bodies = joints - 1;
  for (const FlexibleBody& x : w->flexible) bodies -= x.data.modes;  // joints of modes have no poses: zero
  for (int j = 1; j < joints; ++j) centroid += w->position(j) / std::max(bodies, 1);
  for (int j = 1; j < joints; ++j) {
    Body here = body(j);
    for (int i = 0; i < 3; ++i) here.centre[i] -= centroid[i];
    w->partials->set(expanded_joints[w->model.joints[j].iv + w->model.joints[j].nv - 1] - 1, here);
  }
  begun.J = begun.about = w->J, begun.poses = w->poses;
  for (int k = 0; k < nv; ++k) add_cross(&begun.J[6 * k + 3], centroid.data(), &begun.about[6 * k]);
  begun.q.assign(q, q + nq), begun.v.assign(v, v + nv), begun.M.resize(w->M.size());
  w->partials->begin(begun.about.data(), w->model.gravity, v, begun.M.data(), w->nle.data());
  for (size_t k = 0, n = nv; k < n; ++k) begun.M[(n + 1) * k] += w->model.armature[k];
  if (!w->flexible.empty()) {
    w->sweep->dynamics(q, v, w->poses.data(), w->J.data(), w->M.data(), w->nle.data());
    begun.M = w->M;
    for (size_t k = 0, n = nv; k < n; ++k)
      for (size_t i = 0; i < k; ++i) begun.M[n * i + k] = begun.M[n * k + i];
  }
  w->M = begun.M;
}

const double* Mechanics::bias() const { return w->nle.data(); }

void Mechanics::partials(const double* q, const double* v, const double* a, double* by_q, double* by_v, bool alone) {
  ++pose_stamp_;
  if (partials_begun(q, v) && w->flexible.empty())
    w->M = w->begun.M, w->J = w->begun.J, w->poses = w->begun.poses;
  else
    inertia(q, v);
  w->partials->complete(a, by_q, by_v, alone);
  if (!w->flexible.empty())
    w->sweep->add_partials(expanded_joints.data(), q, v, a, alone, by_q, by_v);
}

double Mechanics::potential() const {
  double out = 0;
  const Vector3 gravity(w->model.gravity);
  for (int j = 1; j < joints; ++j) {
    const TreeModel::Joint& x = w->model.joints[j];
    out -= *x.mass * gravity.dot(w->rotation(j) * Vector3(x.lever) + w->position(j));
  }
  for (const FlexibleBody& x : w->flexible) out += x.potential(rotation(x.data.joint), w->model.gravity);
  return out;
}

const double* Mechanics::M() const { return w->M.data(); }
const double* Mechanics::J() const { return w->J.data(); }
const double* Mechanics::rotation(int j) const { return &w->poses[12 * j]; }
const double* Mechanics::position(int j) const { return &w->poses[12 * j + 9]; }

void Mechanics::velocity(int j, double* out) const {
  w->sweep ? w->sweep->velocity(j, out) : w->other->velocity(j, w->poses.data(), out);
}

void Mechanics::acceleration(int j, double* out) const {
  w->sweep ? w->sweep->acceleration(j, out) : w->other->acceleration(j, w->poses.data(), out);
}

void Mechanics::bias_minus_gravity(int j, double* out) const {
  w->sweep ? w->sweep->acceleration(j, out) : w->other->bias_minus_gravity(j, w->poses.data(), out);
}

void Mechanics::gravity(double* out) const { std::copy_n(w->model.gravity, 3, out); }

void Mechanics::placement(int j, double* R, double* p) const {
  const TreeModel::Joint& x = w->model.joints[j];
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R, 3, 3) = w->rotation(x.parent) * Matrix3(x.R);
  Eigen::Map<Eigen::Vector3d>(p, 3) = w->rotation(x.parent) * Vector3(x.p) + w->position(x.parent);
}

Body Mechanics::body(int j) const {
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

void Mechanics::integrate(const double* q, const double* x, double* out) {
  w->sweep ? mbdae::integrate(w->model.tree, q, x, out) : w->other->integrate(q, x, out);
}

void Mechanics::difference(const double* q0, const double* q1, double* out) {
  w->sweep ? mbdae::difference(w->model.tree, q0, q1, out) : w->other->difference(q0, q1, out);
}

void Mechanics::normalize(double* q) {
  w->sweep ? mbdae::normalize(w->model.tree, q) : w->other->normalize(q);
}

void Mechanics::tangent_map(const double* q, const double* v, double* dq) {
  w->sweep ? mbdae::tangent_map(w->model.tree, q, v, dq) : w->other->tangent_map(q, v, dq);
}

void Mechanics::neutral(double* q) { w->sweep ? mbdae::neutral(w->model.tree, q) : w->other->neutral(q); }

}  // namespace mbdae
