// Conversion between a tree model and its data.
#include "mechanism/tree_data.hpp"

#include <algorithm>

namespace mbdae {

TreeModel model_of(const TreeData& data) {
  TreeModel out;
  out.nq = data.nq, out.nv = data.nv, out.gravity = data.gravity.data(), out.armature = data.armature.data();
  for (const BodyData& x : data.joints)
    out.joints.push_back({x.parent, x.iq, x.iv, x.nv, x.R, x.p, &x.mass, x.lever, x.I});
  for (const FixedAxesData& x : data.tree) {
    TreeJoint joint;
    joint.rotation = static_cast<TreeJoint::RotationKind>(x.rotation);
    joint.parent = x.parent, joint.root = x.root, joint.joint = x.joint, joint.q = x.q, joint.v = x.v, joint.nv = x.nv;
    joint.translations = x.translations, joint.frame_axis = x.frame_axis, joint.axis_sign = x.axis_sign;
    joint.pitch = x.pitch, joint.R = x.R, joint.p = x.p;
    std::copy_n(x.axis, 3, joint.axis);
    if (joint.joint > 0) {
      const TreeModel::Joint& body = out.joints[joint.joint];
      joint.mass = body.mass, joint.lever = body.lever, joint.I = body.I;
    }
    out.tree.push_back(joint);
  }
  return out;
}

TreeData data_of(const TreeModel& model) {
  TreeData out;
  out.nq = model.nq, out.nv = model.nv;
  out.gravity.assign(model.gravity, model.gravity + 3), out.armature.assign(model.armature, model.armature + model.nv);
  for (const TreeModel::Joint& x : model.joints) {
    BodyData body;
    body.parent = x.parent, body.iq = x.iq, body.iv = x.iv, body.nv = x.nv, body.mass = *x.mass;
    std::copy_n(x.R, 9, body.R), std::copy_n(x.p, 3, body.p);
    std::copy_n(x.lever, 3, body.lever), std::copy_n(x.I, 6, body.I);
    out.joints.push_back(body);
  }
  for (const TreeJoint& x : model.tree) {
    FixedAxesData joint;
    joint.rotation = x.rotation, joint.parent = x.parent, joint.root = x.root, joint.joint = x.joint, joint.q = x.q;
    joint.v = x.v, joint.nv = x.nv, joint.translations = x.translations, joint.frame_axis = x.frame_axis;
    joint.axis_sign = x.axis_sign, joint.pitch = x.pitch;
    std::copy_n(x.axis, 3, joint.axis);
    for (int i = 0; i < 9; ++i) joint.R[i] = x.R ? x.R[i] : 0;
    for (int i = 0; i < 3; ++i) joint.p[i] = x.p ? x.p[i] : 0;
    out.tree.push_back(joint);
  }
  return out;
}

}  // namespace mbdae
