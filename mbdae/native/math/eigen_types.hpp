// Row-major Eigen matrices, and views of arrays as such matrices. Use their lazy products: blocked products are faster
// only for matrices much larger than those of a stage, and take long to compile.
#pragma once

#include <Eigen/Core>

namespace mbdae {

template <class T>
using Rows = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMatrixMap = Eigen::Map<const Rows<double>>;
using MatrixMap = Eigen::Map<Rows<double>>;

}  // namespace mbdae
