// Rows of closures and drivers, and the frames between which they and forces act (mbdae/mechanism/closures/rows.py).
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "mechanism/contact.hpp"
#include "math/factorizations.hpp"
#include "mechanism/mechanics.hpp"
#include "mechanism/profiles.hpp"
#include "mechanism/time_functions.hpp"

namespace mbdae {

struct Anchor {
  int joint = 0;
  double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // by rows
  double p[3] = {0, 0, 0};
  bool straight = false;  // R = 1
};

// Two anchors, and the columns of J that move them: +1 where a joint moves b alone, -1 where it moves a alone.
struct Pair {
  Pair(const Anchor& a, const Anchor& b, const std::vector<std::vector<int>>& supports);

  void locate(const Mechanics& m);  // Ra, pa, Rb, pb in the world, where poses stand
  // Va, Vb, and A, the relative acceleration for v' = 0; falling: of `Mechanics::falling`, in which gravity cancels.
  void twist(const Mechanics& m, bool falling);
  void relative(const Mechanics& m, const double* v, double* out) const;                    // V_b - V_a, (6,)
  void torque(const Mechanics& m, const double* wrench, double factor, double* tau) const;  // tau += factor J^T w

  Anchor a, b;
  bool turns_a = true, turns_b = true;  // Ra, Rb are asked for
  std::vector<int> columns;             // that move a or b, in rising order, common ancestors included
  std::vector<double> sign;             // of each of them; 0 for common ancestors
  double Ra[9], Rb[9], pa[3], pb[3], Va[6], Vb[6], A[6];  // rotations by rows

  const ContactKinematics& touch(const Shape& s, bool moving) const;  // for the rows of a pair, which have one shape

 private:
  long located_ = -1;  // Mechanics::placed where it was
  enum Known { nothing, places, rates };
  mutable Known known_ = nothing;
  mutable ContactKinematics touch_;
};

struct WrenchPartials;

double unit_gap(const Pair& pair, double* n);  // distance, and the unit vector from a to b

struct Row {
  enum Kind {
    dot_product_1, dot_product_2, distance, coordinate, curved, sum, ratio,
    height, grip, knife_edge, gear, bevel, screw, roller, flat_face
  } kind = distance;
  bool positional = true;  // there is a g; else it is 0
  int pair = -1;
  bool has_a = false, has_b = false;
  double a[3] = {0, 0, 0}, b[3] = {0, 0, 0};  // axes fixed in a and b
  double length = 0;        // or lead of a screw, share of a gear, radius of a roller or of a's bevel wheel
  double other_length = 0;  // radius of b's bevel wheel
  Shape shape;              // of what rolls
  std::shared_ptr<const Profile> profile;  // of what a roller or a flat face touches
  double share[2] = {0, 0};  // of the tangents ahead and to the left in a row of grip
  int iq[3] = {-1, -1, -1}, iv[3] = {-1, -1, -1}, nq[3] = {1, 1, 1};  // joints of a row between joints; -1: missing
  std::vector<double> c;                                              // its polynomial
  std::vector<std::array<int, 3>> others;  // iq, nq, iv of the joints of a sum but for the first
  TimeFunction law;                              // of a curved row
  double fold[3] = {0, 0, 0};              // start, length and rise of its period; length 0 without one
  double period = 0;
  std::vector<int> columns;  // where G may differ from 0, and all their ancestors, in rising order

  double wrench(const Pair& pair, double* w) const;                // g, and the wrench on b, (6,)
  double rate(const Pair& pair) const;                             // Gdot v
  void slopes(const Pair& pair, WrenchPartials& t) const;                 // the wrench, Da and Db
  bool between_joints() const { return kind >= coordinate && kind <= ratio; }
  double coordinate_value(const double* q, double* slope) const;   // g, and what v_j is multiplied by
  double coordinate_bias(const double* q, const double* v) const;  // Gdot v
  // Adds lam d(G^T)/dq to K (nv, nv) and d(G v)/dq to B (nv,), where they are there.
  void coordinate_slopes(const double* q, const double* v, double lam, double* K, double* B, size_t width) const;

 private:
  double folded(const double* q, double* rise) const;  // where x_j stands in a period of the law
  double curvature(const double* q) const;  // p''(x_j), or r'(x_k)
};

struct RowKind {  // and what it has: an axis in a, an axis in b, a length
  Row::Kind kind;
  bool a, b, length, positional = true;
};

inline const std::map<std::string, RowKind> ROW_KINDS = {
    {"dot_product_1", {Row::dot_product_1, true, true, false}},
    {"dot_product_2", {Row::dot_product_2, true, false, false}},
    {"distance", {Row::distance, false, false, true}},
    {"coordinate", {Row::coordinate, false, false, false}},
    {"curved", {Row::curved, false, false, false}},
    {"sum", {Row::sum, false, false, false}},
    {"ratio", {Row::ratio, false, false, false, false}},
    {"height", {Row::height, false, false, false}},
    {"grip", {Row::grip, false, false, false, false}},
    {"knife_edge", {Row::knife_edge, false, true, false, false}},
    {"gear", {Row::gear, true, false, true, false}},
    {"bevel", {Row::bevel, true, true, true, false}},
    {"screw", {Row::screw, true, false, true, false}},
    {"roller", {Row::roller, false, false, true}},
    {"flat_face", {Row::flat_face, false, true, false}}};

struct Driver {
  int row;
  bool length, speed;  // a distance, which is positive; the motion is u', and there is no u
  TimeFunction motion;
};

// All rows of a mechanism, where the kinematics of its workspace stand.
class Constraints {
 public:
  Constraints(const Mechanics& m, std::vector<Row> rows, const std::vector<std::pair<Anchor, Anchor>>& pairs,
              std::vector<Driver> drivers);

  std::vector<Pair> pairs;
  std::vector<Row> rows;  // (ng,)
  std::vector<int> all;   // (ng,) 0, 1, ...
  std::vector<std::vector<int>> of_pair;  // rows of each pair
  std::vector<Driver> drivers;
  std::vector<bool> off;  // (ng,) rows that the mode leaves out: zero, with all that belongs to them; empty: none
  bool sticks = false;    // joints stick in the mode: they stand still

  // Entries of G for some rows, into G + row * nv (zero outside row.columns), and g where asked for.
  void value(const Mechanics& m, const double* q, const std::vector<int>& which, double* G, double* g = nullptr);
  void gaps(double t, double* g) const;  // g -= u, periods taken off
  // Gdot v of some rows, where the motions stand; falling: as `Mechanics::bias` leaves them.
  void bias(const Mechanics& m, const double* q, const double* v, const std::vector<int>& which, double* out,
            bool falling = false);
  void speed(double t, double* g_t) const;          // -u', (ng,)
  void acceleration(double t, double* g_tt) const;  // -u'', (ng,)

 private:
  void motion(double t, const Driver& d, double* u) const;
};

}  // namespace mbdae
