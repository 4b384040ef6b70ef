// The Python module mbdae._native. This file includes no Pinocchio types, so that it compiles in seconds.
#include <set>
#include <utility>

#include "bindings/py_core.hpp"
#include "math/vec3.hpp"
#include "mechanism/tree_data.hpp"
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

PyType_Slot garbage_collection_slots[] = {
    {Py_tp_traverse, reinterpret_cast<void*>(traverse)}, {Py_tp_clear, reinterpret_cast<void*>(clear)}, {0, nullptr}};

using StepResult = std::tuple<Out, nb::object, std::optional<Out>, Out, Out>;  // y, carry, low, z, errors

auto update_independent_rows(PyCore& c, double t, const Array& y, const nb::object& carry) {
  return attempt(c, [&](Index2System& s) {
    State x = state(y, carry);
    if (static_cast<int>(x.y.size()) != s.length) reject("y has the wrong length");
    const bool changed = s.update_independent_rows(t, x);
    return std::make_tuple(changed, vector(x.y), carry_of(x));
  });
}

// Controlled: whether to estimate the error, for methods that do so on request.
template <class Coefficients, class... Controlled>
std::optional<StepResult> step(PyCore& c, const Coefficients& a, double t, double h, const Array& y,
                               const nb::object& carry, const std::optional<Array>& low, Controlled... controlled) {
  return attempt(c, [&](Index2System& s) -> StepResult {
    State in = state(y, carry, low), out;
    c.check(in, tableau_of(a));
    Vector z(s.nz), errors;
    c.core->method(a).take((false || ... || controlled), t, h, in, out, z.data(), errors);
    const size_t ny = s.ny;
    return {vector(out.y), carry_of(out), optional_vector(out.low), vector(z), array(errors, {errors.size() / ny, ny})};
  });
}

void expand(PyCore& c, nb::handle model) {
  const CoreLock lock(c);
  const void* m = model_pointer(model.ptr());
  const auto size = model_sizes(m);
  if (size[0] != c.core->system.nq || size[1] != c.core->system.nv)
    reject("the expanded tree must have the coordinates of the tree");
  c.expanded = nb::borrow(model);
  c.core->system.tree.expand(m);
}

template <class Coefficients>
void advance(PyCore& c, const Coefficients& a, Run& run) {
  const CoreLock lock(c);
  auto method = c.core->method(a);
  check_run(c, a, method, run, run.state);
  take_steps(c, method, run);
}

auto projected_state(PyCore& c, double t, const Array& y, bool tight) {
  return attempt(c, [&](Index2System& s) {
    Vector projected = checked_vector(y, s.length, "y");
    project_state(s, t, projected.data(), tight);
    return vector(projected);
  });
}

void set_sampled_controllers(PyCore& c, const nb::list& controllers) {
  const CoreLock lock(c);
  c.core->system.samplers = c.reader().read<std::vector<SampledController>>(controllers);
}

void set_friction_interfaces(PyCore& c, const nb::list& list, const Active& active, const Directions& directions) {
  const CoreLock lock(c);
  auto interfaces = c.reader().read<std::vector<FrictionInterface>>(list);
  check_and_complete_interfaces(interfaces, c.core->system.constraints.rows);
  if (active.size() != interfaces.size() || directions.size() != 2 * interfaces.size())
    reject("closure friction needs one state and two slip directions for each interface");
  c.core->system.friction.use(std::move(interfaces), active.data(), directions.data());
  c.active = active, c.directions = directions;
}

void deactivate_rows(PyCore& c, const std::vector<bool>& off, bool has_sticking_joints) {
  const CoreLock lock(c);
  if (!off.empty() && static_cast<int>(off.size()) != c.core->system.ng) reject("off has the wrong length");
  c.core->system.deactivate_rows(off, has_sticking_joints);
}

