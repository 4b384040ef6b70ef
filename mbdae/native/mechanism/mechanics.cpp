#include "mechanism/mechanics.hpp"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <boost/python/extract.hpp>

#include "mechanism/mechanics_workspace.hpp"
#include "mechanism/model.hpp"
#include "mechanism/tree_joints.hpp"

namespace mbdae {

namespace {

// A workspace for crba in the world's convention, nonLinearEffects, rnea, forwardKinematics and computeJointJacobians:
// the constructor from a model allocates nv^3 numbers for second derivatives. See mechanism/tree/pinocchio_data.py.
pinocchio::Data minimal_data(const pinocchio::Model& model) {
  using namespace pinocchio;
  Data data;
  const size_t n = model.njoints;
  for (const JointModel& joint : model.joints) data.joints.push_back(joint.createData());
  data.oMi.assign(n, SE3::Identity()), data.liMi = data.oMi;
  data.v.assign(n, Motion::Zero()), data.a = data.a_gf = data.v;
  data.f.assign(n, Force::Zero()), data.h = data.f;
  data.oYcrb.assign(n, Inertia::Zero());
  data.mass.assign(n, 0.0), data.com.assign(n, Eigen::Vector3d::Zero());
  data.nvSubtree = model.nvs;
  for (size_t i = n; --i > 0;) data.nvSubtree[model.parents[i]] += data.nvSubtree[i];
  data.J.setZero(6, model.nv), data.Ag.setZero(6, model.nv), data.M.setZero(model.nv, model.nv);
  data.nle.setZero(model.nv), data.tau.setZero(model.nv);
  return data;
}

std::vector<FlexibleBody> bound(std::vector<ModalBody> bodies, const pinocchio::Model& m) {
  std::vector<FlexibleBody> out;
  int pose = m.njoints, column = m.nv;
  for (ModalBody& x : bodies) {
    std::vector<int> base;
    for (int j : m.supports[x.joint])
      for (int i = 0; j && i < m.nvs[j]; ++i) base.push_back(m.idx_vs[j] + i);
    const int nodes = static_cast<int>(x.nodes.size()), modes = x.modes;
    out.emplace_back(std::move(x), std::move(base), pose, column);
    pose += nodes, column += nodes * modes;
  }
  return out;
}

}  // namespace

Mechanics::Workspace::Workspace(const pinocchio::Model& m, std::vector<FlexibleBody> flexible_)
    : model(m), flexible(std::move(flexible_)), data(minimal_data(m)), q(m.nq), v(m.nv), a(VectorXd::Zero(m.nv)), end(m.nq) {
  size_t nodes = 0, columns = 0;
  for (const FlexibleBody& x : flexible) nodes += x.data.nodes.size(), columns += x.data.nodes.size() * x.data.modes;
  data.oMi.resize(m.njoints + nodes, pinocchio::SE3::Identity());
  data.J.setZero(6, m.nv + columns);
  saved_poses = data.oMi;
}

Mechanics::Mechanics(const void* model, const Tolerances& limits_, std::vector<ModalBody> flexible)
    : limits(limits_) {
  const auto& m = *static_cast<const pinocchio::Model*>(model);
  w.reset(new Workspace(m, bound(std::move(flexible), m)));
  nq = w->model.nq, nv = w->model.nv, joints = w->model.njoints, frames = static_cast<int>(w->data.oMi.size());
  ancestors.resize(nv), tangent.assign(nq, 0);
  const auto above = supports();
  parents.assign(w->model.parents.begin(), w->model.parents.end());
  for (int j = 1; j < joints; ++j) tangent[w->model.idx_qs[j]] = w->model.idx_vs[j];
  for (int j = 1; j < joints; ++j)
    for (int i = 0; i < w->model.nvs[j]; ++i) {
      const auto& own = above[j].velocities;
      const auto end = own.end() - w->model.nvs[j] + i;
      ancestors[w->model.idx_vs[j] + i].assign(std::make_reverse_iterator(end), own.rend());
    }
  for (const FlexibleBody& x : w->flexible)  // zeros of M: its factors have no others
    for (int i = 0; i < x.data.modes && x.data.orthogonal(); ++i) ancestors[x.data.iv + i].assign(x.base.rbegin(), x.base.rend());
  begin_sweep();
}

void Mechanics::begin_sweep() {
  w->nle.setZero(nv);
  auto tree = tree_joints(w->model);
  const double *gravity = w->model.gravity.linear().data(), *armature = w->model.armature.data();
  if (!tree.empty()) w->sweep.reset(new TreeSweep(std::move(tree), ancestors, gravity, armature, &w->flexible));
  if (!w->sweep && !w->flexible.empty()) throw std::invalid_argument("flexible bodies need joints with fixed axes");
}

void Mechanics::write(const void* model, const Tolerances& limits_, std::vector<ModalBody> flexible) {
  ++motion_stamp_, ++pose_stamp_, limits = limits_;
  if (model == &w->model) return;
  auto partials = std::move(w->partials);
  const auto& m = *static_cast<const pinocchio::Model*>(model);
  w.reset(new Workspace(m, bound(std::move(flexible), m))), begin_sweep();
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
    x = out[w->model.parents[j]].velocities;
    for (int i = 0; i < w->model.nvs[j]; ++i) x.push_back(w->model.idx_vs[j] + i);
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
  if (w->sweep) return w->sweep->inertia(q, w->poses(), w->J(), w->data.M.data());
  w->q = In(q, nq);
  pinocchio::crba(w->model, w->data, Vector(w->q), pinocchio::Convention::WORLD);
}

void Mechanics::dynamics(const double* q, const double* v) {
  if (!w->sweep) return inertia(q), bias(q, v);
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->dynamics(q, v, w->poses(), w->J(), w->data.M.data(), w->nle.data());
}

void Mechanics::poses(const double* q) {
  ++pose_stamp_;
  if (w->sweep) return w->sweep->poses(q, w->poses(), w->J());
  w->q = In(q, nq);
  pinocchio::computeJointJacobians(w->model, w->data, Vector(w->q));
}

void Mechanics::save_poses() { ++pose_stamp_, std::swap(w->data.oMi, w->saved_poses); }
void Mechanics::restore_poses() { ++pose_stamp_, w->data.oMi = w->saved_poses; }

void Mechanics::motions(const double* q, const double* v) {
  ++motion_stamp_, ++pose_stamp_;
  if (w->sweep) return w->sweep->motions(q, v, nullptr, w->poses(), w->J());
  w->q = In(q, nq), w->v = In(v, nv);
  pinocchio::forwardKinematics(w->model, w->data, Vector(w->q), Vector(w->v), Vector(w->a));
}

void Mechanics::motions(const double* q, const double* v, const double* a) {
  ++motion_stamp_, ++pose_stamp_;
  if (w->sweep) return w->sweep->motions(q, v, a, w->poses(), w->J());
  w->q = In(q, nq), w->v = In(v, nv), w->rate = In(a, nv);
  pinocchio::forwardKinematics(w->model, w->data, Vector(w->q), Vector(w->v), Vector(w->rate));
}

void Mechanics::bias(const double* q, const double* v) {
  ++motion_stamp_, ++pose_stamp_;
  if (w->sweep) return w->sweep->inverse(q, v, nullptr, w->poses(), w->J(), w->nle.data());
  w->q = In(q, nq), w->v = In(v, nv);
  w->nle = pinocchio::nonLinearEffects(w->model, w->data, Vector(w->q), Vector(w->v));
}

void Mechanics::inverse(const double* q, const double* v, const double* a, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  if (w->sweep) return w->sweep->inverse(q, v, a, w->poses(), w->J(), out);
  w->q = In(q, nq), w->v = In(v, nv), w->rate = In(a, nv);
  Out(out, nv) = pinocchio::rnea(w->model, w->data, Vector(w->q), Vector(w->v), Vector(w->rate));
  pinocchio::updateGlobalPlacements(w->model, w->data);
  pinocchio::computeJointJacobians(w->model, w->data);
}

void Mechanics::add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a,
                           const double* gravity, double* out) {
  ++motion_stamp_, ++pose_stamp_;
  w->sweep->add_forces(bodies, q, v, a, gravity, w->poses(), w->J(), out);
}

