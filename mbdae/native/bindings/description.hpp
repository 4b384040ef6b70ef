// Description of a mechanism from Python (mbdae/mechanism/formulations/core_description.py), read and checked.
#pragma once

#include "bindings/structs.hpp"
#include "system/description_reader.hpp"

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

// Reads what a mechanism consists of, from dicts with functions.
class PyDescriptionReader final : public DescriptionReader<nb::handle> {
 public:
  PyDescriptionReader(Callbacks& callbacks, const Sizes& n, int states)
      : DescriptionReader(n, states), callbacks_(callbacks) {}

 private:
  void bind_functions(nb::handle h, TimeFunction& out) override;
  void bind_functions(nb::handle h, RowFunction& out) override;
  void bind_functions(nb::handle h, Law& out) override;
  void bind_functions(nb::handle h, SampledController& out) override;
  nb::handle function(nb::handle h, const char* key) { return callbacks_.add(nb::cast<nb::dict>(h), key); }

  Callbacks& callbacks_;
};

// Call Python with arrays, for arrays of these sizes, or a number: see `Callbacks`.
void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Vector*>& out);
}  // namespace mbdae
