// Events defined by a signal: detected at the ends of steps, located on partial steps of the method
// (mbdae/integrate/events/level_crossing.py).
#pragma once

#include <functional>

#include "run/signal_value.hpp"

namespace mbdae {

struct Node {
  double t = 0, f = 0, w = 0;  // time, value minus the level, rate of an angle
};

struct SignalEvent {
  SignalValue signal;
  double level = 0;
  int direction = 0;  // 1 for upward crossings, -1 for downward crossings, 0 for both
  double unchanged_within = 0;  // a value this close to the level at both ends of a step counts as unchanged
  bool terminal = false;

  FIELDS(signal, level, direction, unchanged_within, terminal)
};

// A located event: which event, its time, and the point (length,).
struct LocatedEvent {
  int event;
  double t;
  Vector y;
};

// The events of a run, and their settings.
struct Events {
  std::vector<SignalEvent> events;
  std::vector<Node> nodes;  // current node of each event
  std::vector<LocatedEvent> located;
  bool stopped = false;                     // a terminal event has ended the run
  double start = 0;                         // s: start of the run, where an event is located but does not end it
  double agreement = 0;                     // s, or relative to t: an event this close to the start is at the start
  double spacings = 0, step_tolerance = 0;  // location tolerance: spacings of t, and relative to the step
  int iterations = 0;

  FIELDS(stopped, start, agreement, spacings, step_tolerance, iterations)
};

// An accepted step from y at t to y1 at t1, and the rates (v', s', w') in the carry at both ends, or nullptr.
struct AcceptedStep {
  double t, t1;
  const double *y, *y1, *carry, *carry1;
};

// Events of a step: current nodes after it, located events, and the fraction of the step at which the run ends.
struct DetectedEvents {
  std::vector<Node> nodes;
  std::vector<LocatedEvent> located;
  double stop = -1;  // negative: the run continues
};

// y (length,) at the end of a partial step of fraction theta; throws if it cannot be taken.
using PartialStep = std::function<Vector(double theta)>;

DetectedEvents detect_events(Index2System& s, PointValues& values, const Events& events, const AcceptedStep& step,
                             const PartialStep& partial_step);

}  // namespace mbdae
