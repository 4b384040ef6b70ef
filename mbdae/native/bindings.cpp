// The Python module mbdae._native. No type of Pinocchio is seen here: this file compiles in seconds.
#include <cmath>
#include <set>

#include "py_core.hpp"
#include "projection.hpp"
#include "residuals.hpp"

using namespace mbdae;

namespace {

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

nb::object settle(PyCore& c, double t, const Array& y, const nb::object& carry) {
  return attempt(c, [&](Index2System& s) {
    State x = state(y, carry, nb::none());
    if (static_cast<int>(x.y.size()) != s.length) refuse("y has the wrong length");
    if (!x.carry.empty() && static_cast<int>(x.carry.size()) != s.carried()) refuse("carry has the wrong length");
    const bool changed = s.settle(t, x);
    return nb::make_tuple(changed, vector(x.y), carried(x));
  });
}

nb::object step(PyCore& c, const Tableau& tableau, double t, double h, const Array& y, const nb::object& carry,
                const nb::object& low) {
  return attempt(c, [&](Index2System& s) {
    State in = state(y, carry, low), out;
    c.check(in, &tableau);
    Numbers z(s.nz), errors;
    c.core->step->take(tableau, t, h, in, out, z.data(), errors);
    const size_t ny = s.ny;
    return nb::make_tuple(vector(out.y), maybe(out.carry), maybe(out.low), vector(z),
                          array(errors, {errors.size() / ny, ny}));
  });
}

nb::object collocate(PyCore& c, const Radau& radau, double t, double h, const Array& y, const nb::object& carry,
                     const nb::object& low, bool controlled) {
  return attempt(c, [&](Index2System& s) {
    State in = state(y, carry, low), out;
    c.check(in);
    Numbers z(s.nz), errors;
    c.core->stages->take(radau, controlled, t, h, in, out, z.data(), errors);
    const size_t ny = s.ny;
    return nb::make_tuple(vector(out.y), carried(out), maybe(out.low), vector(z),
                          array(errors, {errors.size() / ny, ny}));
  });
}

void expand(PyCore& c, nb::handle model) {
  const Turn turn(c);
  const void* m = model_pointer(model.ptr());
  const auto size = model_sizes(m);
  if (size[0] != c.core->system.nq || size[1] != c.core->system.nv) refuse("the expanded tree has other coordinates");
  c.expanded = nb::borrow(model);
  c.core->system.mechanics.expand(m);
}

nb::object slopes(PyCore& c, double t, const Array& q, const Array& u, const Array& vdot, const Array& lam) {
  return attempt(c, [&](Index2System& s) {
    if (!s.mechanics.expanded()) refuse("slopes need the expanded tree");
    const size_t nv = s.nv, n = s.ny - s.nv;
    Numbers a = numbers(q, s.nq, "q"), b = numbers(u, n, "u"), d = numbers(vdot, nv, "vdot");
    Numbers l = numbers(lam, s.ng, "lam");
    Slopes out;
    s.slopes(t, a.data(), b.data(), d.data(), l.data(), out);
    const size_t r = out.g_t.size();
    return nb::make_tuple(array(out.M, {nv, nv}), array(out.K, {n, nv}), array(out.D, {n, n}), array(out.G, {r, nv}),
                          array(out.B, {r, nv}), vector(out.g_t));
  });
}

void run_loop(PyCore& c, Method& method, Run& run) {
  const size_t n = run.control.atol.size();
  if (run.adaptive && n != 1 && n != static_cast<size_t>(c.core->system.measured()))
    refuse("atol has the wrong length");
  if (run.adaptive && !method.errors) refuse("the tableau has no error estimate");
  run.steps = Steps(), run.taken = run.rejected = 0, run.stuck = false;
  check_events(run.events, c.core->system);
  many(c, [&] { TimeLoop(method, c.core->system, run).advance(); });
}

void advance(PyCore& c, const Tableau& tableau, Run& run) {
  const Turn turn(c);
  c.check(run.state, &tableau);
  HalfExplicitMethod method(*c.core->step, tableau);
  run_loop(c, method, run);
}

void advance_stages(PyCore& c, const Radau& radau, Run& run) {
  const Turn turn(c);
  c.check(run.state);
  CollocationMethod method(*c.core->stages, radau);
  run_loop(c, method, run);
}

nb::object derivative(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = numbers(y, s.length, "y"), F(s.ny), z(s.ng);
    s.derivative(t, at.data(), F.data(), z.data());
    return nb::make_tuple(vector(F), vector(z));
  });
}

nb::object rate(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = numbers(y, s.length, "y"), dy(s.length), z(s.ng);
    s.rate(t, at.data(), dy.data(), z.data());
    return nb::make_tuple(vector(dy), vector(z));
  });
}

