// Bindings of a run and its input: tolerances, methods, state. The headers of the structs document their fields.
#include <nanobind/stl/complex.h>

#include <chrono>
#include <cmath>

#include "bindings/py_core.hpp"
#include "bindings/structs.hpp"
#include "run/method_checks.hpp"
#include "run/core_runs.hpp"

namespace mbdae {

namespace {

using PivotRatioByMode = std::vector<std::pair<Mode, double>>;

// Seconds of one evaluation of all partials.
double partials_seconds(PyCore& c, const Array& q, const Array& v, int repetitions) {
  const CoreLock lock(c);
  Index2System& s = c.core->system;
  if (!s.tree.expanded()) reject("partials require the expanded tree");
  Vector q0 = checked_vector(q, s.nq, "q"), u = checked_vector(v, s.nv, "v"), vdot(s.nv), lam(s.ng);
  u.resize(s.ny - s.nv);
  Vector perturbed(u);  // alternates with u, so that no point is cached
  perturbed[0] += 1;
  const Counts counts = s.counts;
  EquationPartials out;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < repetitions; ++i) {
    s.partials(0, q0.data(), u.data(), vdot.data(), lam.data(), out);
    std::swap(u, perturbed);
  }
  s.counts = counts, s.point.invalidate();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / repetitions;
}

// The carries at the first nodes, (k, nc), and the nodes at which the carry was restarted.
std::pair<Out, std::vector<long>> carries(const Run& r) {
  const size_t n = std::min(r.steps.t.size(), static_cast<size_t>(std::max(r.max_carries, 0L)));
  return {array(r.steps.carry, {n, n ? r.steps.carry.size() / n : 0}), r.steps.restarted};
}

std::tuple<Out, Out, Out, Out> steps(const Run& r) {
  const Steps& s = r.steps;
  const size_t n = s.t.size();
  return {vector(s.t), array(s.y, {n, n ? s.y.size() / n : 0}), array(s.z, {n, n ? s.z.size() / n : 0}),
          vector(s.least_pivot_ratio)};
}

}  // namespace

void bind_structs(nb::module_& m) {
  bind_keywords<Tolerances>(m, "Tolerances", "Thresholds of evaluations and steps.");
  bind_keywords<Tableau>(m, "Tableau", "Coefficients of a half-explicit method.", complete_tableau);
  nb::class_<StageMemory>(m, "StageMemory",
                          "Stage values and factorization that a collocation step passes to the next one.");
  bind_keywords<EigenMode>(m, "EigenMode", "An eigenvalue of A with its eigenvectors.");
  bind_keywords<Radau>(m, "Radau", "Coefficients of a collocation method, and thresholds of its iteration.",
                       complete_radau);
  bind_keywords<NewtonIteration>(m, "NewtonIteration", "Thresholds of Newton's method to rounding.");
  bind_keywords<Composition>(m, "Composition", "Weights of a composition of RATTLE steps.", complete_composition);
  bind_keywords<GeneralizedAlpha>(m, "GeneralizedAlpha", "Coefficients of a generalized-alpha method.", complete_alpha);
  bind_attributes<SmoothInterval>(m, "SmoothInterval", "A smooth interval of a run, and the current time.");
  bind_attributes<StepControl>(m, "StepControl", "Step-size control.");
  bind_attributes<Grid>(m, "Grid", "Steps of equal size.");
  bind_attributes<SingularityMonitor>(m, "SingularityMonitor", "Pivot ratios, and their thresholds.")
      .def_prop_rw(
          "ratio_by_mode",
          [](const SingularityMonitor& x) { return PivotRatioByMode(x.ratio_by_mode.begin(), x.ratio_by_mode.end()); },
          [](SingularityMonitor& x, const PivotRatioByMode& ratios) {
            x.ratio_by_mode = {ratios.begin(), ratios.end()};
          },
          "Modes, and the largest ratio of each when it was last left.");
  bind_keywords<FirstStep>(m, "FirstStep", "Constants of Hairer's starting step size algorithm.");
  bind_keywords<ParameterLocation>(m, "ParameterLocation",
                                   "Location of a parameter that is written in place, in a body, gravity or a law.");
  bind_keywords<RunStart>(m, "RunStart", "Settings of the start of a run.");
  bind_attributes<Jumps>(m, "Jumps", "Times of possible jumps.");
}

void bind_run(nb::module_& m) {
  bind_attributes<Run>(m, "Run", "Input of a run, and its steps.")
      .def(nb::init<>())
      .def(nb::init<const Run&>(), nb::arg("other"))
      .def_prop_ro("row_changes", [](const Run& r) { return r.steps.changes; })
      .def_prop_ro("after_jumps", [](const Run& r) { return r.steps.after_jumps; })
      .def("carries", carries)
      .def(
          "set_state",
          [](Run& r, const Array& y, const nb::object& carry, const std::optional<Array>& low) {
            r.state = state(y, carry, low);
          },
          nb::arg("y"), nb::arg("carry").none(), nb::arg("low").none())
      .def("state",
           [](const Run& r) {
             return std::make_tuple(vector(r.state.y), carry_of(r.state), optional_vector(r.state.low));
           })
      .def("steps", steps, "Return t (n,), y (n, ...), z (n, nz) and the smallest pivot ratios (n,) at the nodes.");
  m.def("partials_seconds", partials_seconds, nb::arg("core"), nb::arg("q"), nb::arg("v"), nb::arg("repetitions"),
        "Return the seconds of one set of partials.");
}

}  // namespace mbdae
