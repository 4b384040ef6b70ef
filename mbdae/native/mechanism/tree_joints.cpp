// Pinocchio joints as chains of joints with fixed axes.
#include "mechanism/tree_joints.hpp"

#include <map>
#include <string>

#include <pinocchio/multibody.hpp>

namespace mbdae {

namespace {

using pinocchio::JointModel;
using pinocchio::SE3;

struct Kind {
  TreeJoint::RotationKind rotation;
  int translations, axis;
};

constexpr int unaligned = -1;

const std::map<std::string, Kind>& kinds() {
  static const std::map<std::string, Kind> table = [] {
    std::map<std::string, Kind> out{{"Spherical", {TreeJoint::quaternion, 0, 2}},
                                    {"FreeFlyer", {TreeJoint::quaternion, 3, 2}},
                                    {"Planar", {TreeJoint::circle, 2, 2}},
                                    {"Translation", {TreeJoint::none, 3, 0}},
                                    {"RevoluteUnaligned", {TreeJoint::angle, 0, unaligned}},
                                    {"HelicalUnaligned", {TreeJoint::angle, 0, unaligned}},
                                    {"RevoluteUnboundedUnaligned", {TreeJoint::circle, 0, unaligned}},
                                    {"PrismaticUnaligned", {TreeJoint::none, 1, unaligned}}};
    for (int i = 0; i < 3; ++i) {
      const std::string letter(1, "XYZ"[i]);
      out["R" + letter] = out["H" + letter] = {TreeJoint::angle, 0, i};
      out["RUB" + letter] = {TreeJoint::circle, 0, i};
      out["P" + letter] = {TreeJoint::none, 1, i};
    }
    return out;
  }();
  return table;
}

// A joint as this type, or null. `calc` would also compute axis and pitch, but takes half a minute to compile.
template <class Joint>
const Joint* as(const JointModel& joint) {
  return boost::get<Joint>(&joint.toVariant());
}

template <class Joint>
bool axis_of(const JointModel& joint, Eigen::Vector3d& axis) {
  const auto* typed = as<Joint>(joint);
  if (typed) axis = typed->axis;
  return typed;
}

Eigen::Vector3d unaligned_axis(const JointModel& joint) {
  using namespace pinocchio;
  Eigen::Vector3d axis;
  axis_of<JointModelRevoluteUnaligned>(joint, axis) || axis_of<JointModelPrismaticUnaligned>(joint, axis) ||
      axis_of<JointModelRevoluteUnboundedUnaligned>(joint, axis) || axis_of<JointModelHelicalUnaligned>(joint, axis);
  return axis;
}

template <class Joint>
double pitch_of(const JointModel& joint) {
  const auto* screw = as<Joint>(joint);
  return screw ? screw->m_pitch : 0;
}

double pitch(const JointModel& joint) {  // pitch of a screw, otherwise 0
  using namespace pinocchio;
  return pitch_of<JointModelHX>(joint) + pitch_of<JointModelHY>(joint) + pitch_of<JointModelHZ>(joint) +
         pitch_of<JointModelHelicalUnaligned>(joint);
}

class JointChains {
 public:
  std::vector<TreeJoint> joints{1};

  // Append the joints with fixed axes that compose a joint of the model, and set `end` to the last; false: unsupported
  // kind.
  bool add(const JointModel& joint, const SE3& placement, int& end) {
    const std::string name = joint.shortname().substr(std::string("JointModel").size());
    if (name == "Universal") {
      const auto& universal = boost::get<pinocchio::JointModelUniversal>(joint.toVariant());
      return add_revolute(joint, 0, universal.axis1, placement, end),
             add_revolute(joint, 1, universal.axis2, identity_, end), true;
    }
    if (name == "SphericalZYX") {
      for (int k = 0; k < 3; ++k) add_revolute(joint, k, Eigen::Vector3d::Unit(2 - k), k ? identity_ : placement, end);
      return true;
    }
    if (name == "Composite") {
      const auto& composite = boost::get<pinocchio::JointModelComposite>(joint.toVariant());
      append({}, placement, end);
      for (size_t i = 0; i < composite.joints.size(); ++i)
        if (!add(composite.joints[i], composite.jointPlacements[i], end)) return false;
      return true;
    }
    const auto kind = kinds().find(name);
    if (kind == kinds().end()) return false;
    TreeJoint x;
    x.rotation = kind->second.rotation, x.translations = kind->second.translations;
    x.q = joint.idx_q(), x.v = joint.idx_v(), x.nv = joint.nv();
    const int axis = kind->second.axis;
    set_axis(x, axis == unaligned ? unaligned_axis(joint) : Eigen::Vector3d::Unit(axis)), x.pitch = pitch(joint);
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
      for (const double sign : {1.0, -1.0})
        if (axis == sign * Eigen::Vector3d::Unit(i)) x.frame_axis = i, x.axis_sign = sign;
  }

  void append(TreeJoint x, const SE3& placement, int& end) {
    x.parent = end, end = static_cast<int>(joints.size());
    x.root = x.parent ? joints[x.parent].root : end, x.joint = -1;
    x.R = placement.rotation().data(), x.p = placement.translation().data();
    joints.push_back(x);
  }

  static const SE3 identity_;
};

const SE3 JointChains::identity_ = SE3::Identity();

}  // namespace

std::vector<TreeJoint> tree_joints(const pinocchio::Model& model) {
  JointChains chains;
  std::vector<int> last_of_joint(model.njoints);
  for (int j = 1; j < model.njoints; ++j) {
    int end = last_of_joint[model.parents[j]];
    if (!chains.add(model.joints[j], model.jointPlacements[j], end)) return {};
    last_of_joint[j] = end;
    TreeJoint& last = chains.joints[end];
    auto& body = const_cast<pinocchio::Inertia&>(model.inertias[j]);  // non-const, to take the address of its mass
    last.joint = j, last.mass = &body.mass(), last.lever = body.lever().data(), last.I = body.inertia().data().data();
  }
  return chains.joints;
}

}  // namespace mbdae