nb::object derivatives(PyCore& c, const Array& t, const Array& y) {
  const Turn turn(c);
  Index2System& s = c.core->system;
  const size_t n = t.size(), length = s.length, ng = s.ng, ny = s.ny;
  Numbers ts(t.data(), t.data() + n), at = numbers(y, n * length, "y"), F(n * ny, NAN), z(n * ng, NAN);
  many(c, [&] {
    for (size_t i = 0; i < n; ++i) try {
        s.derivative(ts[i], &at[i * length], &F[i * ny], z.data() + i * ng);
      } catch (const Trouble&) {
        std::fill_n(F.begin() + i * ny, ny, NAN), std::fill_n(z.begin() + i * ng, ng, NAN);
        if (c.callbacks->interrupted) break;
      }
  });
  return nb::make_tuple(array(F, {n, ny}), array(z, {n, ng}));
}

nb::object residuals(PyCore& c, const Array& t, const Array& y) {
  const Turn turn(c);
  Index2System& s = c.core->system;
  const size_t n = t.size(), length = s.length, ng = s.ng;
  Numbers ts(t.data(), t.data() + n), at = numbers(y, n * length, "y"), g(n * ng), rate(n * ng), energies(2 * n);
  many(c, [&] {
    for (size_t i = 0; i < n; ++i) try {
        residual(s, ts[i], &at[i * length], g.data() + i * ng, rate.data() + i * ng);
        const Energy e = energy(s, &at[i * length]);
        energies[2 * i] = e.kinetic, energies[2 * i + 1] = e.potential;
      } catch (const Trouble&) {
        energies[2 * i] = energies[2 * i + 1] = NAN;
        if (c.callbacks->interrupted) break;
      }
  });
  return nb::make_tuple(array(g, {n, ng}), array(rate, {n, ng}), array(energies, {n, 2}));
}

// Whatever the mode leaves out.
nb::object every(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = numbers(y, s.length, "y"), g(s.ng), rate(s.ng);
    std::vector<bool> off;
    off.swap(s.constraints.off);
    try {
      residual(s, t, at.data(), g.data(), rate.data());
    } catch (const Trouble&) {
      off.swap(s.constraints.off);
      throw;
    }
    off.swap(s.constraints.off);
    return nb::make_tuple(vector(g), vector(rate));
  });
}

nb::object restored(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = numbers(y, s.length, "y");
    restore(s, t, at.data());
    return nb::cast(vector(at));
  });
}

void sample(PyCore& c, const nb::list& list) {
  const Turn turn(c);
  Index2System& s = c.core->system;
  std::vector<Sampler> out;
  for (nb::handle h : list) out.push_back(sampler(nb::cast<nb::dict>(h), {s.nq, s.nv, 0}, s.ns, *c.callbacks));
  s.samplers = std::move(out);
}

nb::object ratio(PyCore& c, const Array& q, int rank) {
  Index2System& s = c.core->system;
  Numbers at = numbers(q, s.nq, "q");
  if (rank < 1 || rank > std::min(s.ng, s.nv)) refuse("rank out of range");
  try {
    return nb::float_(s.ratio(at.data(), rank));
  } catch (const Trouble&) {
    return nb::none();
  }
}

double bare(PyCore& c, const Array& q, const Array& v, int repetitions) {
  const Turn turn(c);
  Index2System& s = c.core->system;
  Numbers a = numbers(q, s.nq, "q"), b = numbers(v, s.nv, "v");
  try {
    return s.bare(a.data(), b.data(), repetitions);
  } catch (const Trouble&) {
    refuse("the point is singular");
  }
}

void leave_out(PyCore& c, const std::vector<bool>& off) {
  const Turn turn(c);
  if (!off.empty() && static_cast<int>(off.size()) != c.core->system.ng) refuse("off has the wrong length");
  c.core->system.leave_out(off);
}

void change_law(PyCore& c, int k, const Numbers& a) {
  const Turn turn(c);
  if (!c.core->system.change_law(k, a)) refuse("a law has other numbers");
}

