// Eigen matrices stored by rows, and views of arrays as such. Their products are lazy: blocked ones, for matrices much
// larger than those of a stage, take long to compile.
#pragma once

#include <Eigen/Core>

namespace mbdae {

template <class T>
using Rows = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowsIn = Eigen::Map<const Rows<double>>;
using RowsOut = Eigen::Map<Rows<double>>;

}  // namespace mbdae
