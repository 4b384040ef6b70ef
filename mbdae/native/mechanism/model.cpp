#include <pinocchio/multibody.hpp>

#include <boost/python/extract.hpp>

#include <stdexcept>

#include "mechanism/model.hpp"

namespace mbdae {

const void* model_pointer(PyObject* object) {
  boost::python::extract<const pinocchio::Model&> extract(object);
  if (!extract.check()) throw std::invalid_argument("expected a pinocchio.Model");
  return &extract();
}

std::array<int, 3> model_sizes(const void* pointer) {
  const auto& model = *static_cast<const pinocchio::Model*>(pointer);
  return {model.nq, model.nv, model.njoints};
}

}  // namespace mbdae