nb::tuple take_record(PyCore& c) {  // called after each call of the core: a dict would take longer
  Index2System& s = c.core->system;
  const Counts n = std::exchange(s.counts, {});
  return nb::make_tuple(n.f, n.M, n.G, n.solves, n.factorizations, n.projections, n.state_projections, n.newton,
                        std::exchange(s.rows.least_pivot_ratio, 1.0), s.largest_g, s.largest_rate, s.largest_speed);
}

bool write_core(PyCore& c, nb::handle model, const Tolerances& tolerances, const nb::dict& description) {
  const CoreLock lock(c);
  return c.write(model, tolerances, description);
}

void change_law(PyCore& c, int k, const Vector& a) {
  const CoreLock lock(c);
  if (!c.core->system.change_law(k, a)) reject("the number of parameters of a law must not change");
}

void use_rows(PyCore& c, const std::vector<int>& rows, int rank, double floor, bool frozen) {
  const CoreLock lock(c);
  check_indices(rows, c.core->system.ng, "row");
  if (rank != static_cast<int>(rows.size()) || std::set<int>(rows.begin(), rows.end()).size() != rows.size())
    reject("rows in use must be distinct, and as many as the rank");
  c.core->system.use_rows(rows, rank, floor, frozen);
}

// Positions (n, m, 3) in the world of points (n, 3), each fixed to a joint, at configurations (m, nq).
Out point_paths(nb::handle model, const std::vector<int>& joints, const Array& points, const Array& q) {
  MultibodyTree tree(model_pointer(model.ptr()), Tolerances(), {});  // kinematics have no tolerances
  const size_t n = joints.size(), m = q.ndim() ? q.shape(0) : 0;
  const Vector configurations = checked_vector(q, m * tree.nq, "q"), local = checked_vector(points, 3 * n, "points");
  check_indices(joints, tree.joints, "joint");
  Vector out(n * m * 3);
  for (size_t k = 0; k < m; ++k) {
    tree.poses(configurations.data() + k * tree.nq);
    for (size_t i = 0; i < n; ++i) {
      double* p = &out[3 * (i * m + k)];
      rotate_by_columns(tree.rotation(joints[i]), &local[3 * i], p);
      for (int c = 0; c < 3; ++c) p[c] += tree.position(joints[i])[c];
    }
  }
  return array(out, {n, m, 3});
}

}  // namespace

