// The data of a tree model by value, as stored in exported mechanisms.
#pragma once

#include <vector>

#include "math/fields.hpp"
#include "mechanism/tree_model.hpp"

namespace mbdae {

struct BodyData {  // a joint of the model: its placement and its child body
  int parent = 0, iq = 0, iv = 0, nv = 0;
  double R[9], p[3], mass = 0, lever[3], I[6];

  FIELDS(parent, iq, iv, nv, R, p, mass, lever, I)
};

struct FixedAxesData {  // a joint of the sweep
  int rotation = 0, parent = 0, root = 0, joint = 0, q = 0, v = 0, nv = 0, translations = 0, frame_axis = 0;
  double axis[3], axis_sign = 1, pitch = 0, R[9], p[3];

  FIELDS(rotation, parent, root, joint, q, v, nv, translations, frame_axis, axis, axis_sign, pitch, R, p)
};

struct TreeData {
  int nq = 0, nv = 0;
  std::vector<BodyData> joints;
  std::vector<FixedAxesData> tree;
  std::vector<double> gravity, armature;

  FIELDS(nq, nv, joints, tree, gravity, armature)
};

TreeModel model_of(const TreeData& data);  // refers to the data, and must not outlive them
TreeData data_of(const TreeModel& model);

}  // namespace mbdae
