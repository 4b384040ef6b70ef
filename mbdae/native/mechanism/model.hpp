// Transfer of a model from Python to the core, in pinocchio_tree.cpp and bare_stage.cpp.
#pragma once

#include <Python.h>

#include <array>

namespace mbdae {

const void* model_pointer(PyObject* model);         // of a pinocchio.Model; std::invalid_argument for any other object
std::array<int, 3> model_sizes(const void* model);  // nq, nv, number of joints
bool model_sweeps(const void* model);               // are all its joints known to TreeSweep?
// Seconds of one crba, nle, Cholesky factorization of M and solve of the saddle-point system with G (r, nv) by rows,
// all but the last with the routines of Pinocchio: the minimum cost of a stage.
double bare_stage_seconds(const void* model, const double* q, const double* v, int r, const double* G,
                          int repetitions);

}  // namespace mbdae
