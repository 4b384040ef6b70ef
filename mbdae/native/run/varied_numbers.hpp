// Numbers of a mechanism that differ between runs, while its geometry stays (mbdae/mechanism/formats/varied_numbers.py).
#pragma once

#include <vector>

#include "system/index2.hpp"

namespace mbdae {

struct VariedNumber {
  NAMED_ENUM(enum, Kind, body, gravity, law)
  Kind kind;
  int of = 0, i = 0;  // joint of the body, or the law; and the index, see `MultibodyTree` and `Index2System::law_number`

  FIELDS(kind, of, i)
};

class VariedNumbers {
 public:
  // std::invalid_argument for a number that the mechanism does not have.
  VariedNumbers(Index2System& s, const std::vector<VariedNumber>& varied);
  ~VariedNumbers() { write(before_.data()); }  // the values that they had
  VariedNumbers(const VariedNumbers&) = delete;

  size_t count() const { return targets_.size(); }
  bool write(const double* values);  // (count(),); false: they are invalid

 private:
  Index2System& s_;
  std::vector<double*> targets_;
  Numbers before_;
};

}  // namespace mbdae
