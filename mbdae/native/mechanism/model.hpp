// Transfer of a model from Python to the core, in pinocchio_tree.cpp and pinocchio_stage.cpp.
#pragma once

#include <Python.h>

#include <array>

namespace mbdae {

const void* model_pointer(PyObject* model);         // address of a pinocchio.Model; otherwise std::invalid_argument
std::array<int, 3> model_sizes(const void* model);  // nq, nv, number of joints
bool sweep_supports(const void* model);             // whether TreeSweep supports all its joints
// Seconds of one crba, nle, Cholesky factorization of M and solution of the saddle-point system with G (r, nv) by rows,
// all but the last by Pinocchio: the minimum cost of a stage.
double pinocchio_stage_seconds(const void* model, const double* q, const double* v, int r, const double* G,
                               int repetitions);

}  // namespace mbdae
