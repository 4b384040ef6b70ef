// Switches of a mechanism and their states (mbdae/mechanism/hybrid/): unilateral contacts, one-way clutches, ratchets,
// joints with stiction, closures that are active within a range.
#pragma once

#include <utility>

#include "system/index2.hpp"

namespace mbdae {

using Mode = std::vector<int>;  // the state of each switch

// 0: separated, overrunning, outside; 1: in contact or sticking, locked, inside; further states depend on the kind.
enum SwitchState { released = 0, active = 1, sliding = 2, runs_back = 2, slips_forwards = 2, slips_backwards = 3 };

struct Switch {
  NAMED_ENUM(enum class, Kind, contact, clutch, ratchet, stiction, range)
  Kind kind = Kind::contact;
  std::vector<int> rows;      // the guards and the state depend on the first row
  double sign = 1;            // sign of the gap, of the overrunning speed, and of the multiplier
  double restitution = 0;
  double rest = 0;            // s: shortest separation between impacts; after a shorter one the contact comes to rest
  double friction = 0;        // coefficient, or the torque of a slipping joint
  double limit = 0;           // limit while it sticks
  int interface = -1;         // index of the friction interface of a closure; -1: none
  int law = -1, column = -1;  // law of the torque of a slipping joint; index of the velocity of the joint
  std::vector<int> positions;  // indices in q of the coordinates of a ratchet or a range, and their factors
  Vector factors;
  double pitch = 0, tooth = 0;                     // pitch of a ratchet, and position of one tooth
  std::vector<std::pair<double, double>> windows;  // windows of a range
  double period = 0, shortest = 0;  // period of the windows, 0: none; shortest interval inside or between windows

  FIELDS(kind, rows, sign, restitution, rest, friction, limit, interface, law, column, positions, factors, pitch, tooth,
         windows, period, shortest)

  bool frictional() const { return interface >= 0; }
  bool one_way() const { return kind == Kind::clutch || kind == Kind::ratchet; }
  int active_rows(int state) const {  // number of rows that are active
    return state == active ? static_cast<int>(rows.size()) : frictional() && state == sliding ? 1 : 0;
  }
  double coordinate(const double* q) const;      // coordinate of the ratchet or of the range
  double teeth(const double* q) const { return sign * (coordinate(q) - tooth) / pitch; }  // position in pitches
  double depth(double x) const;  // in the range, positive inside
};

// Set the active rows and the friction of a mode.
void set_mode(Index2System& s, const std::vector<Switch>& switches, const Mode& mode);

// Enter a mode at y: set its rows and friction, determine the rank and the rows in use. FallBackToPython if the rank is
// ambiguous.
void enter_mode(Index2System& s, const std::vector<Switch>& switches, const Mode& mode, const double* y,
                const IndependentRows::InitialRank& first);

// A copy of the settings of a mode, to restore them.
class ModeSettings {
 public:
  ModeSettings(Index2System& s, const std::vector<Switch>& switches, const Mode& mode);
  void restore() const;

 private:
  Index2System& s_;
  const std::vector<Switch>& switches_;
  const Mode mode_;
  const std::vector<int> rows_;
  const int rank_;
  const double floor_;
  const bool frozen_;
  Vector directions_;
};

}  // namespace mbdae