void use(PyCore& c, const std::vector<int>& rows, int rank, double floor, bool held) {
  const Turn turn(c);
  within(rows, c.core->system.ng, "row");
  if (rank != static_cast<int>(rows.size()) || std::set<int>(rows.begin(), rows.end()).size() != rows.size())
    refuse("rows are different, and as many as the rank");
  c.core->system.use(rows, rank, floor, held);
}

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "The compiled core of mbdae.";
  m.def("version", [] { return MBDAE_PINOCCHIO_VERSION; }, "Version of Pinocchio that the core was built for.");
  bind_limits(m), bind_tableau(m), bind_radau(m), bind_events(m), bind_run(m);

  nb::class_<Counts>(m, "Counts", "Work done so far.")
      .def_ro("f", &Counts::f)
      .def_ro("M", &Counts::M)
      .def_ro("G", &Counts::G)
      .def_ro("solves", &Counts::solves)
      .def_ro("factorizations", &Counts::factorizations)
      .def_ro("newton", &Counts::newton)
      .def_ro("projections", &Counts::projections)
      .def_ro("state_projections", &Counts::state_projections);

  nb::class_<PyCore> core(m, "Core", nb::type_slots(collected), "A mechanism in a workspace of its own.");
  core.def(nb::init<nb::handle, const Limits&, bool, const nb::list&, const nb::list&, const nb::list&, const nb::list&,
                    const nb::list&, int, const nb::list&, std::vector<int>, std::vector<int>, std::vector<double>,
                    const std::string&, double, double>(),
           nb::arg("model"), nb::arg("limits"), nb::arg("flat"), nb::arg("pairs"), nb::arg("rows"), nb::arg("drivers"),
           nb::arg("law_pairs"), nb::arg("laws"), nb::arg("ns"), nb::arg("blocks"), nb::arg("turning"),
           nb::arg("place"), nb::arg("probe"), nb::arg("formulation") = "index2", nb::arg("alpha") = 0.0,
           nb::arg("beta") = 0.0)
      .def_prop_ro("rows", [](const PyCore& c) { return c.core->system.rows.in_use(); })
      .def_prop_ro("rank", [](const PyCore& c) { return c.core->system.rows.rank; })
      .def_prop_ro("counts", [](const PyCore& c) { return c.core->system.counts; })
      .def_prop_rw(
          "least_pivot_ratio", [](const PyCore& c) { return c.core->system.rows.least_pivot_ratio; },
          [](PyCore& c, double x) { c.core->system.rows.least_pivot_ratio = x; })
      .def_prop_ro("largest_g", [](const PyCore& c) { return c.core->system.largest_g; })
      .def_prop_ro("largest_rate", [](const PyCore& c) { return c.core->system.largest_rate; })
      .def("use", use, nb::arg("rows"), nb::arg("rank"), nb::arg("floor"), nb::arg("held"),
           "Say which rows are in use, below which ratio of pivots the rank has fallen, and whether rows stay.")
      .def("change_law", change_law, nb::arg("k"), nb::arg("a"), "Give law k other numbers: in a mode they are constant.")
      .def("leave_out", leave_out, nb::arg("off"), "Say which rows the mode does not have; none for an empty list.")
      .def("settle", settle, nb::arg("t"), nb::arg("y"), nb::arg("carry").none(),
           "Choose the rows of the next step: say whether others are taken, and return y and carry, or None.")
      .def("step", step, nb::arg("tableau"), nb::arg("t"), nb::arg("h"), nb::arg("y"), nb::arg("carry").none(),
           nb::arg("low").none(), "Return y, carry, low, z and errors after one step; None where it cannot be taken.")
      .def("step", collocate, nb::arg("radau"), nb::arg("t"), nb::arg("h"), nb::arg("y"), nb::arg("carry").none(),
           nb::arg("low").none(), nb::arg("controlled"), "The same of a collocation method.")
      .def("advance", advance, nb::arg("tableau"), nb::arg("run"), "Take many steps.")
      .def("advance", advance_stages, nb::arg("radau"), nb::arg("run"), "Take many steps.")
      .def("expand", expand, nb::arg("model"), "Say what the expanded tree is: slopes and implicit methods need it.")
      .def("slopes", slopes, nb::arg("t"), nb::arg("q"), nb::arg("u"), nb::arg("vdot"), nb::arg("lam"),
           "Return M, K, D, G, B and g_t of the rows in use, or None; lam (ng,) stands by row.")
      .def("derivative", derivative, nb::arg("t"), nb::arg("y"),
           "Return y' (ny,) and lam (ng,) from the hidden constraint, or None.")
      .def("rate", rate, nb::arg("t"), nb::arg("y"),
           "Return dy/dt (length,) of raw coordinates and lam (ng,) from the hidden constraint, or None.")
      .def("derivatives", derivatives, nb::arg("t"), nb::arg("y"),
           "Return y' (n, ny) and lam (n, ng) at many points; nan where they cannot be found.")
      .def("sample", sample, nb::arg("samplers"), "Say which controllers look at the mechanism at instants.")
      .def("residuals", residuals, nb::arg("t"), nb::arg("y"),
           "Return g (n, ng), G v + g_t (n, ng), and kinetic and potential energy (n, 2) at many points.")
      .def("every", every, nb::arg("t"), nb::arg("y"), "Return g and G v + g_t over all rows whatever the mode, or None.")
      .def("restore", restored, nb::arg("t"), nb::arg("y"), "Return the point on the closures, or None.")
      .def("ratio", ratio, nb::arg("q"), nb::arg("rank"),
           "Return the smallest pivot of independent rows of G M^-1/2 to the largest, or None.")
      .def("bare", bare, nb::arg("q"), nb::arg("v"), nb::arg("repetitions"),
           "Return seconds of one mass matrix, nonlinear effects, factorization and solve, for benchmarks.");
  bind_tangents(m, core);
}
