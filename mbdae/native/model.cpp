// The calls of Pinocchio. Arguments are Eigen::Ref<const VectorXd>, for which the library holds instantiations.
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/crba.hpp>

#include <boost/python/extract.hpp>

#include <stdexcept>

#include "model.hpp"

namespace mbdae {

static const pinocchio::Model& model_of(PyObject* object) {
  boost::python::extract<const pinocchio::Model&> extract(object);
  if (!extract.check()) throw std::invalid_argument("expected a pinocchio.Model");
  return extract();
}

Eigen::MatrixXd mass_matrix(PyObject* object, const Eigen::Ref<const Eigen::VectorXd>& q) {
  const pinocchio::Model& model = model_of(object);
  if (q.size() != model.nq) throw std::invalid_argument("q has the wrong size");
  pinocchio::Data data(model);
  pinocchio::crba(model, data, q, pinocchio::Convention::WORLD);
  data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose().triangularView<Eigen::StrictlyLower>();
  return data.M;
}

}  // namespace mbdae
