// Events and jumps of a run; fields and units: event_detection.hpp, jumps.hpp; for type checkers: mbdae/_native.pyi.
#include <nanobind/stl/tuple.h>

#include "bindings/bindings.hpp"

namespace mbdae {

namespace {


void watch(Events& e, const nb::list& list) {
  e.events.clear(), e.nodes.clear();
  for (nb::handle h : list) {
    const auto x = nb::cast<nb::tuple>(h);
    if (x.size() != 4) refuse("an event is a signal, a level, a direction, and whether it ends a run");
    const auto signal = nb::cast<nb::tuple>(x[0]);
    if (signal.size() != 4) refuse("a signal is a kind, two numbers and rows");
    SignalEvent event;
    event.signal = {kind(SIGNAL_KINDS, nb::cast<std::string>(signal[0])), nb::cast<int>(signal[1]),
                    nb::cast<int>(signal[2]), nb::cast<std::vector<int>>(signal[3])};
    event.level = nb::cast<double>(x[1]), event.direction = nb::cast<int>(x[2]), event.terminal = nb::cast<bool>(x[3]);
    e.events.push_back(event);
  }
  e.nodes.resize(e.events.size());
}

void stand(Events& e, const std::vector<std::tuple<double, double, double>>& nodes) {
  if (nodes.size() != e.events.size()) refuse("as many nodes as events");
  for (size_t i = 0; i < nodes.size(); ++i)
    e.nodes[i] = {std::get<0>(nodes[i]), std::get<1>(nodes[i]), std::get<2>(nodes[i])};
  e.found.clear(), e.stopped = false;
}

nb::list nodes(const Events& e) {
  nb::list out;
  for (const Node& n : e.nodes) out.append(nb::make_tuple(n.t, n.f, n.w));
  return out;
}

nb::list found(const Events& e) {
  nb::list out;
  for (const LocatedEvent& f : e.found) out.append(nb::make_tuple(f.event, f.t, vector(f.y)));
  return out;
}

}  // namespace

void check_events(const Events& e, const Index2System& s) {
  for (const SignalEvent& event : e.events)
    if (!event.signal.fits(s)) refuse("a signal does not fit the mechanism");
}

void bind_events(nb::module_& m) {
  nb::class_<Events>(m, "Events", "Signals that are watched.")
      .def("watch", watch, nb::arg("events"), "Set signals, levels, directions, and whether they end a run.")
      .def("stand", stand, nb::arg("nodes"), "Set time, value and rate where each of them stands.")
      .def_prop_ro("nodes", nodes)
      .def_prop_ro("found", found)
      .def_ro("stopped", &Events::stopped)
      .def_rw("start", &Events::start)
      .def_rw("same", &Events::same)
      .def_rw("spacings", &Events::spacings)
      .def_rw("share", &Events::share)
      .def_rw("iterations", &Events::iterations);
  nb::class_<Jumps>(m, "Jumps", "Times at which a problem may jump.")
      .def_rw("crossed", &Jumps::crossed)
      .def_rw("times", &Jumps::times)
      .def_rw("margin", &Jumps::margin)
      .def_rw("crowd", &Jumps::crowd)
      .def_rw("restart", &Jumps::restart);
}

}  // namespace mbdae
