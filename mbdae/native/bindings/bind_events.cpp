// Events of a run.
#include "bindings/bindings.hpp"
#include "bindings/structs.hpp"

namespace mbdae {

namespace {

using ValueNodes = std::vector<std::tuple<double, double, double>>;  // time, value and rate

void set_nodes(Events& e, const ValueNodes& nodes) {
  if (nodes.size() != e.events.size()) reject("as many nodes as events");
  for (size_t i = 0; i < nodes.size(); ++i)
    e.nodes[i] = {std::get<0>(nodes[i]), std::get<1>(nodes[i]), std::get<2>(nodes[i])};
  e.located.clear(), e.stopped = false;
}

}  // namespace

void check_events(const Events& e, const Index2System& s) {
  for (const SignalEvent& event : e.events)
    if (!event.signal.is_valid(s)) reject("a signal does not fit the mechanism");
}

void bind_events(nb::module_& m) {
  bind_attributes<Events>(m, "Events", "Events named by signals.")
      .def(
          "set_events",
          [](Events& e, const nb::list& events) {
            e.events = DataReader().read<std::vector<SignalEvent>>(events);
            e.nodes.assign(e.events.size(), Node());
          },
          nb::arg("events"), "Set the events: dicts of a signal, its level, the direction, and whether it is terminal.")
      .def("set_nodes", set_nodes, nb::arg("nodes"), "Set the current time, value and rate of each event.")
      .def_prop_ro("nodes",
                   [](const Events& e) {
                     ValueNodes out;
                     for (const Node& n : e.nodes) out.emplace_back(n.t, n.f, n.w);
                     return out;
                   })
      .def("located", [](const Events& e) {
        std::vector<std::tuple<int, double, Out>> out;
        for (const LocatedEvent& f : e.located) out.emplace_back(f.event, f.t, vector(f.y));
        return out;
      });
}

}  // namespace mbdae
