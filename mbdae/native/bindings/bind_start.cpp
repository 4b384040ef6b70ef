// Bindings of the start of a run, and of runs that the core solves from their start.
#include "bindings/py_core.hpp"
#include "run/core_runs.hpp"

namespace mbdae {

namespace {

auto start_at(PyCore& c, double t, const Array& y, bool project, double ambiguous, double fallen, double dependent) {
  return attempt(c, [&](Index2System& s) {
    Vector y0 = checked_vector(y, s.length, "y"), F(s.ny), z(s.ng);
    start(s, t, project, {ambiguous, fallen, dependent}, y0, F, z);
    return std::make_tuple(vector(y0), vector(F), vector(z), s.rows.in_use(), s.rows.floor);
  });
}

auto remaining_rows_dependent(PyCore& c, const Array& q, double tolerance) {
  return attempt(
      c, [&](Index2System& s) { return s.remaining_rows_dependent(checked_vector(q, s.nq, "q").data(), tolerance); });
}

// Check a run that starts in the core from n coordinates without calling Python; return its method.
template <class Coefficients>
auto check_start(PyCore& c, const Coefficients& a, const FirstStep* first_step, const Run& run, size_t n) {
  const Index2System& s = c.core->system;
  if (!c.callbacks->functions.empty()) reject("runs from a start in the core must not call functions of Python");
  auto method = c.core->method(a);
  check_run(c, a, method, run, State{Vector(n), Vector(s.carry_length()), {}, nullptr});
  if (first_step) check_atol(s, first_step->atol);
  return method;
}

auto step_size(PyCore& c, double t, const Array& y, const Array& F, const FirstStep& given) {
  return attempt(c, [&](Index2System& s) {
    check_atol(s, given.atol);
    return first_step(s, t, checked_vector(y, s.length, "y"), checked_vector(F, s.ny, "F"), given);
  });
}

template <class Coefficients>
auto begin(PyCore& c, const Coefficients& a, const RunStart& start, const FirstStep* first_step, Run& run) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  auto method = check_start(c, a, first_step, run, run.state.y.size());
  using StartResult = std::tuple<Out, Out, Out, std::vector<int>, double>;
  std::optional<StartResult> result;
  const double accuracy = s.accuracy;
  c.callbacks->interrupted = false;
  try {
    const StartDerivative derivative = begin_run(s, start, first_step, run);
    result = {vector(run.state.y), vector(derivative.F), vector(derivative.z), s.rows.in_use(), s.rows.floor};
  } catch (const FallBackToPython&) {
    s.reset(), s.accuracy = accuracy;
    return result;
  }
  take_steps(c, method, run);
  return result;
}

using StopFlag = nb::ndarray<const std::uint8_t, nb::c_contig, nb::device::cpu>;

template <class Coefficients>
auto solve_runs_from(PyCore& c, const Coefficients& a, const RunStart& start, const FirstStep* first_step,
                     const Run& run, const Array& y, const std::vector<ParameterLocation>& locations,
                     const Array& values, int nodes, const StopFlag& stop) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  const size_t length = s.length, runs = y.size() / length;
  const Vector points = checked_vector(y, runs * length, "y");
  const Vector parameter_values = checked_vector(values, runs * locations.size(), "values");
  InPlaceParameters parameters(s, locations);
  if (stop.size() != 1 || nodes < 2) reject("expected one flag and at least two nodes");
  auto method = check_start(c, a, first_step, run, length);
  CoreRuns out;
  run_unlocked(c, [&] {
    solve_runs(method, s, start, first_step, run, points, parameters, parameter_values, nodes, *stop.data(), out);
  });
  const size_t n = out.finished.size(), m = nodes, nz = s.nz;
  return std::make_tuple(out.finished, array(out.records, {n, n ? out.records.size() / n : 0}),
                         array(out.y, {n, m, length}), array(out.energies, {n, m, 2}), array(out.z, {n, nz}), out.rows);
}

auto mass_matrices(PyCore& c, const Array& q, const std::vector<ParameterLocation>& locations, const Array& values) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  const Vector q0 = checked_vector(q, s.nq, "q"), parameter_values = checked_vector(values, values.size(), "values");
  InPlaceParameters parameters(s, locations);
  if (locations.empty() || parameter_values.size() % locations.size())
    reject("expected a number at each location, for each run");
  Vector out;
  run_unlocked(c, [&] { out = parameters.mass_matrices(q0.data(), parameter_values); });
  const size_t n = s.nv;
  return array(out, {parameter_values.size() / locations.size(), n, n});
}

template <class Coefficients>
void def_runs(nb::class_<PyCore>& core, const char* method) {
  core.def("begin", begin<Coefficients>, nb::arg(method), nb::arg("start"), nb::arg("first_step").none(),
           nb::arg("run"),
           "Begin a run and take many steps; return the first y, y' (ny,), lam (ng,), rows in use and smallest pivot\n"
           "ratio, or None, with no step.");
  core.def(
      "solve_runs", solve_runs_from<Coefficients>, nb::arg(method), nb::arg("start"), nb::arg("first_step").none(),
      nb::arg("run"), nb::arg("y"), nb::arg("locations"), nb::arg("values"), nb::arg("nodes"), nb::arg("stop"),
      "Solve the runs from points y (n, length), with values (n, k) at k parameter locations, until the flag is set;\n"
      "return whether each finished without Python, its counts and extremes (n, 13), points and energies at\n"
      "some nodes (n, nodes, 2), last z, and last rows in use.");
}

}  // namespace

void bind_start(nb::class_<PyCore>& core) {
  core.def("start", start_at, nb::arg("t"), nb::arg("y"), nb::arg("project"), nb::arg("ambiguous"), nb::arg("fallen"),
           nb::arg("dependent"),
           "Determine rank and rows in use; return y, y' (ny,), lam (ng,), the rows and the smallest pivot ratio, or "
           "None.")
      .def("remaining_rows_dependent", remaining_rows_dependent, nb::arg("q"), nb::arg("tolerance"),
           "Return whether all other rows are dependent on those in use at q, or None.")
      .def("mass_matrices", mass_matrices, nb::arg("q"), nb::arg("locations"), nb::arg("values"),
           "Return M (k, nv, nv) at q by Pinocchio's crba, below the diagonal, for values (k, n) at n parameter "
           "locations.")
      .def("first_step", step_size, nb::arg("t"), nb::arg("y"), nb::arg("F"), nb::arg("given"),
           "Return the first step size in s, or None.");
  def_runs<Tableau>(core, "tableau"), def_runs<Radau>(core, "radau");
  def_runs<Composition>(core, "composition"), def_runs<GeneralizedAlpha>(core, "alpha");
}

}  // namespace mbdae
