// Constraint rows of closures and drivers, and the frame pairs of rows and forces (mbdae/mechanism/closures/rows.py).
#pragma once

#include <map>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "mechanism/contact.hpp"
#include "math/factorizations.hpp"
#include "mechanism/multibody_tree.hpp"
#include "mechanism/profiles.hpp"
#include "mechanism/time_functions.hpp"

namespace mbdae {

struct Anchor {
  int joint = 0;
  double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // by rows
  double p[3] = {0, 0, 0};
  bool is_identity = false;  // R = 1

  FIELDS(joint, R, p)
};

// Two anchors, and the columns of J that move them: +1 where a joint moves b alone, -1 where it moves a alone.
struct Pair {
  Pair(const Anchor& a, const Anchor& b, const std::vector<MultibodyTree::Support>& supports);

  void update_poses(const MultibodyTree& m) {  // Ra, pa, Rb, pb in the world, at the current poses
    if (pose_stamp_ != m.pose_stamp()) update_frames(m);
  }
  // Va, Vb, and A, the relative acceleration for v' = 0; minus_gravity: from `MultibodyTree::bias_minus_gravity`, where
  // gravity cancels.
  void update_velocities(const MultibodyTree& m, bool minus_gravity);
  void relative(const MultibodyTree& m, const double* v, double* out) const;                    // V_b - V_a, (6,)
  // tau += factor J^T w
  void generalized_force(const MultibodyTree& m, const double* w, double factor, double* tau) const;

  Anchor a, b;
  bool needs_Ra = true, needs_Rb = true;  // whether Ra, Rb are used
  // Velocities that move a or b, in increasing order, including common ancestors; repeated where a mode moves both by
  // different columns of J.
  std::vector<int> columns;
  std::vector<int> sources;                               // column of J of each velocity
  std::vector<double> sign;                               // sign of each velocity; 0 for common ancestors
  bool has_repeated_columns;                              // whether a velocity is repeated
  double Ra[9], Rb[9], pa[3], pb[3], Va[6], Vb[6], A[6];  // rotations by rows

  // Contact of the rows of a pair, which have the same shape; and its derivative along the motion V_b - V_a of b.
  const Contact<double>& contact(const Shape& s) const;
  const Contact<Dual<1>>& moving_contact(const Shape& s) const;

 private:
  void update_frames(const MultibodyTree& m);

  long pose_stamp_ = -1;  // MultibodyTree::pose_stamp of the last update
  mutable bool contact_current_ = false, moving_contact_current_ = false;
  mutable Contact<double> contact_;
  mutable Contact<Dual<1>> moving_contact_;
};

struct WrenchPartials;

double unit_gap(const Pair& pair, double* n);  // distance, and the unit vector from a to b

struct RowFunction {  // Python, of the coordinates of some joints with n velocities
  std::vector<int> iq, iv;
  std::function<void(const double* q, Vector& out)> value, partials;  // g and G (n,), and dG/dq (n, n)
  std::function<double(const double* q, const double* v)> bias;        // Gdot v

  FIELDS(iq, iv)
};

struct RowJoint {  // a joint with one velocity: first coordinate, number of coordinates, index of the velocity
  int iq, nq, iv;

  FIELDS(iq, nq, iv)
};

struct Row {
  NAMED_ENUM(enum, Kind, dot_product_1, dot_product_2, distance, coordinate, curved, sum, function, ratio, height, grip,
             knife_edge, gear, bevel, screw, roller, flat_face)
  Kind kind = distance;
  bool positional = true;  // constrains positions by g = 0; otherwise velocities alone
  int pair = -1;
  bool has_a = false, has_b = false;
  double a[3] = {0, 0, 0}, b[3] = {0, 0, 0};  // axes fixed in a and b
  double length = 0;        // or lead of a screw, ratio of a gear, radius of a roller or of bevel wheel a
  double other_length = 0;  // radius of bevel wheel b
  Shape shape;              // shape of the rolling body
  std::shared_ptr<const Profile> profile;  // in contact with a roller or a flat face
  double direction[2] = {0, 0};            // direction of a no-slip row, longitudinal and lateral
  std::vector<RowJoint> joints;               // joints of a row between joints
  std::vector<double> c;                      // coefficients of its polynomial, or its factors
  TimeFunction law;                           // motion law of a `curved` row
  std::shared_ptr<const RowFunction> python;  // Python function of a `function` row
  // start, length and increase of a period of the law; length 0: not periodic
  double fold[3] = {0, 0, 0};
  double period = 0;                          // period of g
  std::vector<int> columns;                   // where G may be nonzero, with all ancestors, in increasing order
  std::vector<int> entries;                   // positions in `columns` of the velocities of a row between joints

  double wrench(const Pair& pair, double* w) const;                // g, and the wrench on b, (6,)
  double rate(const Pair& pair) const;                             // Gdot v
  void partials(const Pair& pair, WrenchPartials& t) const;        // the wrench, Da and Db
  bool along_line() const { return kind >= height; }
  bool between_joints() const { return kind >= coordinate && kind <= ratio; }
  double coordinate_entries(const double* q, double* out) const;   // g, and entries of G in `columns`
  double coordinate_bias(const double* q, const double* v) const;  // Gdot v
  // Adds lam d(G^T)/dq to K (nv, nv) and d(G v)/dq to B (nv,), unless they are null.
  void coordinate_partials(const double* q, const double* v, double lam, double* K, double* B, size_t width) const;

