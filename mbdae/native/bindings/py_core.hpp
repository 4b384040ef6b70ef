// The core object of the Python module: built from core data, used by one thread at a time.
#pragma once

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>

#include "bindings/bindings.hpp"
#include "bindings/description.hpp"
#include "mechanism/model.hpp"
#include "run/core.hpp"

namespace mbdae {

using Active = nb::ndarray<std::uint8_t, nb::c_contig, nb::device::cpu>;
using Directions = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

struct PyCore {
  PyCore(nb::handle model_, const Tolerances& tolerances, const nb::dict& description)
      : model(nb::borrow(model_)), callbacks(new Callbacks) {
    core.reset(new Core(model_pointer(model_.ptr()), tolerances, read(model_, tolerances, description)));
  }

  // Write the parameters of a mechanism of the same structure in place; false if its structure differs.
  bool write(nb::handle model_, const Tolerances& tolerances, const nb::dict& description) {
    const void* m = model_pointer(model_.ptr());
    const Index2System& s = core->system;
    if (model_sizes(m) != std::array<int, 3>{s.nq, s.nv, s.tree.joints}) return false;
    const size_t old_count = callbacks->functions.size();  // kept until no law refers to them
    if (!core->system.write(m, tolerances, read(model_, tolerances, description))) return false;
    core->system.samplers.clear();
    callbacks->functions.erase(callbacks->functions.begin(), callbacks->functions.begin() + old_count);
    model = nb::borrow(model_);
    return true;
  }

  Description read(nb::handle model_, const Tolerances& tolerances, const nb::dict& description) {
    const auto size = model_sizes(model_pointer(model_.ptr()));
    const Sizes n{size[0], size[1], size[2]};
    const int ns = nb::cast<int>(item(description, "ns"));
    if (ns < 0 || ns > 1000000) reject("ns is out of range");
    auto d = PyDescriptionReader(*callbacks, n, ns).read<Description>(description);
    mbdae::check(d, n, tolerances);
    return d;
  }

  void check(const State& s, const Tableau* t = nullptr) const {
    const Index2System& x = core->system;
    if (static_cast<int>(s.y.size()) != x.length) reject("y has the wrong length");
    if (!t && !x.tree.expanded()) reject("implicit methods require the expanded tree");
    if (t && t->explicit_first && static_cast<int>(s.carry.size()) != x.carry_length())
      reject("the method requires a carry of the right length");
    if (!s.low.empty() && static_cast<int>(s.low.size()) != x.ny) reject("low has the wrong length");
  }

  PyDescriptionReader reader() {
    const Index2System& s = core->system;
    return PyDescriptionReader(*callbacks, {s.nq, s.nv, s.tree.joints}, s.ns);
  }

  nb::object model, expanded;  // kept alive
  Active active;
  Directions directions;
  bool busy = false;  // read and written under the global interpreter lock
  std::thread::id owner;
  std::unique_ptr<Callbacks> callbacks;
  std::unique_ptr<Core> core;
};

// A core executes one call at a time: other threads wait, and a force law called by it cannot call it.
struct CoreLock {
  explicit CoreLock(PyCore& c) : busy(c.busy) {
    while (busy) {
      if (c.owner == std::this_thread::get_id())
        throw std::runtime_error("the core is in use: bind another workspace by Mechanism.system()");
      nb::gil_scoped_release release;
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    busy = true, c.owner = std::this_thread::get_id();
    c.core->system.tree.refresh();
  }
  ~CoreLock() { busy = false; }
  bool& busy;
};

// Execute one call; return None if the core fails, and raise Ctrl-C of a Python function.
template <class F>
auto attempt(PyCore& c, F&& compute) -> std::optional<decltype(compute(c.core->system))> {
  const CoreLock lock(c);
  c.callbacks->interrupted = false;
  try {
    return compute(c.core->system);
  } catch (const FallBackToPython&) {
    if (c.callbacks->interrupted) throw nb::python_error();
    return std::nullopt;
  }
}

// Execute a call for many points or steps without the global interpreter lock; the results report failures.
template <class F>
void run_unlocked(PyCore& c, F&& compute) {
  c.callbacks->interrupted = false;
  {
    nb::gil_scoped_release release;
    compute();
  }
  if (c.callbacks->interrupted) throw nb::python_error();
}

inline const Tableau* tableau_of(const Tableau& a) { return &a; }

template <class Coefficients>
const Tableau* tableau_of(const Coefficients&) {
  return nullptr;
}

inline void check_atol(const Index2System& s, const Vector& atol) {
  const size_t n = atol.size();
  if (n != 1 && n != static_cast<size_t>(s.controlled_components())) reject("atol has the wrong length");
}

template <class Coefficients>
void check_run(const PyCore& c, const Coefficients& a, const Method& method, const Run& run, const State& first) {
  c.check(first, tableau_of(a));
  if (run.adaptive) check_atol(c.core->system, run.control.atol);
  if (run.adaptive && !method.errors) reject("the tableau has no error estimate");
  check_events(run.events, c.core->system), check(run.modes, c.core->system);
}

inline void take_steps(PyCore& c, Method& method, Run& run) {
  if (!run.continued) run.steps = Steps(), run.taken = run.rejected = 0, run.monitor.suspicious = false;
  run.needs_python = run.modes.undecided = false, run.modes.transitions.clear();
  run_unlocked(c, [&] { TimeLoop(method, c.core->system, run).advance(); });
}

void bind_points(nb::class_<PyCore>& core);
void bind_start(nb::class_<PyCore>& core);
void bind_sensitivity(nb::module_& m, nb::class_<PyCore>& core);

}  // namespace mbdae
