// A core as Python holds it: made of core data, used by one thread at a time.
#pragma once

#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <thread>
#include <tuple>

#include "bindings/bindings.hpp"
#include "steps/formulations.hpp"
#include "mechanism/model.hpp"

namespace mbdae {

struct Core {
  Core(const void* model, const Tolerances& limits, Description d)
      : system(model, limits, std::move(d)), step(half_explicit_step(system)), stages(collocation_step(system)) {}
  Index2System system;
  std::unique_ptr<HalfExplicitStep> step;
  std::unique_ptr<CollocationStep> stages;
};

struct PyCore {
  PyCore(nb::handle model_, const Tolerances& limits, bool flat, const nb::list& pair_list, const nb::list& row_list,
         const nb::list& driver_list, const nb::list& law_pair_list, const nb::list& law_list, int ns,
         const nb::list& block_list, std::vector<int> turning, const nb::list& angle_list, std::vector<int> place,
         std::vector<double> probe, const std::string& formulation, double alpha, double beta)
      : model(nb::borrow(model_)), callbacks(new Callbacks) {
    const void* m = model_pointer(model_.ptr());
    const auto size = model_sizes(m);
    const Sizes n{size[0], size[1], size[2]};
    if (ns < 0 || ns > 1000000 || static_cast<int>(turning.size()) != n.nv || probe.size() != turning.size())
      refuse("sizes do not fit the model");
    if (flat && n.nq != n.nv) refuse("a flat manifold has nq = nv");
    if (limits.row_scales.size() != row_list.size() || static_cast<int>(limits.q_scales.size()) != n.nq ||
        static_cast<int>(limits.coordinate_scales.size()) != n.nv)
      refuse("as many scales as rows, coordinates and velocities");
    Description out;
    static const std::map<std::string, Formulation> formulations = {
        {"index2", Formulation::index2}, {"ggl", Formulation::ggl}, {"index1", Formulation::index1}};
    out.formulation = kind(formulations, formulation), out.alpha = alpha, out.beta = beta;
    if (!std::isfinite(alpha) || !std::isfinite(beta)) refuse("alpha and beta are finite");
    out.flat = flat, out.ns = ns, out.turning = std::move(turning), out.probe = std::move(probe);
    std::vector<int> places(place);
    std::sort(places.begin(), places.end());
    for (size_t i = 0; i < places.size(); ++i)
      if (places[i] != static_cast<int>(i)) refuse("places are 0, 1, ... in some order");
    if (place.size() != row_list.size()) refuse("as many places as rows");
    out.place = std::move(place);
    out.pairs = pairs(pair_list, n.joints), out.law_pairs = pairs(law_pair_list, n.joints);
    for (nb::handle h : row_list) out.rows.push_back(row(nb::cast<nb::dict>(h), n, static_cast<int>(out.pairs.size()), *callbacks));
    for (nb::handle h : driver_list) out.drivers.push_back(driver(nb::cast<nb::dict>(h), out.rows.size(), *callbacks));
    for (nb::handle h : law_list) {
      int pair;
      out.laws.push_back(law(nb::cast<nb::dict>(h), n, ns, static_cast<int>(out.law_pairs.size()), pair, *callbacks));
      out.pair_of_law.push_back(pair);
    }
    static const std::map<std::string, Block::Kind> kinds = {
        {"so3", Block::so3}, {"se3", Block::se3}, {"se2", Block::se2}};
    for (nb::handle h : block_list) {
      const auto [name, at, place] = nb::cast<std::tuple<std::string, int, int>>(h);
      const Block b{kind(kinds, name), at, place};
      within({b.at, b.at + (b.kind == Block::se3 ? 5 : 2)}, n.nv, "block");
      within({b.place, b.place + (b.kind == Block::se3 ? 6 : 3)}, n.nq, "block");
      out.blocks.push_back(b);
    }
    for (nb::handle h : angle_list) {
      const auto [at, place] = nb::cast<std::pair<int, int>>(h);
      within({at}, n.nv, "angle"), within({place, place + 1}, n.nq, "angle");
      out.angles.push_back({at, place});
    }
    core.reset(new Core(m, limits, std::move(out)));
  }

  void check(const State& s, const Tableau* t = nullptr) const {
    const Index2System& x = core->system;
    if (static_cast<int>(s.y.size()) != x.length) refuse("y has the wrong length");
    if (!t && !x.mechanics.expanded()) refuse("implicit methods need the expanded tree");
    if (t && t->explicit_first && static_cast<int>(s.carry.size()) != x.carried())
      refuse("the method needs a carried derivative");
    if (!s.low.empty() && static_cast<int>(s.low.size()) != x.ny) refuse("low has the wrong length");
  }

  nb::object model, expanded;  // kept alive
  Active active;
  Headings heading;
  bool busy = false;  // read and written under the interpreter's lock
  std::thread::id owner;
  std::unique_ptr<Callbacks> callbacks;
  std::unique_ptr<Core> core;
};

// A core executes one call at a time: other threads wait, and a force law called by it cannot call it.
struct CoreLock {
  explicit CoreLock(PyCore& c) : busy(c.busy) {
    while (busy) {
      if (c.owner == std::this_thread::get_id())
        throw std::runtime_error("the core is in use: bind a workspace of its own by Mechanism.system()");
      nb::gil_scoped_release release;
      std::this_thread::sleep_for(std::chrono::microseconds(50));
    }
    busy = true, c.owner = std::this_thread::get_id();
  }
  ~CoreLock() { busy = false; }
  bool& busy;
};

// Execute one call; a failure in the core returns None, and Ctrl-C in a Python function is raised.
template <class F>
nb::object attempt(PyCore& c, F&& compute) {
  const CoreLock lock(c);
  c.callbacks->interrupted = false;
  try {
    return compute(c.core->system);
  } catch (const FallBackToPython&) {
    if (c.callbacks->interrupted) throw nb::python_error();
    return nb::none();
  }
}

// The same for many points or steps, concurrently with other threads; failures are reported in the results.
template <class F>
void run_unlocked(PyCore& c, F&& compute) {
  c.callbacks->interrupted = false;
  {
    nb::gil_scoped_release release;
    compute();
  }
  if (c.callbacks->interrupted) throw nb::python_error();
}

void bind_points(nb::class_<PyCore>& core);
void bind_tangents(nb::module_& m, nb::class_<PyCore>& core);

}  // namespace mbdae
