// Description of a mechanism from Python (mbdae/mechanism/formulations/core_description.py), read and checked.
#pragma once

#include "bindings/structs.hpp"

namespace mbdae {

// Python references of a core: functions, which the garbage collector must see, as they may lead back to the core; and
// whether one of them was interrupted.
struct Callbacks {
  std::vector<nb::object> functions;
  bool interrupted = false;

  nb::handle add(const nb::dict& d, const char* key) {  // borrowed: lives as long as the core
    if (!d.contains(key)) reject(std::string("missing key ") + key);
    functions.push_back(nb::borrow(d[key]));
    return functions.back();
  }
};

// Reads what a mechanism consists of. Indices of pairs and rows are checked afterwards.
class DescriptionReader : public Reader<DescriptionReader> {
 public:
  DescriptionReader(Callbacks& callbacks, const Sizes& n, int states) : callbacks_(callbacks), n_(n), states_(states) {}

  using Reader::read;
  void read(nb::handle h, TimeFunction& out);
  void read(nb::handle h, Row& out);
  void read(nb::handle h, Law& out);
  void read(nb::handle h, SampledController& out);
  void read(nb::handle h, std::shared_ptr<const Profile>& out);

 private:
  std::shared_ptr<const RowFunction> row_function(const nb::dict& d);
  void check_states(int first, int count) const;

  Callbacks& callbacks_;
  const Sizes n_;
  const int states_;  // of all laws
};

// Call Python with arrays, for arrays of these sizes, or a number: see `Callbacks`.
void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Numbers*>& out);
using Anchors = std::vector<std::pair<Anchor, Anchor>>;
void check_indices(const std::vector<int>& x, int n, const char* what);
void check_anchors(const Anchors& pairs, int joints);
void check_rows(const std::vector<Row>& rows, size_t pairs);
void check_laws(const std::vector<Law>& laws, size_t pairs);
void check_bodies(const std::vector<ModalBody>& bodies, int nq, int nv, int joints);
void check_drivers(const std::vector<Driver>& drivers, size_t rows);
void check(const Description& d, const Sizes& n, const Tolerances& tolerances);

}  // namespace mbdae
