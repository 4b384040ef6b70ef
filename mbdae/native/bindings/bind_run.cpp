// Input of a run: tolerances, the tableau, and its state. Fields and units: tolerances.hpp, half_explicit_step.hpp,
// step_control.hpp, time_loop.hpp; for type checkers: mbdae/_native.pyi.
#include <nanobind/stl/complex.h>

#include <chrono>
#include <cmath>

#include "bindings/bindings.hpp"
#include "bindings/py_core.hpp"

namespace mbdae {

namespace {

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

Tolerances make_limits(const nb::kwargs& given) {
  Tolerances out;
  size_t known = 0;
#define TAKE(name) out.name = get<decltype(out.name)>(given, #name), ++known
  TAKE(largest_turn), TAKE(series), TAKE(series_end), TAKE(same_point), TAKE(smallest_pivot);
  TAKE(independent), TAKE(worst_conditioning), TAKE(grown), TAKE(many), TAKE(reason), TAKE(probed);
  TAKE(converged), TAKE(eps), TAKE(spare);
  TAKE(truncation), TAKE(rounding), TAKE(falling), TAKE(open), TAKE(stalled), TAKE(kept), TAKE(iterations), TAKE(unmoved);
  TAKE(row_scales), TAKE(q_scales), TAKE(coordinate_scales);
  TAKE(meeting), TAKE(met), TAKE(halted), TAKE(gaping);
  TAKE(still), TAKE(turned), TAKE(loading), TAKE(loaded), TAKE(settled), TAKE(nothing), TAKE(restages), TAKE(restaged);
#undef TAKE
  if (given.size() != known) refuse("a limit that is not known");
  return out;
}

Radau make_radau(const Array& c, const Array& A, const nb::list& modes, int real, double gamma, const Array& start,
                 int middle, const nb::kwargs& given) {
  Radau r;
  const size_t s = c.size();
  r.s = static_cast<int>(s);
  if (!s || start.size() % s || start.size() / s < 1 || start.size() / s > 2)
    refuse("one or two rows of error weights");
  r.c = numbers(c, s, "c"), r.A = numbers(A, s * s, "A"), r.start = numbers(start, start.size(), "start");
  r.errors = static_cast<int>(start.size() / s), r.gamma = gamma;
  for (nb::handle h : modes) {
    const auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 3) refuse("a mode is a value, a column and a row");
    EigenMode m{nb::cast<std::complex<double>>(x[0]), nb::cast<std::vector<std::complex<double>>>(x[1]),
           nb::cast<std::vector<std::complex<double>>>(x[2])};
    if (m.column.size() != s || m.row.size() != s) refuse("a mode has as many numbers as stages");
    r.modes.push_back(m);
  }
  r.real = real, r.middle = middle;
  if (real < -1 || real >= static_cast<int>(r.modes.size()) || middle < 0 || middle >= r.s) refuse("out of range");
  for (const Numbers* x : {&r.c, &r.A, &r.start})
    for (double v : *x)
      if (!std::isfinite(v)) refuse("a method is finite");
  size_t known = 0;
#define TAKE(name) r.name = get<decltype(r.name)>(given, #name), ++known
  TAKE(patience), TAKE(short_patience), TAKE(further), TAKE(first), TAKE(tolerance), TAKE(near), TAKE(expected);
  TAKE(reuse), TAKE(share);
#undef TAKE
  if (given.size() != known) refuse("a threshold that is not known");
  return r;
}

// Seconds of one evaluation of all partials.
double partials_seconds(PyCore& c, const Array& q, const Array& v, int repetitions) {
  const CoreLock turn(c);
  Index2System& s = c.core->system;
  if (!s.mechanics.expanded()) refuse("partials need the expanded tree");
  Numbers at = numbers(q, s.nq, "q"), u = numbers(v, s.nv, "v"), vdot(s.nv), lam(s.ng);
  u.resize(s.ny - s.nv);
  Numbers other(u);  // alternating: no cached point when partials are computed
  other[0] += 1;
  const Counts counts = s.counts;
  EquationPartials out;
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < repetitions; ++i) {
    s.partials(0, at.data(), u.data(), vdot.data(), lam.data(), out);
    std::swap(u, other);
  }
  s.counts = counts, s.point.forget();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / repetitions;
}

}  // namespace

void bind_radau(nb::module_& m) {
  nb::class_<StageMemory>(m, "StageMemory", "What a step of a collocation method leaves to the next one.");
  nb::class_<Radau>(m, "Radau", "Coefficients of a collocation method, and thresholds of its iteration.")
      .def(
          "__init__",
          [](Radau* self, const Array& c, const Array& A, const nb::list& modes, int real, double gamma,
             const Array& start, int middle, const nb::kwargs& given) {
            new (self) Radau(make_radau(c, A, modes, real, gamma, start, middle, given));
          },
          nb::arg("c"), nb::arg("A"), nb::arg("modes"), nb::arg("real"), nb::arg("gamma"), nb::arg("start"),
          nb::arg("middle"), nb::arg("given"));
}

void bind_limits(nb::module_& m) {
  nb::class_<Tolerances>(m, "Tolerances", "Thresholds of points and steps.")
      .def("__init__", [](Tolerances* self, const nb::kwargs& given) { new (self) Tolerances(make_limits(given)); });
}

