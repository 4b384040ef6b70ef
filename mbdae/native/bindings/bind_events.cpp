// Bindings of the events and the discrete modes of a run.
#include "bindings/bindings.hpp"
#include "bindings/structs.hpp"

namespace mbdae {

namespace {

using ValueNodes = std::vector<std::tuple<double, double, double>>;  // time, value and rate

void set_nodes(Events& e, const ValueNodes& nodes) {
  if (nodes.size() != e.events.size()) reject("nodes must be as many as events");
  for (size_t i = 0; i < nodes.size(); ++i)
    e.nodes[i] = {std::get<0>(nodes[i]), std::get<1>(nodes[i]), std::get<2>(nodes[i])};
  e.located.clear(), e.stopped = false;
}

// Size, level, return time, and unit.
using GuardStates = std::vector<std::tuple<double, double, double, double>>;

GuardStates guard_states(const Modes& m) {
  GuardStates out;
  for (const Guard& x : m.guards) out.emplace_back(x.size, x.level, x.return_time, x.unit);
  return out;
}

void set_guard_states(Modes& m, const GuardStates& states) {
  if (m.mode.size() != m.switches.size() || m.last_impact.size() != m.switches.size())
    reject("modes and times of the last impact must be as many as switches");
  m.guards = guards_of(m.switches, m.mode);
  if (states.size() != m.guards.size()) reject("guard states must be as many as guards");
  for (size_t i = 0; i < states.size(); ++i) {
    Guard& x = m.guards[i];
    std::tie(x.size, x.level, x.return_time, x.unit) = states[i];
  }
}

// Node, switches that end the mode, the next mode, whether there is an impact, its contacts and the rows that become
// active, its work, and the impulses of all rows.
using TransitionRecord =
    std::tuple<long, std::vector<int>, Mode, bool, std::vector<int>, std::vector<int>, double, Vector>;

std::vector<TransitionRecord> transitions(const Modes& m) {
  std::vector<TransitionRecord> out;
  for (const Transition& x : m.transitions)
    out.emplace_back(x.node, x.fired, x.mode, x.impact, x.contacts, x.engaged, x.work, x.impulses);
  return out;
}

}  // namespace

void check_events(const Events& e, const Index2System& s) {
  for (const SignalEvent& event : e.events)
    if (!event.signal.is_valid(s)) reject("a signal does not fit the mechanism");
}

void bind_events(nb::module_& m) {
  bind_attributes<Events>(m, "Events", "Events defined by signals.")
      .def(
          "set_events",
          [](Events& e, const nb::list& events) {
            e.events = PyReader().read<std::vector<SignalEvent>>(events);
            e.nodes.assign(e.events.size(), Node());
          },
          nb::arg("events"),
          "Set the events: dicts of a signal, its level, direction and `unchanged_within`, and whether it is terminal.")
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
  bind_attributes<Modes>(m, "Modes", "Switches, guards of the mode, and transitions.")
      .def(
          "set_switches",
          [](Modes& m, const nb::list& switches) { m.switches = PyReader().read<std::vector<Switch>>(switches); },
          nb::arg("switches"), "Set the switches: dicts of the fields of `Switch`.")
      .def_prop_rw("states", guard_states, set_guard_states, "Size, level, return time and unit of each guard.")
      .def_prop_ro("transitions", transitions);
}

}  // namespace mbdae
