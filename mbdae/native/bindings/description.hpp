// Reader of a mechanism's description from Python (mbdae/mechanism/formulations/core_description.py).
#pragma once

#include "bindings/structs.hpp"
#include "system/description_reader.hpp"

namespace mbdae {

// Python functions referenced by a core, which the garbage collector must see, because they may refer back to the core;
// and whether one of them was interrupted.
struct Callbacks {
  std::vector<nb::object> functions;
  bool interrupted = false;

  nb::handle add(const nb::dict& d, const char* key) {  // borrowed: lives as long as the core
    if (!d.contains(key)) reject(std::string("missing key ") + key);
    functions.push_back(nb::borrow(d[key]));
    return functions.back();
  }
};

// Reader of a mechanism from Python dicts that contain functions.
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

// Call a Python function with arrays; it returns an array or a number for each of `out`, of the given size.
void call_python(nb::handle f, bool* interrupted, const std::vector<std::pair<const double*, size_t>>& in,
                 const std::vector<Vector*>& out);
}  // namespace mbdae
