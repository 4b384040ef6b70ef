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

// Size, level, time of return, unit and time of the last impact.
using GuardStates = std::vector<std::tuple<double, double, double, double, double>>;

GuardStates guard_states(const ContactGuards& c) {
  GuardStates out;
  for (const ContactGuard& x : c.guards) out.emplace_back(x.size, x.level, x.return_time, x.unit, x.last_impact);
  return out;
}

void set_guard_states(ContactGuards& c, const GuardStates& states) {
  if (states.size() != c.guards.size()) reject("as many states as guards");
  for (size_t i = 0; i < states.size(); ++i) {
    ContactGuard& x = c.guards[i];
    std::tie(x.size, x.level, x.return_time, x.unit, x.last_impact) = states[i];
  }
}

// Node, guard, work and impulses of all rows.
std::vector<std::tuple<long, int, double, Numbers>> impacts(const ContactGuards& c) {
  std::vector<std::tuple<long, int, double, Numbers>> out;
  for (const Rebound& x : c.impacts) out.emplace_back(x.node, x.guard, x.work, x.impulses);
  return out;
}

}  // namespace

void check_events(const Events& e, const Index2System& s) {
  for (const SignalEvent& event : e.events)
    if (!event.signal.is_valid(s)) reject("a signal does not fit the mechanism");
}

void check_contacts(const ContactGuards& c, const Index2System& s) {
  for (const ContactGuard& guard : c.guards)
    if (guard.row < 0 || guard.row >= s.ng || guard.no_slip >= s.ng) reject("a guard does not fit the mechanism");
}

void bind_events(nb::module_& m) {
  bind_attributes<Events>(m, "Events", "Events named by signals.")
      .def(
          "set_events",
          [](Events& e, const nb::list& events) {
            e.events = PyReader().read<std::vector<SignalEvent>>(events);
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
  bind_attributes<ContactGuards>(m, "ContactGuards", "Guards of contacts, and impacts at which one of them rebounds.")
      .def(
          "set_guards",
          [](ContactGuards& c, const nb::list& guards) {
            c.guards = PyReader().read<std::vector<ContactGuard>>(guards);
          },
          nb::arg("guards"), "Set the guards: dicts of the row, its sign, whether it is closed, restitution and rest.")
      .def_prop_rw("states", guard_states, set_guard_states)
      .def_prop_ro("impacts", impacts);
}

}  // namespace mbdae