NB_MODULE(_native, m) {
  m.doc() = "The compiled core of mbdae.";
  nb::set_leak_warnings(false);  // pool workers exit while they keep mechanisms for the next task
  m.def("version", [] { return MBDAE_PINOCCHIO_VERSION; }, "Version of Pinocchio that the core was built for.");
  m.def(
      "sweeps", [](nb::handle model) { return sweep_supports(model_pointer(model.ptr())); }, nb::arg("model"),
      "Return whether the core computes M, nle and J of a model; otherwise Pinocchio does.");
  m.def(
      "tree_data",
      [](nb::handle model) {
        TreeData data = data_of(tree_model(model_pointer(model.ptr())));
        return to_python(data);
      },
      nb::arg("model"), "Return the data of a model, from which a core without Pinocchio rebuilds it.");
  m.def("point_paths", point_paths, nb::arg("model"), nb::arg("joints"), nb::arg("points"), nb::arg("q"),
        "Return the positions (n, m, 3) in the world of points (n, 3) fixed to joints at configurations q (m, nq).");
  nb::exception<UnknownKind>(m, "UnknownKind", PyExc_ValueError);
  bind_structs(m), bind_events(m);

  using nb::arg;
  nb::class_<PyCore> core(m, "Core", nb::type_slots(garbage_collection_slots),
                          "The compiled core of a mechanism, with its workspace.");
  core.def(nb::init<nb::handle, const Tolerances&, const nb::dict&>(), arg("model"), arg("tolerances"),
           arg("description"))
      .def_prop_ro("rows", [](const PyCore& c) { return c.core->system.rows.in_use(); })
      .def_prop_ro(
          "planar", [](const PyCore& c) { return c.core->system.tree.planar(); },
          "Whether all bodies move in parallel planes, so that the sweep computes two coordinates and an angle.")
      .def_prop_ro("rank", [](const PyCore& c) { return c.core->system.rows.rank; })
      .def_prop_ro("floor", [](const PyCore& c) { return c.core->system.rows.floor; })
      .def_prop_ro(
          "calls_python", [](const PyCore& c) { return !c.callbacks->functions.empty(); },
          "Whether a force, a row, a driver or a controller is a Python function.")
      .def("take_record", take_record,
           "Return the counts of work since the last call, in the order of mbdae.system.Counts, the smallest pivot "
           "ratio\n"
           "since then, and the largest |g|, |G v + g_t| and |v| at the ends of steps.")
      .def_prop_rw(
          "accuracy", [](const PyCore& c) { return c.core->system.accuracy; },
          [](PyCore& c, double x) { c.core->system.accuracy = x; })
      .def("use_rows", use_rows, arg("rows"), arg("rank"), arg("floor"), arg("frozen"),
           "Set the rows in use, the pivot ratio below which the rank has fallen, and whether rows are frozen.")
      .def(
          "reset", [](PyCore& c) { c.core->system.reset(); }, "Return to the state of a new core, in the same mode.")
      .def("write", write_core, arg("model"), arg("tolerances"), arg("description"),
           "Write the parameters of a mechanism in place, and reset; False if its structure differs.")
      .def(
          "set_input",
          [](PyCore& c, int input, double t, double value, double rate) {
            const CoreLock lock(c);
            c.core->system.set_input(input, t, value, rate);
          },
          arg("input"), arg("t"), arg("value"), arg("rate"), "Set an input to value + rate (t' - t).")
      .def("change_law", change_law, arg("k"), arg("a"), "Set the parameters of law k, which are constant in a mode.")
      .def("deactivate_rows", deactivate_rows, arg("off"), arg("has_sticking_joints"),
           "Set the rows that are inactive in the mode, an empty list for none, and whether joints stick.")
      .def("update_independent_rows", update_independent_rows, arg("t"), arg("y"), arg("carry").none(),
           "Select the rows of the next step; return whether they changed, y and carry, or None.")
      .def("step", step<Tableau>, arg("tableau"), arg("t"), arg("h"), arg("y"), arg("carry").none(), arg("low").none(),
           "Return y, carry, low, z and errors after one step; None where it cannot be taken.")
      .def("step", step<Radau, bool>, arg("radau"), arg("t"), arg("h"), arg("y"), arg("carry").none(),
           arg("low").none(), arg("controlled"))
      .def("step", step<Composition>, arg("composition"), arg("t"), arg("h"), arg("y"), arg("carry").none(),
           arg("low").none())
      .def("step", step<GeneralizedAlpha>, arg("alpha"), arg("t"), arg("h"), arg("y"), arg("carry").none(),
           arg("low").none())
      .def("advance", advance<Tableau>, arg("tableau"), arg("run"), "Take many steps.")
      .def("advance", advance<Radau>, arg("radau"), arg("run"))
      .def("advance", advance<Composition>, arg("composition"), arg("run"))
      .def("advance", advance<GeneralizedAlpha>, arg("alpha"), arg("run"))
      .def("expand", expand, arg("model"), "Set the expanded tree, which partials and implicit methods require.")
      .def("set_sampled_controllers", set_sampled_controllers, arg("controllers"))
      .def("set_friction_interfaces", set_friction_interfaces, arg("interfaces"), arg("active").noconvert(),
           arg("directions").noconvert(),
           "Set the interfaces with friction proportional to closure forces; active (k,) and slip directions (k, 2) "
           "are\n"
           "read and written.")
      .def(
          "set_smallest_slip", [](PyCore& c, double speed) { c.core->system.friction.smallest_slip = speed; },
          arg("speed"), "Set the slip speed below which the slip has no direction.")
      .def("project_state", projected_state, arg("t"), arg("y"), arg("tight") = false,
           "Return the projected point, or None.");
  bind_run(m), bind_points(core), bind_start(core), bind_sensitivity(m, core);
}
