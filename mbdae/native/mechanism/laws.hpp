// Force laws of mbdae/mechanism/forces; each kind is a file in laws/.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "mechanism/wrench_partials.hpp"
#include "mechanism/rows.hpp"
#include "mechanism/time_functions.hpp"

namespace mbdae {

struct Law;

struct Sizes {
  int nq, nv, joints;
};

// Point at which a law is evaluated: the kinematics of m are current at q; s are the states of the law.
struct ForcePoint {
  const MultibodyTree& m;
  double t;
  const double *q, *v, *s;
};

// Outputs of a law: forces, (nv,) each, to which it adds, and s', which it writes.
struct Forces {
  double *conservative, *other, *ds;
};

// A wrench of a law between two frames, and whether it derives from a potential.
struct LawWrench {
  const Pair* pair;
  WrenchPartials partials;
  bool conservative;
};

// d/d(q in the tangent, v, s), in rows of `width` entries: of the conservative and other forces, (nv, width), and of
// s'.
struct LawPartials {
  double *conservative, *other, *ds;
  size_t width;
  int states;  // the column of the law's first state
  std::vector<LawWrench>* wrenches = nullptr;  // filled if requested

  // Add the partials of a wrench between the frames of a pair.
  void add(const PairPartials& pair_partials, const WrenchPartials& t, bool conservative) const;
};

// The functions that a file of laws/ defines. Implicit methods, equilibria and gradients use the partials of every law:
// a kind without partials does not compile.
struct LawKind {
  using IsValid = bool (*)(Law& law, const Sizes& n);  // whether its data are valid; may precompute terms
  using Add = void (*)(const Law& law, const ForcePoint& p, const Forces& f);
  using Partials = void (*)(const Law& law, const ForcePoint& p, const LawPartials& out);  // partials of `add`
  using Potential = double (*)(const Law& law, const ForcePoint& p);  // in J; a function of q alone

  constexpr LawKind(IsValid is_valid, Add add, Partials partials, Potential potential = nullptr,
                    Add time_rate = nullptr)
      : is_valid(is_valid), add(add), partials(partials), potential(potential), time_rate(time_rate) {}
  LawKind(IsValid, Add) = delete;
  LawKind(IsValid, Add, std::nullptr_t, Potential = nullptr) = delete;

  IsValid is_valid;
  Add add;
  Partials partials;
  Potential potential;
  Add time_rate;  // time derivative of `add`; nullptr: does not depend on t
};

// The kind that the file of this name in laws/ defines; nullptr: none.
const LawKind* law_kind(const std::string& name);

struct Law {
  struct Term {  // out[to][row] += value * in[from][column]
    int to, row, from, column;
    double value;
  };
  using Call =
      std::function<void(double t, const double* q, const double* v, const double* s, double* tau, double* ds)>;
  // Partials of (tau, s'), (nv + states, 2 nv + states) by rows.
  using Partials = std::function<void(double t, const double* q, const double* v, const double* s, Vector& out)>;

  const LawKind* kind = nullptr;
  std::vector<int> rows, columns;  // indices
  std::vector<int> orders;         // orders of the derivatives of the functions of time
  std::vector<double> a;           // parameters
  std::vector<TimeFunction> signals;  // functions of time
  int pair = -1;                      // index of its frames in the pairs of laws; -1: none
  Pair* frames = nullptr;
  double offset = 0;              // offset of the potential, in J
  int state = 0, states = 0;      // first index of its states in s, and their number
  bool rotating = false;          // its axes rotate with the frame
  bool has_potential = false;
  Call call;                      // Python function
  Partials partials;              // Python function
  Partials time_rate;             // Python function: time derivative of (tau, s'), (nv + states,)
  std::vector<Term> terms;        // precomputed
  mutable std::vector<double> u;  // workspace

  FIELDS(rows, columns, orders, a, signals, pair, offset, state, states, rotating, has_potential)

  // Add to conservative and other (nv,); write s'. The kinematics are current at q.
  void add(const MultibodyTree& m, double t, const double* q, const double* v, const double* s, double* conservative,
           double* other, double* ds) const {
    kind->add(*this, {m, t, q, v, s}, {conservative, other, ds});
  }
};

}  // namespace mbdae
