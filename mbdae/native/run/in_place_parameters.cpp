// Addresses of parameters in the core, and their values.
#include "run/in_place_parameters.hpp"

#include "math/field_reader.hpp"
#include "mechanism/tree_model.hpp"

namespace mbdae {

InPlaceParameters::InPlaceParameters(Index2System& s, const std::vector<ParameterLocation>& locations) : s_(s) {
  for (const ParameterLocation& x : locations) {
    double* target = x.kind == ParameterLocation::body      ? s.tree.body_parameter(x.of, x.i)
                     : x.kind == ParameterLocation::gravity ? s.tree.gravity_parameter(x.i)
                                                            : s.law_parameter(x.of, x.i);
    if (!target) reject("the core has no parameter at this location");
    targets_.push_back(target), original_.push_back(*target);
  }
}

bool InPlaceParameters::write(const double* values) {
  if (targets_.empty()) return true;
  for (size_t i = 0; i < targets_.size(); ++i) *targets_[i] = values[i];
  return s_.update_parameters();
}

Vector InPlaceParameters::mass_matrices(const double* q, const Vector& values) {
  const auto algorithms = tree_algorithms(s_.tree.source());
  const size_t n = s_.nv * s_.nv;
  Vector poses(12 * s_.tree.joints), J(6 * s_.nv), out;
  for (size_t i = 0; i < values.size(); i += count()) {
    write(&values[i]);
    const double* M = algorithms->inertia(q, poses.data(), J.data());
    out.insert(out.end(), M, M + n);
  }
  return out;
}

}  // namespace mbdae
