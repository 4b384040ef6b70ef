#include "run/varied_numbers.hpp"

#include "math/field_reader.hpp"

namespace mbdae {

VariedNumbers::VariedNumbers(Index2System& s, const std::vector<VariedNumber>& numbers) : s_(s) {
  for (const VariedNumber& x : numbers) {
    double* place = x.kind == VariedNumber::body      ? s.tree.body_number(x.of, x.i)
                    : x.kind == VariedNumber::gravity ? s.tree.gravity_number(x.i)
                                                      : s.law_number(x.of, x.i);
    if (!place) reject("the mechanism does not have a varied number");
    places_.push_back(place), before_.push_back(*place);
  }
}

bool VariedNumbers::write(const double* values) {
  if (places_.empty()) return true;
  for (size_t i = 0; i < places_.size(); ++i) *places_[i] = values[i];
  return s_.renew();
}

}  // namespace mbdae
