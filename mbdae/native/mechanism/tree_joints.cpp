#include "mechanism/tree_joints.hpp"

#include <map>
#include <string>

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>

namespace mbdae {

namespace {

using pinocchio::JointModel;
using pinocchio::SE3;

struct Kind {
  TreeJoint::RotationKind rotation;
  int translations;
};

const std::map<std::string, Kind>& kinds() {
  static const std::map<std::string, Kind> all = [] {
    std::map<std::string, Kind> out{{"Spherical", {TreeJoint::quaternion, 0}},
                                    {"FreeFlyer", {TreeJoint::quaternion, 3}},
                                    {"Planar", {TreeJoint::circle, 2}},
                                    {"Translation", {TreeJoint::none, 3}}};
    for (const char* name : {"RX", "RY", "RZ", "RevoluteUnaligned", "HX", "HY", "HZ", "HelicalUnaligned"})
      out[name] = {TreeJoint::angle, 0};
    for (const char* name : {"RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned"}) out[name] = {TreeJoint::circle, 0};
    for (const char* name : {"PX", "PY", "PZ", "PrismaticUnaligned"}) out[name] = {TreeJoint::none, 1};
    return out;
  }();
  return all;
}

class Chains {
 public:
  explicit Chains(const pinocchio::Model& model) : neutral_(pinocchio::neutral(model)) {}

  std::vector<TreeJoint> joints{1};

  // Append the joints with fixed axes that make one of the model: the last becomes `end`. False for an unknown kind.
  bool add(const JointModel& joint, const SE3& placement, int& end) {
    const std::string name = joint.shortname().substr(std::string("JointModel").size());
    if (name == "Universal") {
      const auto& both = boost::get<pinocchio::JointModelUniversal>(joint.toVariant());
      return add_revolute(joint, 0, both.axis1, placement, end), add_revolute(joint, 1, both.axis2, one_, end), true;
    }
    if (name == "SphericalZYX") {
      for (int k = 0; k < 3; ++k) add_revolute(joint, k, Eigen::Vector3d::Unit(2 - k), k ? one_ : placement, end);
      return true;
    }
    if (name == "Composite") {
      const auto& all = boost::get<pinocchio::JointModelComposite>(joint.toVariant());
      append({}, placement, end);
      for (size_t i = 0; i < all.joints.size(); ++i)
        if (!add(all.joints[i], all.jointPlacements[i], end)) return false;
      return true;
    }
    const auto kind = kinds().find(name);
    if (kind == kinds().end()) return false;
    TreeJoint x;
    x.rotation = kind->second.rotation, x.translations = kind->second.translations;
    x.q = joint.idx_q(), x.v = joint.idx_v(), x.nv = joint.nv();
    auto data = joint.createData();
    joint.calc(data, neutral_);  // its axes are the same everywhere
    const Eigen::Matrix<double, 6, Eigen::Dynamic> S = data.S().matrix();
    set_axis(x, x.rotation == TreeJoint::none ? S.col(0).head<3>() : S.rightCols<1>().tail<3>());
    if (x.nv == 1 && x.rotation != TreeJoint::none) x.pitch = S.col(0).head<3>().dot(S.col(0).tail<3>());
    return append(x, placement, end), true;
  }

 private:
  void add_revolute(const JointModel& joint, int k, const Eigen::Vector3d& axis, const SE3& placement, int& end) {
    TreeJoint x;
    x.rotation = TreeJoint::angle, x.q = joint.idx_q() + k, x.v = joint.idx_v() + k, x.nv = 1;
    set_axis(x, axis), append(x, placement, end);
  }

  static void set_axis(TreeJoint& x, const Eigen::Vector3d& axis) {
    Eigen::Map<Eigen::Vector3d>(x.axis) = axis;
    for (int i = 0; i < 3; ++i)
      for (const double sense : {1.0, -1.0})
        if (axis == sense * Eigen::Vector3d::Unit(i)) x.frame_axis = i, x.axis_sign = sense;
  }

  void append(TreeJoint x, const SE3& placement, int& end) {
    x.parent = end, end = static_cast<int>(joints.size());
    x.root = x.parent ? joints[x.parent].root : end, x.joint = -1;
    x.R = placement.rotation().data(), x.p = placement.translation().data();
    joints.push_back(x);
  }

  const Eigen::VectorXd neutral_;
  static const SE3 one_;
};

const SE3 Chains::one_ = SE3::Identity();

}  // namespace

std::vector<TreeJoint> tree_joints(const pinocchio::Model& model) {
  Chains chains(model);
  std::vector<int> carrier(model.njoints);
  for (int j = 1; j < model.njoints; ++j) {
    int end = carrier[model.parents[j]];
    if (!chains.add(model.joints[j], model.jointPlacements[j], end)) return {};
    carrier[j] = end;
    TreeJoint& last = chains.joints[end];
    auto& body = const_cast<pinocchio::Inertia&>(model.inertias[j]);  // whose mass has no other address
    last.joint = j, last.mass = &body.mass(), last.lever = body.lever().data(), last.I = body.inertia().data().data();
  }
  return chains.joints;
}

}  // namespace mbdae
