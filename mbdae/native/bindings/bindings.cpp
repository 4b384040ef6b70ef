// The Python module mbdae._native. No Pinocchio types are included here: this file compiles in seconds.
#include <set>
#include <utility>

#include "bindings/py_core.hpp"
#include "system/projection.hpp"

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

nb::object update_independent_rows(PyCore& c, double t, const Array& y, const nb::object& carry) {
  return attempt(c, [&](Index2System& s) {
    State x = state(y, carry, nb::none());
    if (static_cast<int>(x.y.size()) != s.length) refuse("y has the wrong length");
    if (!x.carry.empty() && static_cast<int>(x.carry.size()) != s.carried()) refuse("carry has the wrong length");
    const bool changed = s.update_independent_rows(t, x);
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
  const CoreLock turn(c);
  const void* m = model_pointer(model.ptr());
  const auto size = model_sizes(m);
  if (size[0] != c.core->system.nq || size[1] != c.core->system.nv) refuse("the expanded tree has other coordinates");
  c.expanded = nb::borrow(model);
  c.core->system.mechanics.expand(m);
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
  const CoreLock turn(c);
  c.check(run.state, &tableau);
  HalfExplicitMethod method(*c.core->step, tableau);
  run_loop(c, method, run);
}

void advance_stages(PyCore& c, const Radau& radau, Run& run) {
  const CoreLock turn(c);
  c.check(run.state);
  CollocationMethod method(*c.core->stages, radau);
  run_loop(c, method, run);
}

nb::object restored(PyCore& c, double t, const Array& y) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = numbers(y, s.length, "y");
    restore(s, t, at.data());
    return nb::cast(vector(at));
  });
}

void sample(PyCore& c, const nb::list& list) {
  const CoreLock turn(c);
  Index2System& s = c.core->system;
  std::vector<SampledController> out;
  for (nb::handle h : list) out.push_back(sampler(nb::cast<nb::dict>(h), {s.nq, s.nv, 0}, s.ns, *c.callbacks));
  s.samplers = std::move(out);
}

void slide(PyCore& c, const nb::list& list, const Active& active, const Headings& heading) {
  const CoreLock turn(c);
  std::vector<FrictionInterface> out;
  for (nb::handle h : list) out.push_back(sliding_place(nb::cast<nb::dict>(h), c.core->system.constraints));
  if (active.size() != out.size() || heading.size() != 2 * out.size()) refuse("as many numbers as places that slide");
  c.core->system.sliding.use(std::move(out), active.data(), heading.data());
  c.active = active, c.heading = heading;
}

void leave_out(PyCore& c, const std::vector<bool>& off, bool sticks) {
  const CoreLock turn(c);
  if (!off.empty() && static_cast<int>(off.size()) != c.core->system.ng) refuse("off has the wrong length");
  c.core->system.leave_out(off, sticks);
}

nb::tuple take_record(PyCore& c) {
  Index2System& s = c.core->system;
  const Counts n = std::exchange(s.counts, {});
  return nb::make_tuple(n.f, n.M, n.G, n.solves, n.factorizations, n.projections, n.state_projections, n.newton,
                        std::exchange(s.rows.least_pivot_ratio, 1.0), s.largest_g, s.largest_rate, s.largest_speed);
}

void change_law(PyCore& c, int k, const Numbers& a) {
  const CoreLock turn(c);
  if (!c.core->system.change_law(k, a)) refuse("a law has other numbers");
}

