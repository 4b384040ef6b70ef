#include "run/in_place_parameters.hpp"

#include "math/field_reader.hpp"

namespace mbdae {

InPlaceParameters::InPlaceParameters(Index2System& s, const std::vector<ParameterLocation>& locations) : s_(s) {
  for (const ParameterLocation& x : locations) {
    double* target = x.kind == ParameterLocation::body      ? s.tree.body_parameter(x.of, x.i)
                     : x.kind == ParameterLocation::gravity ? s.tree.gravity_parameter(x.i)
                                                            : s.law_parameter(x.of, x.i);
    if (!target) reject("the core has no number at the location of a parameter");
    targets_.push_back(target), original_.push_back(*target);
  }
}

bool InPlaceParameters::write(const double* values) {
  if (targets_.empty()) return true;
  for (size_t i = 0; i < targets_.size(); ++i) *targets_[i] = values[i];
  return s_.renew();
}

}  // namespace mbdae