void bind_tableau(nb::module_& m) {
  nb::class_<Tableau>(m, "Tableau", "Coefficients of a half-explicit method.")
      .def(
          "__init__",
          [](Tableau* self, const Array& A, const Array& Ahat, const Array& b, const Array& c, const Array& chat,
             const Array& e, bool first, bool project, int doubled, double noise) {
            new (self) Tableau(make_tableau(A, Ahat, b, c, chat, e, first, project, doubled, noise));
          },
          nb::arg("A"), nb::arg("Ahat"), nb::arg("b"), nb::arg("c"), nb::arg("chat"), nb::arg("e"), nb::arg("first"),
          nb::arg("project"), nb::arg("doubled"), nb::arg("noise"));
}

void bind_run(nb::module_& m) {
#define FIELD(of, name) .def_rw(#name, &of::name)
  nb::class_<SmoothInterval>(m, "SmoothInterval", "Where a leg of a run stands, and where it ends.") FIELD(SmoothInterval, t) FIELD(SmoothInterval, sign)
      FIELD(SmoothInterval, stop) FIELD(SmoothInterval, end) FIELD(SmoothInterval, t1);
  nb::class_<StepControl>(m, "StepControl", "Steps under error control.") FIELD(StepControl, h) FIELD(StepControl, cut)
      FIELD(StepControl, last) FIELD(StepControl, rejected) FIELD(StepControl, largest) FIELD(StepControl, rtol)
          FIELD(StepControl, atol) FIELD(StepControl, nothing) FIELD(StepControl, companion) FIELD(StepControl, blend)
              FIELD(StepControl, power)
              FIELD(StepControl, exponent) FIELD(StepControl, last_exponent) FIELD(StepControl, safety)
                  FIELD(StepControl, smallest_factor) FIELD(StepControl, largest_factor)
                      FIELD(StepControl, steady) FIELD(StepControl, smallest_error) FIELD(StepControl, smallest_last) FIELD(StepControl, nearly)
                          FIELD(StepControl, spacings);
  nb::class_<Grid>(m, "Grid", "Steps of equal size.") FIELD(Grid, i) FIELD(Grid, on_grid) FIELD(Grid, step)
      FIELD(Grid, t0) FIELD(Grid, n) FIELD(Grid, near);
  nb::class_<SingularityMonitor>(m, "SingularityMonitor", "Ratios of pivots.") FIELD(SingularityMonitor, usual) FIELD(
      SingularityMonitor, before) FIELD(SingularityMonitor, suspect) FIELD(SingularityMonitor, landed) FIELD(SingularityMonitor, zone)
      FIELD(SingularityMonitor, ahead) FIELD(SingularityMonitor, entered);
  nb::class_<Run>(m, "Run", "What a run hands over, and the steps that were taken.")
      .def(nb::init<>()) FIELD(Run, events) FIELD(Run, jumps) FIELD(Run, leg) FIELD(Run, control) FIELD(Run, grid) FIELD(Run, watch) FIELD(Run, adaptive)
          FIELD(Run, project) FIELD(Run, watched) FIELD(Run, tolerated) FIELD(Run, taken_back) FIELD(Run, nothing)
          FIELD(Run, seconds) FIELD(Run, budget) FIELD(Run, kept)
      .def_ro("taken", &Run::taken)
      .def_ro("rejected", &Run::rejected)
      .def_ro("stuck", &Run::stuck)
      .def_prop_ro("changes", [](const Run& r) { return r.steps.changes; })
      .def_prop_ro("behind", [](const Run& r) { return r.steps.behind; })
      .def(
          "carried",
          [](const Run& r) {
            const size_t n = std::min(r.steps.t.size(), static_cast<size_t>(std::max(r.kept, 0L)));
            return nb::make_tuple(array(r.steps.carry, {n, n ? r.steps.carry.size() / n : 0}), r.steps.renewed);
          },
          "Return what the method carries from the first nodes (k, nc), and at which of them it was found anew.")
      .def(
          "begin",
          [](Run& r, const Array& y, const nb::object& carry, const nb::object& low) {
            r.state = state(y, carry, low);
          },
          nb::arg("y"), nb::arg("carry").none(), nb::arg("low").none(), "Set the state.")
      .def(
          "state",
          [](const Run& r) { return nb::make_tuple(vector(r.state.y), carried(r.state), maybe(r.state.low)); },
          "Return y, carry and low.")
      .def(
          "steps",
          [](const Run& r) {
            const Steps& s = r.steps;
            const size_t n = s.t.size();
            return nb::make_tuple(vector(s.t), array(s.y, {n, n ? s.y.size() / n : 0}),
                                  array(s.z, {n, n ? s.z.size() / n : 0}), vector(s.least_pivot_ratio));
          },
          "Return t (n,), y (n, ...), z (n, nz) and the smallest ratios of pivots (n,) at the nodes.");
#undef FIELD
  m.def("partials_seconds", partials_seconds, nb::arg("core"), nb::arg("q"), nb::arg("v"), nb::arg("repetitions"),
        "Return the seconds of one set of partials.");
}

}  // namespace mbdae
