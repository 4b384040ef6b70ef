// Poses, joint Jacobian, mass matrix and bias of a tree in one pass outward and one inward, in the world frame, for
// joints whose axes are fixed in their bodies (R. Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and
// 6).
#pragma once

#include <array>
#include <vector>

#include "math/spatial.hpp"
#include "mechanism/flexible_body.hpp"

namespace mbdae {

// A joint with fixed axes and its child body: a joint of the model, or one of several that compose it. It points into
// the model, whose data may change.
struct TreeJoint {
  enum RotationKind {
    none,
    angle,
    circle,
    quaternion
  } rotation = none;         // coordinates of rotation, after those of translation
  int parent = 0, root = 0;  // in this tree; root: the first joint of its branch
  int joint = 0;             // joint of the model, whose body it moves; -1: a massless link
  int q = 0, v = 0, nv = 0;
  int translations = 0;  // coordinates of translation: one along the axis, or along the axes of the placement
  double axis[3] = {};   // unit vector of a joint with one velocity, or of the rotation of a planar joint
  int frame_axis = -1;   // the coordinate axis that equals axis_sign * axis; -1: none
  double axis_sign = 1;
  double pitch = 0;     // m/rad
  const double *R = nullptr, *p = nullptr;                       // placement on the parent, by columns
  const double *mass = nullptr, *lever = nullptr, *I = nullptr;  // body; I about its centre: xx, xy, yy, xz, yz, zz
};

// Sparsity of M by columns: entries starts[k] to starts[k + 1] are the diagonal entry of column k and those in the rows
// of its ancestors, nearest first. All other entries above the diagonal are zero.
struct InertiaPattern {
  std::vector<int> rows;
  std::vector<size_t> starts{0};
};

class Sweep {
 public:
  virtual ~Sweep() = default;

  // Read the data of the model, which may have changed; false: another sweep is required.
  virtual bool refresh() { return true; }
  virtual bool planar() const { return false; }
  // Poses (joints and nodes, 12), R by columns and p, the world first, and J (6, nv and nodes) by columns about
  // the world's origin.
  virtual void poses(const double* q, double* poses, double* J) = 0;
  // Also the entries of M, see `InertiaPattern`.
  virtual void inertia(const double* q, double* poses, double* J, double* M) = 0;
  // Also nle (nv,), velocities, and accelerations for v' = 0 minus gravity.
  virtual void dynamics(const double* q, const double* v, double* poses, double* J, double* M, double* nle) = 0;
  // M a + nle (a = nullptr: 0), velocities, and accelerations for v' = a minus gravity.
  virtual void inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) = 0;
  // Velocities and accelerations for v' = a.
  virtual void motions(const double* q, const double* v, const double* a, double* poses, double* J) = 0;
  virtual void velocity(int joint, double* out) const = 0;  // spatial, about the world's origin
  virtual void acceleration(int joint, double* out) const = 0;

  // out += contribution of some flexible bodies to M a + nle under this gravity (3,).
  virtual void add_forces(std::vector<FlexibleBody>&, const double*, const double*, const double*, const double*, double*,
                          double*, double*) {}
  // Add the partials of inertial forces of flexible bodies at the last poses, see `FlexibleBody::add_partials`; without
  // gravity if `inertia_only`.
  virtual void add_partials(const int*, const double*, const double*, const double*, bool, double*, double*) const {}
};

class TreeSweep final : public Sweep {
 public:
  // joints: the world, then parents before children; the pattern of M, gravity (3,), armature (nv,) and flexible bodies
  // must outlive this object.
  TreeSweep(std::vector<TreeJoint> joints, const InertiaPattern& pattern, const double* gravity, const double* armature,
            std::vector<FlexibleBody>* flexible);

  void poses(const double* q, double* poses, double* J) override;
  void inertia(const double* q, double* poses, double* J, double* M) override;
  void dynamics(const double* q, const double* v, double* poses, double* J, double* M, double* nle) override;
  void inverse(const double* q, const double* v, const double* a, double* poses, double* J, double* out) override;
  void motions(const double* q, const double* v, const double* a, double* poses, double* J) override;
  void velocity(int joint, double* out) const override { shift(V_, joint, out); }
  void acceleration(int joint, double* out) const override { shift(A_, joint, out); }
  void add_forces(std::vector<FlexibleBody>& bodies, const double* q, const double* v, const double* a, const double* gravity,
                  double* poses, double* J, double* out) override;
  void add_partials(const int* expanded_joints, const double* q, const double* v, const double* a, bool inertia_only,
                    double* dtau_dq, double* dtau_dv) const override;

 private:
  struct Subtree {  // mass, first moment, inertia as in TreeJoint, and wrench, about the root's position
    double mass, moment[3], I[6];
    Six f;
  };

  template <bool with_motion, bool with_inertia, bool with_wrench>
  void outward(const double* q, const double* v, const double* a, double* poses, double* J);
  template <bool with_inertia, bool with_wrench>
  void inward(double* M, double* nle);
  double* pose(int j, double* poses) { return joints_[j].joint < 0 ? &links_[12 * j] : poses + 12 * joints_[j].joint; }
  void update_pose(int j, const double* q, const double* parent_pose, double* pose);
  void update_columns(int j, const double* pose, double* J);
  void update_motion(int j, const double* v, const double* a);
  template <bool with_inertia, bool with_wrench>
  void add_body(int j, const double* pose);
  void update_frame(FlexibleBody& x, const double* poses) const {
    x.set_pose(poses + 12 * x.data.joint, arms_[index_of_frame_[x.data.joint]].data());
  }
  void add_flexible(std::vector<FlexibleBody>& bodies, const double* v, const double* a, double* M, double* nle);
  void shift(const std::vector<Six>& x, int joint, double* out) const;

  const std::vector<TreeJoint> joints_;
  std::vector<FlexibleBody>* const flexible_;
  std::vector<int> index_of_frame_;  // indices in joints_ of the joints of the model, then in V_, A_ of nodes
  std::vector<int> swept_;           // indices in joints_ outward, without joints of modes, which move no body
  std::vector<double> links_;        // (joints, 12) poses of massless links
  const InertiaPattern& pattern_;
  const double *gravity_, *armature_;
  std::vector<Six> J_root_;  // (nv,) columns of J about the root's position, to avoid cancellation
  std::vector<Six> V_, A_;   // (joints,) velocities and accelerations about the root's position
  // (joints,) positions relative to the root; reference points of V_, A_
  std::vector<std::array<double, 3>> arms_, references_;
  std::vector<Subtree> subtrees_;
};

}  // namespace mbdae
