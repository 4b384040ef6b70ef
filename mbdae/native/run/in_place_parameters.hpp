// Parameters that are written in place between runs: they do not change the structure of the mechanism
// (mbdae/mechanism/formats/in_place_parameters.py).
#pragma once

#include <vector>

#include "system/index2.hpp"

namespace mbdae {

struct ParameterLocation {  // location of a parameter in the core
  NAMED_ENUM(enum, Kind, body, gravity, law)
  Kind kind;
  int of = 0, i = 0;  // of: joint of the body, or law; i: index, see `body_parameter`, `law_parameter`

  FIELDS(kind, of, i)
};

class InPlaceParameters {
 public:
  // std::invalid_argument: a location does not exist.
  InPlaceParameters(Index2System& s, const std::vector<ParameterLocation>& locations);
  ~InPlaceParameters() { write(original_.data()); }  // restores the values
  InPlaceParameters(const InPlaceParameters&) = delete;

  size_t count() const { return targets_.size(); }
  bool write(const double* values);                             // (count(),); false: invalid values
  Vector mass_matrices(const double* q, const Vector& values);  // (k, nv, nv) for values (k, count()), by Pinocchio

 private:
  Index2System& s_;
  std::vector<double*> targets_;
  Vector original_;
};

}  // namespace mbdae
