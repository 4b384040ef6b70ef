// Pinocchio models: their data, and Pinocchio's algorithms for joints that the sweep does not support.
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <boost/python/extract.hpp>

#include "mechanism/model.hpp"
#include "mechanism/tree_joints.hpp"
#include "mechanism/tree_model.hpp"

namespace mbdae {

namespace {

using Eigen::VectorXd;
using VectorRef = Eigen::Ref<const VectorXd>;  // the type for which the library compiles its algorithms
using In = Eigen::Map<const VectorXd>;
using Out = Eigen::Map<VectorXd>;

// A workspace for crba in the world convention, nonLinearEffects, rnea, forwardKinematics and computeJointJacobians:
// the constructor from a model also allocates nv^3 entries for second derivatives. See
// mechanism/tree/pinocchio_data.py.
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

class PinocchioTree final : public TreeAlgorithms {
 public:
  explicit PinocchioTree(const pinocchio::Model& model)
      : m_(model), data_(minimal_data(model)), q_(m_.nq), sum_(m_.nq), zero_(VectorXd::Zero(m_.nv)) {}

  const double* inertia(const double* q, double* poses, double* J) override {
    pinocchio::crba(m_, data_, configuration(q), pinocchio::Convention::WORLD), write(poses, J);
    return data_.M.data();
  }
  void poses(const double* q, double* poses, double* J) override {
    pinocchio::computeJointJacobians(m_, data_, configuration(q)), write(poses, J);
  }
  void motions(const double* q, const double* v, const double* a, double* poses) override {
    pinocchio::forwardKinematics(m_, data_, configuration(q), vector(v), vector(a)), write(poses, nullptr);
  }
  void bias(const double* q, const double* v, double* nle) override {
    Out(nle, m_.nv) = pinocchio::nonLinearEffects(m_, data_, configuration(q), vector(v));
  }
  void inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) override {
    Out(out, m_.nv) = pinocchio::rnea(m_, data_, configuration(q), vector(v), vector(a));
    pinocchio::updateGlobalPlacements(m_, data_);
    pinocchio::computeJointJacobians(m_, data_), write(poses, J);
  }
  void velocity(int j, const double* poses, double* out) const override { act(j, poses, data_.v[j], out); }
  void acceleration(int j, const double* poses, double* out) const override { act(j, poses, data_.a[j], out); }
  void bias_minus_gravity(int j, const double* poses, double* out) const override {
    act(j, poses, data_.a_gf[j], out);
  }
  void integrate(const double* q, const double* x, double* out) override {
    pinocchio::integrate(m_, VectorXd(In(q, m_.nq)), VectorXd(In(x, m_.nv)), sum_), Out(out, m_.nq) = sum_;
  }
  void difference(const double* q0, const double* q1, double* out) override {
    Out(out, m_.nv) = pinocchio::difference(m_, VectorXd(In(q0, m_.nq)), VectorXd(In(q1, m_.nq)));
  }
  void neutral(double* q) override { Out(q, m_.nq) = pinocchio::neutral(m_); }
  void normalize(double* q) override {
    q_ = In(q, m_.nq);
    pinocchio::normalize(m_, q_), Out(q, m_.nq) = q_;
  }
  void tangent_map(const double* q, const double* v, double* dq) override {
    Eigen::MatrixXd T = Eigen::MatrixXd::Zero(m_.nq, m_.nv);
    q_ = In(q, m_.nq);
    pinocchio::tangentMap(m_, q_, T, pinocchio::SETTO);
    Out(dq, m_.nq).noalias() = T * In(v, m_.nv);
  }

 private:
  VectorRef configuration(const double* q) { return q_ = In(q, m_.nq), VectorRef(q_); }
  VectorRef vector(const double* x) const { return x ? VectorRef(In(x, m_.nv)) : VectorRef(zero_); }
  void write(double* poses, double* J) const {
    for (size_t j = 0; j < data_.oMi.size(); ++j) {
      Out(poses + 12 * j, 9) = In(data_.oMi[j].rotation().data(), 9);
      Out(poses + 12 * j + 9, 3) = data_.oMi[j].translation();
    }
    if (J) std::copy_n(data_.J.data(), data_.J.size(), J);
  }
  void act(int j, const double* poses, const pinocchio::Motion& x, double* out) const {
    const double* R_and_p = poses + 12 * j;
    const pinocchio::SE3 pose(Eigen::Map<const Eigen::Matrix3d>(R_and_p),
                              Eigen::Map<const Eigen::Vector3d>(R_and_p + 9));
    Eigen::Map<Eigen::Matrix<double, 6, 1>> o(out);
    j ? o = pose.act(x).toVector() : o.setZero();
  }

  const pinocchio::Model& m_;
  pinocchio::Data data_;
  VectorXd q_, sum_;
  const VectorXd zero_;
};

}  // namespace

TreeModel tree_model(const void* model) {
  const auto& m = *static_cast<const pinocchio::Model*>(model);
  TreeModel out;
  out.nq = m.nq, out.nv = m.nv, out.tree = tree_joints(m);
  out.gravity = m.gravity.linear().data(), out.armature = m.armature.data();
  for (int j = 0; j < m.njoints; ++j) {
    auto& body = const_cast<pinocchio::Inertia&>(m.inertias[j]);  // non-const, to take the address of its mass
    const pinocchio::SE3& placement = m.jointPlacements[j];
    out.joints.push_back({static_cast<int>(m.parents[j]), m.idx_qs[j], m.idx_vs[j], m.nvs[j],
                          placement.rotation().data(), placement.translation().data(), &body.mass(),
                          body.lever().data(), body.inertia().data().data()});
  }
  out.joints[0].nv = 0;
  return out;
}

std::unique_ptr<TreeAlgorithms> tree_algorithms(const void* model) {
  return std::make_unique<PinocchioTree>(*static_cast<const pinocchio::Model*>(model));
}

const void* model_pointer(PyObject* object) {
  boost::python::extract<const pinocchio::Model&> extract(object);
  if (!extract.check()) throw std::invalid_argument("expected a pinocchio.Model");
  return &extract();
}

bool sweep_supports(const void* pointer) {
  return !tree_joints(*static_cast<const pinocchio::Model*>(pointer)).empty();
}

std::array<int, 3> model_sizes(const void* pointer) {
  const auto& model = *static_cast<const pinocchio::Model*>(pointer);
  return {model.nq, model.nv, model.njoints};
}

}  // namespace mbdae
