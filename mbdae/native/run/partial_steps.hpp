// Partial steps from the start of the step just taken, at whose ends events are located.
#pragma once

#include "run/time_loop.hpp"

namespace mbdae {

class TimeLoop::PartialSteps {
 public:
  PartialSteps(TimeLoop& loop, double h) : loop_(loop), h_(h), restarted_(loop.restarted_) {}

  Vector take(double theta) {
    Run& run = loop_.run_;
    const double t = run.interval.t;
    if (!taken()) {
      end_ = std::move(loop_.next_), loop_.next_ = State();
      z_ = loop_.z_, size_ = loop_.size1_;
    }
    loop_.method_.take(run.adaptive, t, theta * h_, run.state, loop_.next_, loop_.z_.data(), loop_.errors_);
    if (run.adaptive || run.project) loop_.s_.component_magnitudes(loop_.next_.y.data(), loop_.size1_.data());
    if (run.project) loop_.project(t + theta * h_);
    last_ = theta;
    return loop_.next_.y;
  }

  void end_at(double theta, Proposal& p) {  // instead of the step just taken
    if (last_ != theta) take(theta);
    p.t_next = loop_.run_.interval.t + theta * h_;
    loop_.run_.grid.undo_step();
  }

  void discard() {
    if (taken()) loop_.next_ = std::move(end_), loop_.z_ = z_, loop_.size1_ = size_, loop_.restarted_ = restarted_;
  }

 private:
  bool taken() const { return !end_.y.empty(); }

  TimeLoop& loop_;
  const double h_;
  const bool restarted_;
  State end_;  // exchanged with that of the loop: arrays keep their addresses
  Vector z_, size_;
  double last_ = 1;  // fraction of the step that was taken last
};

}  // namespace mbdae