  FIELDS(kind, positional, pair, a, b, length, other_length, shape, profile, direction, joints, c, law, fold, period)

 private:
  double wrench_along_line(const Pair& pair, double* w) const;
  double coordinate_value(const double* q, double* first) const;       // g, and -dg/dx_j
  double reduced_coordinate(const double* q, double* increase) const;  // x_j reduced to the period of the law
  double bias_coefficient(const double* q) const;      // p''(x_j), or r'(x_k)
};

struct RowKind {
  const char* required;  // fields of a row of this kind
  bool positional = true;
};

inline const std::map<Row::Kind, RowKind> ROW_KINDS = {{Row::dot_product_1, {"pair, a, b"}},
                                                       {Row::dot_product_2, {"pair, a"}},
                                                       {Row::distance, {"pair, length"}},
                                                       {Row::coordinate, {"joints, c, period"}},
                                                       {Row::curved, {"joints, c, period, law, fold"}},
                                                       {Row::sum, {"joints, c, period"}},
                                                       {Row::function, {"positional"}},
                                                       {Row::ratio, {"joints, c, period", false}},
                                                       {Row::height, {"pair, shape"}},
                                                       {Row::grip, {"pair, shape, direction", false}},
                                                       {Row::knife_edge, {"pair, b", false}},
                                                       {Row::gear, {"pair, a, length", false}},
                                                       {Row::bevel, {"pair, a, b, length, other_length", false}},
                                                       {Row::screw, {"pair, a, length", false}},
                                                       {Row::roller, {"pair, length, profile"}},
                                                       {Row::flat_face, {"pair, b, profile"}}};

struct Driver {
  int row;
  bool length, speed;  // length: of a distance, u > 0; speed: the motion prescribes u' alone
  TimeFunction motion;

  FIELDS(row, length, speed, motion)
};

// The constraint rows of a mechanism, evaluated at the current kinematics of its tree.
class Constraints {
 public:
  Constraints(const MultibodyTree& m, std::vector<Row> rows, const std::vector<std::pair<Anchor, Anchor>>& pairs,
              std::vector<Driver> drivers);

  bool has_structure_of(const Constraints& other) const;  // rows of the same kinds between the same joints
  // copy the parameters of rows of the same structure; addresses of pairs stay valid
  void write(Constraints other);

  std::vector<Pair> pairs;
  std::vector<Row> rows;  // (ng,)
  std::vector<int> all;   // (ng,) 0, 1, ...
  size_t nv;
  std::vector<size_t> start;  // (ng + 1,) first entry of each row in G, which stores the entries in `columns`
  std::vector<std::vector<int>> rows_of_pair;  // rows of each pair
  std::vector<Driver> drivers;
  std::vector<bool> inactive;  // (ng,) rows that are inactive in the mode, all of whose terms are zero; empty: none
  bool has_sticking_joints = false;

  // Write the entries of G of some rows to G + start[row], and g if requested.
  void value(const MultibodyTree& m, const double* q, const std::vector<int>& selected, double* G, double* g = nullptr);
  // Write them to a dense G (ng, nv), which must be zero outside the columns of rows; an empty one is allocated.
  void dense_value(const MultibodyTree& m, const double* q, const std::vector<int>& selected, Vector& G,
                   double* g = nullptr);
  void expand(int row, const double* entries, double* out) const {  // entries of G or Z, into their columns of (nv,)
    const double* entry = entries + start[row];
    for (int c : rows[row].columns) out[c] = *entry++;
  }
  Vector dense(const Vector& entries) const;                     // (ng, nv)
  void dense(const std::vector<int>& selected, const Vector& entries, Vector& out) const;  // some rows, (n, nv)
  double times(int row, const Vector& entries, const double* x, double s = 0) const {  // s + row times x (nv,)
    const double* entry = entries.data() + start[row];
    for (int c : rows[row].columns) s += *entry++ * x[c];
    return s;
  }
  void add(int row, const Vector& entries, double factor, double* out) const {  // out (nv,) += factor row
    const double* entry = entries.data() + start[row];
    for (int c : rows[row].columns) out[c] += *entry++ * factor;
  }
  struct CommonRun {  // n consecutive entries in the same columns of two rows, from entries k and l on
    int k, l, n;
  };
  std::vector<CommonRun> common(int k, int l) const;          // all common columns of two rows
  double product(int k, int l, const double* entries) const;  // product of two rows
  void complete_g(double t, double* g) const;  // g -= u, reduced by periods
  // Gdot v of some rows, at the current motions; minus_gravity: those of `MultibodyTree::bias`.
  void bias(const MultibodyTree& m, const double* q, const double* v, const std::vector<int>& selected, double* out,
            bool minus_gravity = false);
  void evaluate_g_t(double t, double* g_t) const;    // -u', (ng,)
  void evaluate_g_tt(double t, double* g_tt) const;  // -u'', (ng,)

 private:
  void motion(double t, const Driver& d, double* u) const;

  Vector entries_;  // scratch
};

// Make all rows active for the lifetime of this object.
class AllRowsActive {
 public:
  explicit AllRowsActive(Constraints& constraints) : constraints_(constraints) { inactive_.swap(constraints.inactive); }
  ~AllRowsActive() { inactive_.swap(constraints_.inactive); }
  AllRowsActive(const AllRowsActive&) = delete;

 private:
  Constraints& constraints_;
  std::vector<bool> inactive_;
};

}  // namespace mbdae
