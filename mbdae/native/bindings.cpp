// The Python module mbdae._native. No type of Pinocchio is seen here: this file compiles in seconds.
#include <nanobind/eigen/dense.h>
#include <nanobind/nanobind.h>

#include "model.hpp"

namespace nb = nanobind;

NB_MODULE(_native, m) {
  m.doc() = "The compiled core of mbdae.";
  m.def("version", [] { return MBDAE_PINOCCHIO_VERSION; }, "Version of Pinocchio that the core was built for.");
  m.def(
      "mass_matrix",
      [](nb::handle model, const Eigen::Ref<const Eigen::VectorXd>& q) { return mbdae::mass_matrix(model.ptr(), q); },
      nb::arg("model"), nb::arg("q"), "M(q) of a pinocchio.Model, (nv, nv).");
}
