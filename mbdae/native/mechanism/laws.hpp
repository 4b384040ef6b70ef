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

// Where a law acts: the kinematics of m stand at q; s are its own states.
struct ForcePoint {
  const Mechanics& m;
  double t;
  const double *q, *v, *s;
};

// What a law adds to, (nv,) each, and s', which it writes.
struct Forces {
  double *conservative, *other, *ds;
};

// A wrench between two frames; of a law: whether it derives from a potential.
struct ActingWrench {
  const Pair* pair;
  WrenchPartials turning;
  bool conservative;
};

// Slopes by (q in the tangent, v, s), by rows of `width` numbers: of both parts of tau, (nv, width), and of s'.
struct LawPartials {
  double *conservative, *other, *ds;
  size_t width;
  int states;  // the column of the law's first state
  std::vector<ActingWrench>* wrenches = nullptr;  // where they are asked for, too

  // Add those of a wrench between the frames of a pair.
  void add(const PairPartials& here, const WrenchPartials& t, bool conservative) const;
};

// What a file of laws/ defines. Implicit methods, equilibria and gradients take the derivatives of every law: a kind
// without them does not compile.
struct LawKind {
  using Fits = bool (*)(Law& law, const Sizes& n);  // whether its numbers do; it may work out more
  using Add = void (*)(const Law& law, const ForcePoint& p, const Forces& f);
  using EquationPartials = void (*)(const Law& law, const ForcePoint& p, const LawPartials& out);  // the same of what `add` adds
  using Potential = double (*)(const Law& law, const ForcePoint& p);                   // in J; of q alone

  constexpr LawKind(Fits fits, Add add, EquationPartials slopes, Potential potential = nullptr)
      : fits(fits), add(add), slopes(slopes), potential(potential) {}
  LawKind(Fits, Add) = delete;
  LawKind(Fits, Add, std::nullptr_t, Potential = nullptr) = delete;

  Fits fits;
  Add add;
  EquationPartials slopes;
  Potential potential;
};

// One of the kinds that the files of laws/ define, by the name of the file; nullptr for another name.
const LawKind* law_kind(const std::string& name);

struct Law {
  struct Term {  // out[to][row] += value * in[from][column]
    int to, row, from, column;
    double value;
  };
  using Call =
      std::function<void(double t, const double* q, const double* v, const double* s, double* tau, double* ds)>;
  // Slopes of (tau, s'), (nv + states, 2 nv + states) by rows.
  using EquationPartials = std::function<void(double t, const double* q, const double* v, const double* s, Numbers& out)>;

  const LawKind* kind = nullptr;
  std::vector<int> rows, columns;  // indices
  std::vector<int> orders;         // of derivatives of the signals
  std::vector<double> a;           // numbers
  std::vector<TimeFunction> signals;     // functions of time
  Pair* pair = nullptr;
  bool paired = false;            // whether it has a pair
  double offset = 0;              // of the potential, in J
  int state = 0, states = 0;      // where its states stand in s, and how many there are
  bool turning = false;           // its axes turn with the frame
  bool steady = false;            // it has a potential
  Call call;                      // Python
  EquationPartials slopes;                  // Python, too
  std::vector<Term> terms;        // worked out
  mutable std::vector<double> u;  // workspace

  // Add to conservative and other (nv,); write s'. The kinematics stand at q.
  void add(const Mechanics& m, double t, const double* q, const double* v, const double* s, double* conservative,
           double* other, double* ds) const {
    kind->add(*this, {m, t, q, v, s}, {conservative, other, ds});
  }
};

}  // namespace mbdae
