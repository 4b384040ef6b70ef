// Force laws, as the files of mbdae/mechanism/forces define them; each kind is a file of laws/.
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

// Outputs: terms added to (nv,) each, and s', which is written.
struct Forces {
  double *conservative, *other, *ds;
};

// A wrench between two frames; for a law: whether it derives from a potential.
struct ActingWrench {
  const Pair* pair;
  WrenchPartials partials;
  bool conservative;
};

// d/d(q in the tangent, v, s), by rows of `width` numbers: of both parts of tau, (nv, width), and of s'.
struct LawPartials {
  double *conservative, *other, *ds;
  size_t width;
  int states;  // the column of the law's first state
  std::vector<ActingWrench>* wrenches = nullptr;  // filled if requested

  // Add the partials of a wrench between the frames of a pair.
  void add(const PairPartials& here, const WrenchPartials& t, bool conservative) const;
};

// Definitions in a file of laws/. Implicit methods, equilibria and gradients use the derivatives of every law: a kind
// without them does not compile.
struct LawKind {
  using IsValid = bool (*)(Law& law, const Sizes& n);  // whether its data are valid; may precompute
  using Add = void (*)(const Law& law, const ForcePoint& p, const Forces& f);
  using EquationPartials = void (*)(const Law& law, const ForcePoint& p, const LawPartials& out);  // the partials of `add`
  using Potential = double (*)(const Law& law, const ForcePoint& p);                   // in J; of q alone

  constexpr LawKind(IsValid is_valid, Add add, EquationPartials partials, Potential potential = nullptr,
                    Add time_rate = nullptr)
      : is_valid(is_valid), add(add), partials(partials), potential(potential), time_rate(time_rate) {}
  LawKind(IsValid, Add) = delete;
  LawKind(IsValid, Add, std::nullptr_t, Potential = nullptr) = delete;

  IsValid is_valid;
  Add add;
  EquationPartials partials;
  Potential potential;
  Add time_rate;  // time derivative of `add`; nullptr: does not depend on t
};

// A kind defined in a file of laws/, by the name of the file; nullptr for another name.
const LawKind* law_kind(const std::string& name);

struct Law {
  struct Term {  // out[to][row] += value * in[from][column]
    int to, row, from, column;
    double value;
  };
  using Call =
      std::function<void(double t, const double* q, const double* v, const double* s, double* tau, double* ds)>;
  // Partials of (tau, s'), (nv + states, 2 nv + states) by rows.
  using EquationPartials = std::function<void(double t, const double* q, const double* v, const double* s, Vector& out)>;

  const LawKind* kind = nullptr;
  std::vector<int> rows, columns;  // indices
  std::vector<int> orders;         // of derivatives of the signals
  std::vector<double> a;           // numbers
  std::vector<TimeFunction> signals;  // functions of time
  int pair = -1;                      // its frames, of the pairs of laws; -1: none
  Pair* frames = nullptr;
  double offset = 0;              // of the potential, in J
  int state = 0, states = 0;      // first index of its states in s, and their number
  bool rotating = false;          // its axes rotate with the frame
  bool has_potential = false;
  Call call;                      // Python
  EquationPartials partials;      // Python
  EquationPartials time_rate;     // Python, of (tau, s'), (nv + states,)
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
