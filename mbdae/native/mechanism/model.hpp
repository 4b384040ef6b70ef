// Transfer of a model from Python to the core, in mechanics.cpp.
#pragma once

#include <Python.h>

#include <array>

namespace mbdae {

const void* model_pointer(PyObject* model);         // of a pinocchio.Model; std::invalid_argument for any other object
std::array<int, 3> model_sizes(const void* model);  // nq, nv, number of joints
bool model_sweeps(const void* model);               // are all its joints known to TreeSweep?

}  // namespace mbdae
