// The Python module mbdae._native. No type of Pinocchio is seen here: this file compiles in seconds.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <initializer_list>
#include <thread>

#include "description.hpp"
#include "model.hpp"

using namespace mbdae;

namespace {

Numbers numbers(const Array& x, size_t n, const char* name) {
  if (x.size() != n)
    refuse(std::string(name) + " has " + std::to_string(x.size()) + " numbers, expected " + std::to_string(n));
  return Numbers(x.data(), x.data() + n);
}

nb::object array(const Numbers& x, std::initializer_list<size_t> shape) {
  auto* data = new Numbers(x);
  nb::capsule owner(data, [](void* p) noexcept { delete static_cast<Numbers*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, double>(data->data(), shape, owner));
}

nb::object vector(const Numbers& x) { return array(x, {x.size()}); }

struct PyCore {
  PyCore(nb::handle model_, bool flat, const nb::list& pair_list, const nb::list& row_list, const nb::list& driver_list,
         const nb::list& law_pair_list, const nb::list& law_list, int ns, const nb::list& block_list,
         std::vector<int> turning)
      : model(nb::borrow(model_)), callbacks(new Callbacks) {
    const void* m = model_pointer(model_.ptr());
    const auto size = model_sizes(m);
    const Sizes n{size[0], size[1], size[2]};
    if (ns < 0 || ns > 1000000 || static_cast<int>(turning.size()) != n.nv) refuse("sizes do not fit the model");
    if (flat && n.nq != n.nv) refuse("a flat manifold has nq = nv");
    auto closure_pairs = pairs(pair_list, n.joints), force_pairs = pairs(law_pair_list, n.joints);
    std::vector<Row> rows;
    for (nb::handle h : row_list) rows.push_back(row(nb::cast<nb::dict>(h), n, static_cast<int>(closure_pairs.size())));
    std::vector<Driver> drivers;
    for (nb::handle h : driver_list) {
      auto d = nb::cast<nb::dict>(h);
      const int at = get<int>(d, "row");
      within({at}, static_cast<int>(rows.size()), "row");
      drivers.push_back({at, get<bool>(d, "length"), signal(nb::cast<nb::dict>(d["motion"]), *callbacks)});
    }
    std::vector<Law> laws;
    std::vector<int> pair_of;
    for (nb::handle h : law_list) {
      int pair;
      laws.push_back(law(nb::cast<nb::dict>(h), n, ns, static_cast<int>(force_pairs.size()), pair, *callbacks));
      pair_of.push_back(pair);
    }
    static const std::map<std::string, Block::Kind> kinds = {
        {"so3", Block::so3}, {"se3", Block::se3}, {"se2", Block::se2}};
    std::vector<Block> blocks;
    for (nb::handle h : block_list) {
      auto x = nb::cast<std::pair<std::string, int>>(h);
      const Block b{kind(kinds, x.first), x.second};
      within({b.at, b.at + (b.kind == Block::se3 ? 5 : 2)}, n.nv, "block");
      blocks.push_back(b);
    }
    core.reset(new Core(m, flat, rows, closure_pairs, drivers, laws, force_pairs, pair_of, ns, blocks, turning));
  }

  void check(const State& s, const Tableau& t) const {
    if (static_cast<int>(s.y.size()) != core->length) refuse("y has the wrong length");
    if (t.first && static_cast<int>(s.carry.size()) != core->ny - core->nv)
      refuse("the method needs a carried derivative");
    if (!s.low.empty() && static_cast<int>(s.low.size()) != core->ny) refuse("low has the wrong length");
  }

  nb::object model;   // kept alive
  bool busy = false;  // read and written under the interpreter's lock
  std::thread::id owner;
  std::unique_ptr<Callbacks> callbacks;
  std::unique_ptr<Core> core;
};

// A core computes one thing at a time: other threads wait, and a force law that it has called cannot call it.
struct Turn {
  explicit Turn(PyCore& c) : busy(c.busy) {
    while (busy) {
      if (c.owner == std::this_thread::get_id())
        throw std::runtime_error("the core is in use: bind a workspace of its own by Mechanism.system()");
      nb::gil_scoped_release release;
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    busy = true, c.owner = std::this_thread::get_id();
  }
  ~Turn() { busy = false; }
  bool& busy;
};

int traverse(PyObject* self, visitproc visit, void* arg) {
  Py_VISIT(Py_TYPE(self));
  if (!nb::inst_ready(self)) return 0;
  const auto* core = nb::inst_ptr<PyCore>(self);
  for (const nb::object& f : core->callbacks->functions) Py_VISIT(f.ptr());
  return 0;
}

int clear(PyObject* self) {
  if (!nb::inst_ready(self)) return 0;
  nb::inst_ptr<PyCore>(self)->core.reset();
  std::vector<nb::object>().swap(nb::inst_ptr<PyCore>(self)->callbacks->functions);
  return 0;
}

PyType_Slot collected[] = {
    {Py_tp_traverse, reinterpret_cast<void*>(traverse)}, {Py_tp_clear, reinterpret_cast<void*>(clear)}, {0, nullptr}};

Tableau make_tableau(const Array& A, const Array& Ahat, const Array& b, const Array& c, const Array& chat,
                     const Array& e, bool first, bool project, int doubled, double noise) {
  Tableau t;
  t.n = static_cast<int>(b.size());
  const size_t n = t.n;
  if (!n) refuse("a tableau has stages");
  t.A = numbers(A, n * n, "A"), t.Ahat = numbers(Ahat, n * n, "Ahat"), t.b = numbers(b, n, "b");
  t.c = numbers(c, n, "c"), t.chat = numbers(chat, n, "chat");
  if (e.size() % n || e.size() / n > 2) refuse("error weights: none, one or two rows of as many numbers as stages");
  t.errors = static_cast<int>(e.size() / n);
  t.e = numbers(e, e.size(), "e");
  t.first = first, t.project = project, t.doubled = doubled;
  for (const Numbers* x : {&t.A, &t.Ahat, &t.b, &t.c, &t.chat, &t.e})
    for (double v : *x)
      if (!std::isfinite(v)) refuse("a tableau is finite");
  for (size_t i = 0; i < n; ++i)
    for (size_t j = i; j < n; ++j)
      if (t.A[i * n + j] != 0 || (j > i && t.Ahat[i * n + j] != 0))
        refuse("A is strictly lower triangular, Ahat lower");
  for (size_t i = first; i < n; ++i)
    if (t.Ahat[i * n + i] == 0) refuse("Ahat has a regular diagonal");
  if (!(noise >= 0) || !std::isfinite(noise)) refuse("noise is finite and not negative");
  t.noise = noise;
  if (doubled < 0) refuse("an order is not negative");
  return t;
}

State state(const Array& y, const nb::object& carry, const nb::object& low) {
  State s;
  s.y = numbers(y, y.size(), "y");
  for (auto [from, to] : {std::pair<const nb::object&, Numbers&>(carry, s.carry), {low, s.low}})
    if (!from.is_none()) {
      auto x = nb::cast<Array>(from);
      to.assign(x.data(), x.data() + x.size());
    }
  return s;
}

nb::object maybe(const Numbers& x) { return x.empty() ? nb::none() : vector(x); }

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "The compiled core of mbdae.";
  m.def("version", [] { return MBDAE_PINOCCHIO_VERSION; }, "Version of Pinocchio that the core was built for.");

  nb::class_<Tableau>(m, "Tableau", "Coefficients of a half-explicit method.")
      .def(
          "__init__",
          [](Tableau* self, const Array& A, const Array& Ahat, const Array& b, const Array& c, const Array& chat,
             const Array& e, bool first, bool project, int doubled, double noise) {
            new (self) Tableau(make_tableau(A, Ahat, b, c, chat, e, first, project, doubled, noise));
          },
          nb::arg("A"), nb::arg("Ahat"), nb::arg("b"), nb::arg("c"), nb::arg("chat"), nb::arg("e"), nb::arg("first"),
          nb::arg("project"), nb::arg("doubled"), nb::arg("noise"));

  nb::class_<Counts>(m, "Counts", "Work done so far.")
      .def_ro("f", &Counts::f)
      .def_ro("M", &Counts::M)
      .def_ro("G", &Counts::G)
      .def_ro("solves", &Counts::solves)
      .def_ro("factorizations", &Counts::factorizations)
      .def_ro("projections", &Counts::projections)
      .def_ro("state_projections", &Counts::state_projections);

  auto course =
      nb::class_<Course>(m, "Course", "A run's state and pace, and the steps that were taken.").def(nb::init<>());
#define FIELD(name) course.def_rw(#name, &Course::name)
  FIELD(t), FIELD(t1), FIELD(sign), FIELD(stop), FIELD(end), FIELD(project), FIELD(adaptive), FIELD(watched);
  FIELD(seconds), FIELD(budget), FIELD(h), FIELD(largest), FIELD(cut), FIELD(last), FIELD(rtol), FIELD(atol);
  FIELD(was_rejected), FIELD(power), FIELD(safety), FIELD(smallest_factor), FIELD(largest_factor), FIELD(beta);
  FIELD(step), FIELD(t0), FIELD(near), FIELD(tolerated), FIELD(n), FIELD(i), FIELD(on_grid);
  FIELD(usual), FIELD(before), FIELD(suspect), FIELD(landed), FIELD(zone);
  FIELD(changes), FIELD(taken), FIELD(rejected), FIELD(stuck);
#undef FIELD
  course.def(
      "begin",
      [](Course& c, const Array& y, const nb::object& carry, const nb::object& low) { c.state = state(y, carry, low); },
      nb::arg("y"), nb::arg("carry").none(), nb::arg("low").none(), "Set the state.");
  course.def(
      "state",
      [](const Course& c) { return nb::make_tuple(vector(c.state.y), maybe(c.state.carry), maybe(c.state.low)); },
      "Return y, carry and low.");
  course.def(
      "steps",
      [](const Course& c) {
        const size_t n = c.ts.size();
        return nb::make_tuple(vector(c.ts), array(c.ys, {n, n ? c.ys.size() / n : 0}),
                              array(c.zs, {n, n ? c.zs.size() / n : 0}), vector(c.weakest));
      },
      "Return t (n,), y (n, ...), z (n, ng) and the smallest ratios of pivots (n,) of the steps taken.");

  nb::class_<PyCore>(m, "Core", nb::type_slots(collected), "A mechanism in a workspace of its own.")
      .def(nb::init<nb::handle, bool, const nb::list&, const nb::list&, const nb::list&, const nb::list&,
                    const nb::list&, int, const nb::list&, std::vector<int>>(),
           nb::arg("model"), nb::arg("flat"), nb::arg("pairs"), nb::arg("rows"), nb::arg("drivers"),
           nb::arg("law_pairs"), nb::arg("laws"), nb::arg("ns"), nb::arg("blocks"), nb::arg("turning"))
      .def_prop_ro("rows", [](const PyCore& c) { return c.core->rows(); })
      .def_prop_ro("rank", [](const PyCore& c) { return c.core->rank; })
      .def_prop_ro("counts", [](const PyCore& c) { return c.core->counts; })
      .def_prop_rw(
          "weakest", [](const PyCore& c) { return c.core->weakest; }, [](PyCore& c, double x) { c.core->weakest = x; })
      .def(
          "use",
          [](PyCore& c, const std::vector<int>& rows, int rank, double floor, bool held) {
            const Turn turn(c);
            within(rows, c.core->ng, "row");
            if (rank != static_cast<int>(rows.size()) || !std::is_sorted(rows.begin(), rows.end()) ||
                std::adjacent_find(rows.begin(), rows.end()) != rows.end())
              refuse("rows are sorted, different, and as many as the rank");
            c.core->use(rows, rank, floor, held);
          },
          nb::arg("rows"), nb::arg("rank"), nb::arg("floor"), nb::arg("held"),
          "Say which rows are in use, below which ratio of pivots the rank has fallen, and whether rows stay.")
      .def_prop_ro("widest", [](const PyCore& c) { return c.core->widest; })
      .def_prop_ro("fastest", [](const PyCore& c) { return c.core->fastest; })
      .def(
          "settle",
          [](PyCore& c, double t, const Array& y, const nb::object& carry) -> nb::object {
            const Turn turn(c);
            State s = state(y, carry, nb::none());
            if (static_cast<int>(s.y.size()) != c.core->length) refuse("y has the wrong length");
            if (!s.carry.empty() && static_cast<int>(s.carry.size()) != c.core->ny - c.core->nv)
              refuse("carry has the wrong length");
            c.callbacks->interrupted = false;
            try {
              const bool changed = c.core->settle(t, s);
              return nb::make_tuple(changed, vector(s.y), maybe(s.carry));
            } catch (const Trouble&) {
              if (c.callbacks->interrupted) throw nb::python_error();
              return nb::none();
            }
          },
          nb::arg("t"), nb::arg("y"), nb::arg("carry").none(),
          "Choose the rows of the next step: say whether others are taken, and return y and carry, or None.")
      .def(
          "step",
          [](PyCore& c, const Tableau& tableau, double t, double h, const Array& y, const nb::object& carry,
             const nb::object& low) -> nb::object {
            const Turn turn(c);
            State in = state(y, carry, low), out;
            c.check(in, tableau);
            Numbers z(c.core->ng), errors;
            c.callbacks->interrupted = false;
            try {
              c.core->step(tableau, t, h, in, out, z.data(), errors);
            } catch (const Trouble&) {
              if (c.callbacks->interrupted) throw nb::python_error();
              return nb::none();
            }
            return nb::make_tuple(vector(out.y), maybe(out.carry), maybe(out.low), vector(z),
                                  array(errors, {errors.size() / c.core->ny, static_cast<size_t>(c.core->ny)}));
          },
          nb::arg("tableau"), nb::arg("t"), nb::arg("h"), nb::arg("y"), nb::arg("carry").none(), nb::arg("low").none(),
          "Return y, carry, low, z and errors after one step; None where it cannot be taken.")
      .def(
          "march",
          [](PyCore& c, const Tableau& tableau, Course& course) {
            const Turn turn(c);
            c.check(course.state, tableau);
            const size_t m = c.core->ny - c.core->constraints.drivers.empty();
            if (course.adaptive && course.atol.size() != 1 && course.atol.size() != m)
              refuse("atol has the wrong length");
            if (course.adaptive && !tableau.doubled && !tableau.errors) refuse("the tableau has no error estimate");
            course.ts.clear(), course.ys.clear(), course.zs.clear(), course.weakest.clear();
            course.changes.clear(), course.taken = course.rejected = 0, course.stuck = false;
            c.callbacks->interrupted = false;
            {
              nb::gil_scoped_release release;  // other threads may go on; not for single points, which take less
              c.core->march(tableau, course);
            }
            if (c.callbacks->interrupted) throw nb::python_error();
          },
          nb::arg("tableau"), nb::arg("course"), "Take many steps.")
      .def(
          "derivative",
          [](PyCore& c, double t, const Array& y) -> nb::object {
            const Turn turn(c);
            Numbers at = numbers(y, c.core->length, "y"), F(c.core->ny), z(c.core->ng);
            c.callbacks->interrupted = false;
            try {
              c.core->derivative(t, at.data(), F.data(), z.data());
            } catch (const Trouble&) {
              if (c.callbacks->interrupted) throw nb::python_error();
              return nb::none();
            }
            return nb::make_tuple(vector(F), vector(z));
          },
          nb::arg("t"), nb::arg("y"), "Return y' (ny,) and lam (ng,) from the hidden constraint, or None.")
      .def(
          "derivatives",
          [](PyCore& c, const Array& t, const Array& y) -> nb::object {
            const Turn turn(c);
            const size_t n = t.size(), len = c.core->length, ng = c.core->ng, ny = c.core->ny;
            Numbers at = numbers(y, n * len, "y"), F(n * ny, NAN), z(n * ng, NAN);
            std::vector<double> ts(t.data(), t.data() + n);
            c.callbacks->interrupted = false;
            {
              nb::gil_scoped_release release;
              for (size_t i = 0; i < n; ++i) try {
                  c.core->derivative(ts[i], &at[i * len], &F[i * ny], z.data() + i * ng);
                } catch (const Trouble&) {
                  std::fill_n(F.begin() + i * ny, ny, NAN), std::fill_n(z.begin() + i * ng, ng, NAN);
                  if (c.callbacks->interrupted) break;
                }
            }
            if (c.callbacks->interrupted) throw nb::python_error();
            return nb::make_tuple(array(F, {n, ny}), array(z, {n, ng}));
          },
          nb::arg("t"), nb::arg("y"),
          "Return y' (n, ny) and lam (n, ng) at many points; nan where they cannot be found.")
      .def(
          "ratio",
          [](PyCore& c, const Array& q, int rank) -> nb::object {
            Numbers a = numbers(q, c.core->nq, "q");
            if (rank < 1 || rank > std::min(c.core->ng, c.core->nv)) refuse("rank out of range");
            const int before = c.core->rank;
            c.core->rank = rank;
            try {
              const double r = c.core->ratio(a.data());
              c.core->rank = before;
              return nb::float_(r);
            } catch (const Trouble&) {
              c.core->rank = before;
              return nb::none();
            }
          },
          nb::arg("q"), nb::arg("rank"),
          "Return the smallest pivot of independent rows of G M^-1/2 to the largest, or None.")
      .def(
          "bare",
          [](PyCore& c, const Array& q, const Array& v, int repetitions) {
            const Turn turn(c);
            Numbers a = numbers(q, c.core->nq, "q"), b = numbers(v, c.core->nv, "v");
            try {
              return c.core->bare(a.data(), b.data(), repetitions);
            } catch (const Trouble&) {
              refuse("the point is singular");
            }
          },
          nb::arg("q"), nb::arg("v"), nb::arg("repetitions"),
          "Return seconds of one mass matrix, nonlinear effects, factorization and solve, for benchmarks.");
}
