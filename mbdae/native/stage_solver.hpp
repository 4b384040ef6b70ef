// Linear systems of a stage of a collocation method, one for each mode (mbdae/mechanism/formulations/implicit.py).
#pragma once

#include <Eigen/Core>

#include "collocation.hpp"

namespace mbdae {

using Complex = std::complex<double>;
template <class T>
using Rows = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
template <class T>
using Vector = Eigen::Matrix<T, Eigen::Dynamic, 1>;
using RowsIn = Eigen::Map<const Rows<double>>;
using RowsOut = Eigen::Map<Rows<double>>;
using In = Eigen::Map<const Vector<double>>;

// The system of one stage for a mode, real or complex.
class StageSolver {
 public:
  virtual ~StageSolver() = default;
  // r (ny,) becomes the change of x', c (r,) that of z; complex numbers of a real mode have no imaginary part.
  virtual void solve(Vector<Complex>& r, Vector<Complex>& c) const = 0;
};

std::shared_ptr<const StageSolver> solver(const std::shared_ptr<const LinearizedStages>& slopes, int nv, Complex mu);

}  // namespace mbdae
