// A mechanism in index-2 descriptor form and its half-explicit steps; the Python Descriptor and half_explicit_step are
// the specification (mbdae/mechanism/descriptor.py, mbdae/methods/step.py, mbdae/pace.py).
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "laws.hpp"
#include "linear.hpp"
#include "mechanics.hpp"
#include "rows.hpp"

namespace mbdae {

using Numbers = std::vector<double>;

constexpr int LARGE = 32;  // rows: beyond, the choice of rows is looked at when there is reason to

struct Tableau {
  int n = 0;
  bool first = false, project = false;  // explicit first stage; embedded errors are projected
  Numbers A, Ahat, b, c, chat, e;       // (n, n), (n, n), (n,), (n,), (n,), (errors, n)
  int errors = 0, doubled = 0;          // order p of a method controlled by two half steps; 0: an embedded formula
  double noise = 0;                     // rounding of v by which an error estimate exceeds eps |v|
};

struct State {
  Numbers y, carry, low;  // carry and low may be empty
};

struct Counts {
  long f = 0, M = 0, G = 0, solves = 0, factorizations = 0, projections = 0, state_projections = 0;
};

// A block of the tangent map: a spherical, free-flying or planar joint.
struct Block {
  enum Kind { so3, se3, se2 } kind;
  int at;
};

// What a run hands over, and gets back: the state, the pace, and the steps that were taken.
struct Course {
  double t = 0, t1 = 0, sign = 1, stop = 0, end = 0;
  State state;
  bool project = false, adaptive = false, watched = false;
  double seconds = 0.05;
  long budget = 0;  // steps taken or rejected, at most
  // step-size control (mbdae/methods/controller.py)
  double h = 0, largest = 0, cut = 0, last = 1e-4, rtol = 0;
  Numbers atol;  // (1,) or (measured,)
  bool was_rejected = false;
  double power = 1, safety = 0, smallest_factor = 0, largest_factor = 0, beta = 0;
  // fixed steps
  double step = 0, t0 = 0, near = 0, tolerated = 0;
  long n = 0, i = 0;
  bool on_grid = true;
  // the watch for singular configurations
  double usual = 0, before = 0, suspect = 0, landed = 0, zone = 0;

  // results
  Numbers ts, ys, zs, weakest;
  std::vector<std::pair<long, std::vector<int>>> changes;  // after how many steps which rows came into use
  long taken = 0, rejected = 0;
  bool stuck = false;  // the next step is not for the core
};

class Core {
 public:
  Core(const void* model, bool flat, std::vector<Row> rows, std::vector<std::pair<Anchor, Anchor>> pairs,
       std::vector<Driver> drivers, std::vector<Law> laws, std::vector<std::pair<Anchor, Anchor>> law_pairs,
       std::vector<int> pair_of_law, int ns, std::vector<Block> blocks, std::vector<int> turning);

  Mechanics m;
  Constraints constraints;
  int nq, nv, ng, ns, ny, length;  // length of y
  Counts counts;
  int rank = -1;
  double floor = 0;                 // of the ratio of pivots: below, the rank has fallen
  double weakest = 1;
  double widest = 0, fastest = 0;   // largest |g|, and |G v + g_t| / (1 + |v|), over all rows at the ends of steps
  bool interrupted = false;  // a Python function was

  const std::vector<int>& rows() const { return rows_; }
  void use(const std::vector<int>& rows, int rank, double floor, bool held);
  bool settle(double t, State& s);

  void step(const Tableau& tableau, double t, double h, const State& in, State& out, double* z, Numbers& errors);
  // The same with an error estimate for all methods: of two half steps where there is no embedded formula.
  void controlled(const Tableau& tableau, double t, double h, const State& in, State& out, double* z, Numbers& errors);
  void march(const Tableau& tableau, Course& course);
  void derivative(double t, const double* y, double* F, double* z);
  void restore(double t, double* y);
  double ratio(const double* q);                                   // see mbdae/mechanism/singular.py; uncounted
  double bare(const double* q, const double* v, int repetitions);  // see Mechanics::bare

 private:
  // one point: M = U D U^T, G, and Z = D^-1/2 U^-1 G^T
  void inertia(const double* q);
  void evaluate(const double* q, bool counted);
  void half(double* x) const;
  void half(double* x, const std::vector<int>& columns) const;
  void back(double* x) const;
  void forces(double t, const double* q, const double* v, const double* s, double* f, double* rates);
  void assemble(const double* Zhat);
  void solve(const double* Zhat, double* rhs, double* f);
  void symmetric();
  void own(const double* lam, double* z);
  bool choose();  // are other rows in use now?
  bool choose_all();
  void normal(Numbers& by_row, double* out);
  void probe();
  bool fallen() const;  // the rows in use are much worse than they were
  void set_rows(std::vector<int> rows);
  bool at_last(const double* q) const;

  // the step
  void stage(double t, const double* x, double that, const double* xhat, double factor, double* F, double* lam,
             bool last);
  void tangent(const double* x, double* dx) const;
  void within(const double* x) const;
  void integrate(const double* q, const double* x, double* out);
  void add(const double* y, const double* x, double* out);
  void difference(const double* y0, const double* y1, double* out);
  void size(const double* y, double* out);
  void smallest(const double* r, double* x);

  // the course
  int measured() const { return constraints.drivers.empty() ? ny - 1 : ny; }
  bool propose(Course& c, double& h, double& t_next);
  double error(const Course& c, const double* e, int errors, const double* size0, const double* size1,
               double noise) const;
  double next_step(Course& c, double h, double err) const;
  bool landing(const Course& c, const State& next);

  bool flat_, large_;
  std::vector<Pair> law_pairs_;
  std::vector<Law> laws_;
  std::vector<Block> blocks_;
  std::vector<int> turning_, all_, rows_, position_, dropped_;
  std::vector<std::vector<int>> neighbours_;
  bool chosen_ = false, held_ = false, stands_ = false, suspicious_ = false;
  double best_ = 0, now_ = 0;
  Numbers last_q_, U_, root_, G_, Z_, Ghat_, Zhat_, g_, gt_, gthat_, F_, q_, v_, s_, qhat_, q0_, v0_, s0_, f_, dx_, x_,
      xhat_, conservative_, other_, lam_, lam_work_, gap_, work_, diag_, neutral_, probe_, tmp_;
  struct Entry {
    int i, j;
    double s;
  };
  std::vector<Entry> cross_;
  Numbers own_[5];
  std::vector<int> order_, spare_;
  int stride_ = 0;
  BandLU lu_;
};

}  // namespace mbdae