std::vector<FlexibleBody> Mechanics::bind(std::vector<ModalBody> bodies) const {
  return bound(std::move(bodies), w->model);
}

void Mechanics::expand(const void* model) {
  const auto& tree = *static_cast<const pinocchio::Model*>(model);
  std::vector<int> before;
  std::vector<std::vector<int>> own(tree.njoints - 1);
  expanded_joints.resize(nv);
  for (int j = 1; j < tree.njoints; ++j) {
    before.push_back(static_cast<int>(tree.parents[j]) - 1);
    for (int i = 0; i < tree.nvs[j]; ++i)
      own[j - 1].push_back(tree.idx_vs[j] + i), expanded_joints[own[j - 1].back()] = j;
  }
  w->partials.reset(new RneaPartials(std::move(before), std::move(own)));
}

bool Mechanics::partials_begun(const double* q, const double* v) const {
  const auto& begun = w->begun;
  return begun.q.size() == nq && std::equal(q, q + nq, begun.q.data()) && std::equal(v, v + nv, begun.v.data());
}

void Mechanics::inertia(const double* q, const double* v) {
  auto& begun = w->begun;
  poses(q);
  // About a point among the bodies: far from the world's origin, digits would cancel.
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  int bodies = joints - 1;
  for (const FlexibleBody& x : w->flexible) bodies -= x.data.modes;  // joints of modes have no poses: zero
  for (int j = 1; j < joints; ++j) centroid += w->data.oMi[j].translation() / std::max(bodies, 1);
  for (int j = 1; j < joints; ++j) {
    Body here = body(j);
    for (int i = 0; i < 3; ++i) here.centre[i] -= centroid[i];
    w->partials->set(expanded_joints[w->model.idx_vs[j] + w->model.nvs[j] - 1] - 1, here);
  }
  begun.J = w->data.J, begun.oMi = w->data.oMi, begun.about = w->data.J;
  for (int k = 0; k < nv; ++k) add_cross(&begun.J(3, k), centroid.data(), &begun.about(0, k));
  begun.q = In(q, nq), begun.v = In(v, nv), begun.M.resize(nv, nv);
  w->partials->begin(begun.about.data(), w->model.gravity.linear().data(), v, begun.M.data(), w->nle.data());
  begun.M.diagonal() += w->model.armature;
  if (!w->flexible.empty()) {
    w->sweep->dynamics(q, v, w->poses(), w->J(), w->data.M.data(), w->nle.data());
    begun.M = w->data.M.selfadjointView<Eigen::Upper>();
  }
  w->data.M = begun.M;
}

