// Sign changes of signals on a step, and their location by Brent's method on partial steps.
#include "run/event_detection.hpp"

#include <algorithm>
#include <cmath>

#include "math/brent.hpp"

namespace mbdae {

namespace {

struct Sample {
  double theta;
  Vector y;
  double f;
};

struct Crossing {
  double theta;
  int event;
  Vector y;
};

int sign(double x) { return (x > 0) - (x < 0); }

// Detection of one event on one step.
class EventSearch {
 public:
  EventSearch(Index2System& s, PointValues& values, const Events& events, const SignalEvent& event, Node& node,
              const AcceptedStep& step, const PartialStep& partial_step)
      : s_(s),
        values_(values),
        events_(events),
        event_(event),
        node_(node),
        step_(step),
        partial_step_(partial_step),
        h_(step.t1 - step.t) {}

  void run(int index, std::vector<Crossing>& crossings) {
    index_ = index, crossings_ = &crossings;
    if (step_.t != node_.t) {  // after a jump
      const Vector y(step_.y, step_.y + s_.length);
      const double f = value(step_.t, y.data());
      check_interval({0, y, node_.f}, {0, y, f});
      set_node(step_.t, y.data(), f);
    }
    const double f0 = node_.f, f1 = value(step_.t1, step_.y1);
    if (std::max(std::fabs(f0), std::fabs(f1)) <= event_.unchanged_within) return set_node(step_.t1, step_.y1, 0);
    const double theta = extremum(f0, f1);
    if (!(theta > 0) && f0 * f1 > 0) return set_node(step_.t1, step_.y1, f1);
    const Vector y(step_.y, step_.y + s_.length), y1(step_.y1, step_.y1 + s_.length);
    std::vector<Sample> samples = {{0, y, f0}};
    if (theta > 0) {
      const Vector between = partial_step_(theta);
      samples.push_back({theta, between, value(step_.t + theta * h_, between.data())});
    }
    samples.push_back({1, y1, f1});
    for (size_t k = 1; k < samples.size(); ++k) check_interval(samples[k - 1], samples[k]);
    set_node(step_.t1, y1.data(), f1);
  }

 private:
  double angle_rate(const double* y) const {
    return event_.signal.kind == SignalValue::Kind::angle ? y[s_.nq + event_.signal.rate] : 0;
  }

  void set_node(double t, const double* y, double f) { node_ = {t, f, angle_rate(y)}; }

  double value(double t, const double* y) {
    const double f = event_.signal.at(values_, t, y) - event_.level;
    if (event_.signal.kind != SignalValue::Kind::angle) return f;
    const double revolutions = (node_.f + (t - node_.t) * (node_.w + angle_rate(y)) / 2 - f) / (2 * M_PI);
    return f + 2 * M_PI * std::nearbyint(revolutions);
  }

  void check_interval(const Sample& a, const Sample& b) {
    const int direction = sign(a.f == 0 ? b.f : b.f - a.f);
    if (event_.direction * direction < 0) return;
    if (a.f == 0 && b.f != 0 && a.theta == 0 && step_.t == events_.start)
      crossings_->push_back({0, index_, a.y});
    else if (a.f * b.f < 0 && a.theta == b.theta)  // a jump
      crossings_->push_back({b.theta, index_, b.y});
    else if (a.f * b.f < 0)
      crossings_->push_back(locate(a, b));
    else if (b.f == 0 && a.f != 0)
      crossings_->push_back({b.theta, index_, b.y});
  }

  Crossing locate(const Sample& a, const Sample& b) {
    const double scale = std::max(std::fabs(step_.t), std::fabs(step_.t1));
    const double resolution = events_.spacings * (std::nextafter(scale, INFINITY) - scale) / std::fabs(h_);
    std::vector<Sample> evaluated = {a, b};
    const auto f = [&](double theta) {
      const Vector y = partial_step_(theta);
      evaluated.push_back({theta, y, value(step_.t + theta * h_, y.data())});
      return evaluated.back().f;
    };
    const double root = brent(f, a.theta, a.f, b.theta, b.f, resolution, events_.step_tolerance, events_.iterations);
    const auto found =
        std::find_if(evaluated.begin(), evaluated.end(), [&](const Sample& x) { return x.theta == root; });
    return {root, index_, found->y};
  }

  // Fraction of the step at which the signal may have crossed its level and returned; 0: none.
  double extremum(double f0, double f1) {
    const SignalValue& signal = event_.signal;
    if ((signal.kind != SignalValue::Kind::y && signal.kind != SignalValue::Kind::angle) || signal.rate < 0 ||
        f0 * f1 <= 0)
      return 0;
    const double m1 = h_ * rate(step_.t1, step_.y1, step_.carry1);
    if (m1 * f1 <= 0) return 0;
    const double m0 = h_ * rate(step_.t, step_.y, step_.carry);
    if (m0 * f0 >= 0) return 0;
    const double a = 3 * (f1 - f0) - 2 * m0 - m1, b = 2 * (f0 - f1) + m0 + m1;
    const double x = -m0 / (a + std::copysign(std::sqrt(a * a - 3 * b * m0), -m0));
    return 0 < x && x < 1 && (f0 + x * (m0 + x * (a + x * b))) * f0 < 0 ? x : 0;
  }

  double rate(double t, const double* y, const double* carry) {
    const int i = event_.signal.rate;
    if (i < s_.nv) return y[s_.nq + i];
    if (carry) return carry[i - s_.nv];
    values_.set_point(t, y);
    return values_.F()[i];
  }

  Index2System& s_;
  PointValues& values_;
  const Events& events_;
  const SignalEvent& event_;
  Node& node_;
  const AcceptedStep& step_;
  const PartialStep& partial_step_;
  const double h_;
  int index_ = 0;
  std::vector<Crossing>* crossings_ = nullptr;
};

}  // namespace

DetectedEvents detect_events(Index2System& s, PointValues& values, const Events& events, const AcceptedStep& step,
                             const PartialStep& partial_step) {
  DetectedEvents out;
  out.nodes = events.nodes;
  std::vector<Crossing> crossings;
  for (size_t i = 0; i < events.events.size(); ++i)
    EventSearch(s, values, events, events.events[i], out.nodes[i], step, partial_step)
        .run(static_cast<int>(i), crossings);
  if (crossings.empty()) return out;
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& a, const Crossing& b) {
    return a.theta != b.theta ? a.theta < b.theta : a.event < b.event;
  });
  const double h = step.t1 - step.t, agreement = events.agreement * std::max(1.0, std::fabs(step.t));
  for (const Crossing& crossing : crossings) {
    if (out.stop >= 0 && (crossing.theta - out.stop) * std::fabs(h) > agreement) break;
    const bool at_start = step.t == events.start && crossing.theta * std::fabs(h) <= agreement;
    if (at_start)
      out.located.push_back({crossing.event, step.t, Vector(step.y, step.y + s.length)});
    else
      out.located.push_back({crossing.event, step.t + crossing.theta * h, crossing.y});
    if (events.events[crossing.event].terminal && !at_start && out.stop < 0) out.stop = crossing.theta;
  }
  return out;
}

}  // namespace mbdae
