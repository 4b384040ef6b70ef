// What the core asks of Pinocchio, in types of Eigen alone: files that include this compile in seconds.
#pragma once

#include <Python.h>

#include <Eigen/Core>

namespace mbdae {

// M(q) (nv, nv), symmetric, of the pin.Model that `model` points to; std::invalid_argument for what is none.
Eigen::MatrixXd mass_matrix(PyObject* model, const Eigen::Ref<const Eigen::VectorXd>& q);

}  // namespace mbdae