const double* Mechanics::bias() const { return w->nle.data(); }

void Mechanics::partials(const double* q, const double* v, const double* a, double* by_q, double* by_v, bool alone) {
  ++pose_stamp_;
  if (partials_begun(q, v) && w->flexible.empty())
    w->data.M = w->begun.M, w->data.J = w->begun.J, w->data.oMi = w->begun.oMi;
  else
    inertia(q, v);
  w->partials->complete(a, by_q, by_v, alone);
  if (!w->flexible.empty())
    w->sweep->add_partials(expanded_joints.data(), q, v, a, alone, by_q, by_v);
}

double Mechanics::potential() const {
  double out = 0;
  for (int j = 1; j < joints; ++j) {
    const auto& body = w->model.inertias[j];
    out -= body.mass() * w->model.gravity.linear().dot(w->data.oMi[j].act(body.lever()));
  }
  for (const FlexibleBody& x : w->flexible)
    out += x.potential(w->data.oMi[x.data.joint].rotation().data(), w->model.gravity.linear().data());
  return out;
}

const double* Mechanics::M() const { return w->data.M.data(); }
const double* Mechanics::J() const { return w->data.J.data(); }
const double* Mechanics::rotation(int j) const { return w->data.oMi[j].rotation().data(); }
const double* Mechanics::position(int j) const { return w->data.oMi[j].translation().data(); }

void Mechanics::velocity(int j, double* out) const {
  if (w->sweep) return w->sweep->velocity(j, out);
  Eigen::Map<Eigen::Matrix<double, 6, 1>> o(out);
  if (j)
    o = w->data.oMi[j].act(w->data.v[j]).toVector();
  else
    o.setZero();
}

void Mechanics::acceleration(int j, double* out) const {
  if (w->sweep) return w->sweep->acceleration(j, out);
  Eigen::Map<Eigen::Matrix<double, 6, 1>> o(out);
  if (j)
    o = w->data.oMi[j].act(w->data.a[j]).toVector();
  else
    o.setZero();
}

void Mechanics::bias_minus_gravity(int j, double* out) const {
  if (w->sweep) return w->sweep->acceleration(j, out);
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(out, 6) = w->data.oMi[j].act(w->data.a_gf[j]).toVector();
}

void Mechanics::gravity(double* out) const {
  Eigen::Map<Eigen::Vector3d>(out, 3) = w->model.gravity.linear();
}

void Mechanics::placement(int j, double* R, double* p) const {
  const pinocchio::SE3 pose = w->data.oMi[w->model.parents[j]] * w->model.jointPlacements[j];
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(R, 3, 3) = pose.rotation();
  Eigen::Map<Eigen::Vector3d>(p, 3) = pose.translation();
}

Body Mechanics::body(int j) const {
  const pinocchio::SE3& pose = w->data.oMi[j];
  const pinocchio::Inertia& own = w->model.inertias[j];
  const Eigen::Matrix3d RI = pose.rotation() * own.inertia().matrix();
  Body out;
  out.mass = own.mass();
  Eigen::Map<Eigen::Vector3d>(out.centre, 3).noalias() = pose.rotation() * own.lever() + pose.translation();
  Eigen::Map<Eigen::Matrix3d>(out.I, 3, 3).noalias() = RI * pose.rotation().transpose();
  return out;
}

const void* model_pointer(PyObject* object) {
  boost::python::extract<const pinocchio::Model&> extract(object);
  if (!extract.check()) throw std::invalid_argument("expected a pinocchio.Model");
  return &extract();
}

bool model_sweeps(const void* pointer) {
  return !tree_joints(*static_cast<const pinocchio::Model*>(pointer)).empty();
}

std::array<int, 3> model_sizes(const void* pointer) {
  const auto& model = *static_cast<const pinocchio::Model*>(pointer);
  return {model.nq, model.nv, model.njoints};
}

}  // namespace mbdae