void use(PyCore& c, const std::vector<int>& rows, int rank, double floor, bool held) {
  const CoreLock turn(c);
  within(rows, c.core->system.ng, "row");
  if (rank != static_cast<int>(rows.size()) || std::set<int>(rows.begin(), rows.end()).size() != rows.size())
    refuse("rows are different, and as many as the rank");
  c.core->system.use(rows, rank, floor, held);
}

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "The compiled core of mbdae.";
  m.def("version", [] { return MBDAE_PINOCCHIO_VERSION; }, "Version of Pinocchio that the core was built for.");
  m.def("sweeps", [](nb::handle model) { return model_sweeps(model_pointer(model.ptr())); }, nb::arg("model"),
        "Return whether the core computes M, nle and J of a model itself; otherwise Pinocchio does.");
  nb::exception<UnknownKind>(m, "UnknownKind", PyExc_ValueError);
  bind_limits(m), bind_tableau(m), bind_radau(m), bind_events(m), bind_run(m);

  nb::class_<PyCore> core(m, "Core", nb::type_slots(collected), "A mechanism in a workspace of its own.");
  core.def(nb::init<nb::handle, const Tolerances&, bool, const nb::list&, const nb::list&, const nb::list&, const nb::list&,
                    const nb::list&, int, const nb::list&, std::vector<int>, const nb::list&, std::vector<int>,
                    std::vector<double>, const std::string&, double, double>(),
           nb::arg("model"), nb::arg("limits"), nb::arg("flat"), nb::arg("pairs"), nb::arg("rows"), nb::arg("drivers"),
           nb::arg("law_pairs"), nb::arg("laws"), nb::arg("ns"), nb::arg("blocks"), nb::arg("turning"),
           nb::arg("angles"), nb::arg("place"), nb::arg("probe"), nb::arg("formulation") = "index2", nb::arg("alpha") = 0.0,
           nb::arg("beta") = 0.0)
      .def_prop_ro("rows", [](const PyCore& c) { return c.core->system.rows.in_use(); })
      .def_prop_ro("rank", [](const PyCore& c) { return c.core->system.rows.rank; })
      .def("take_record", take_record,
           "Return the counts of work since the last call, in the order of mbdae.system.Counts, the smallest pivot ratio since\n"
           "then, and the largest |g|, |G v + g_t| and |v| at the ends of steps.")
      .def_prop_rw(
          "accuracy", [](const PyCore& c) { return c.core->system.accuracy; },
          [](PyCore& c, double x) { c.core->system.accuracy = x; })
      .def("use", use, nb::arg("rows"), nb::arg("rank"), nb::arg("floor"), nb::arg("held"),
           "Say which rows are in use, below which ratio of pivots the rank has fallen, and whether rows stay.")
      .def("reset", [](PyCore& c) { c.core->system.reset(); }, "Return to the state of a new core, in the same mode.")
      .def("change_law", change_law, nb::arg("k"), nb::arg("a"), "Give law k other numbers: in a mode they are constant.")
      .def("leave_out", leave_out, nb::arg("off"), nb::arg("sticks"),
           "Say which rows the mode does not have, none for an empty list, and whether joints stick in it.")
      .def("update_independent_rows", update_independent_rows, nb::arg("t"), nb::arg("y"), nb::arg("carry").none(),
           "Choose the rows of the next step: say whether others are taken, and return y and carry, or None.")
      .def("step", step, nb::arg("tableau"), nb::arg("t"), nb::arg("h"), nb::arg("y"), nb::arg("carry").none(),
           nb::arg("low").none(), "Return y, carry, low, z and errors after one step; None where it cannot be taken.")
      .def("step", collocate, nb::arg("radau"), nb::arg("t"), nb::arg("h"), nb::arg("y"), nb::arg("carry").none(),
           nb::arg("low").none(), nb::arg("controlled"), "The same of a collocation method.")
      .def("advance", advance, nb::arg("tableau"), nb::arg("run"), "Take many steps.")
      .def("advance", advance_stages, nb::arg("radau"), nb::arg("run"), "Take many steps.")
      .def("expand", expand, nb::arg("model"), "Say what the expanded tree is: partials and implicit methods need it.")
      .def("sample", sample, nb::arg("samplers"), "Say which controllers look at the mechanism at instants.")
      .def("slide", slide, nb::arg("places"), nb::arg("active").noconvert(), nb::arg("heading").noconvert(),
           "Say where closures slide by friction of what they carry; active (k,) and heading (k, 2) are read and written.")
      .def("slowest_slip", [](PyCore& c, double speed) { c.core->system.sliding.still = speed; }, nb::arg("speed"),
           "Set the speed below which a slip has no direction.")
      .def("restore", restored, nb::arg("t"), nb::arg("y"), "Return the point on the closures, or None.");
  bind_points(core), bind_tangents(m, core);
}
