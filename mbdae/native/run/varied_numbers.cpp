#include "run/varied_numbers.hpp"

#include "math/field_reader.hpp"

namespace mbdae {

VariedNumbers::VariedNumbers(Index2System& s, const std::vector<VariedNumber>& varied) : s_(s) {
  for (const VariedNumber& x : varied) {
    double* target = x.kind == VariedNumber::body      ? s.tree.body_number(x.of, x.i)
                     : x.kind == VariedNumber::gravity ? s.tree.gravity_number(x.i)
                                                       : s.law_number(x.of, x.i);
    if (!target) reject("the core has no number at the location of a parameter");
    targets_.push_back(target), before_.push_back(*target);
  }
}

bool VariedNumbers::write(const double* values) {
  if (targets_.empty()) return true;
  for (size_t i = 0; i < targets_.size(); ++i) *targets_[i] = values[i];
  return s_.renew();
}

}  // namespace mbdae
