// The start of a run.
#include "bindings/py_core.hpp"
#include "system/start.hpp"

namespace mbdae {

namespace {

auto start_at(PyCore& c, double t, const Array& y, bool project, double ambiguous, double fallen, double dependent) {
  return attempt(c, [&](Index2System& s) {
    Numbers at = checked_numbers(y, s.length, "y"), F(s.ny), z(s.ng);
    start(s, t, project, {ambiguous, fallen, dependent}, at, F, z);
    return std::make_tuple(vector(at), vector(F), vector(z), s.rows.in_use(), s.rows.floor);
  });
}

auto others_depend(PyCore& c, const Array& q, double tolerance) {
  return attempt(c, [&](Index2System& s) {
    return (s.others_depend(checked_numbers(q, s.nq, "q").data(), tolerance));
  });
}

auto step_size(PyCore& c, double t, const Array& y, const Array& F, double sign, double left, double rtol,
                     const Array& atol, double power, double small, double default_step, double reduction, double change,
                     double growth, double flat, double nothing) {
  return attempt(c, [&](Index2System& s) {
    const size_t n = atol.size();
    if (n != 1 && n != static_cast<size_t>(s.controlled_components())) reject("atol has the wrong length");
    const FirstStep given{sign, left, rtol, checked_numbers(atol, n, "atol"), power, small, default_step, reduction, change, growth, flat, nothing};
    return first_step(s, t, checked_numbers(y, s.length, "y"), checked_numbers(F, s.ny, "F"), given);
  });
}

}  // namespace

void bind_start(nb::class_<PyCore>& core) {
  core.def("start", start_at, nb::arg("t"), nb::arg("y"), nb::arg("project"), nb::arg("ambiguous"), nb::arg("fallen"),
           nb::arg("dependent"),
           "Determine rank and rows in use; return y, y' (ny,), lam (ng,), the rows and the smallest ratio of pivots, or None.")
      .def("others_depend", others_depend, nb::arg("q"), nb::arg("tolerance"),
           "Return whether the other rows depend on those in use at q, or None.")
      .def("first_step", step_size, nb::arg("t"), nb::arg("y"), nb::arg("F"), nb::arg("sign"), nb::arg("left"),
           nb::arg("rtol"), nb::arg("atol"), nb::arg("power"), nb::arg("small"), nb::arg("default_step"), nb::arg("reduction"),
           nb::arg("change"), nb::arg("growth"), nb::arg("flat"), nb::arg("nothing"), "Return the first step size in s, or None.");
}

}  // namespace mbdae
