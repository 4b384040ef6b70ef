// Rows along lines through a point, w = [e; p x e]: heights, grips, knife edges, gears, screws
// (mbdae/mechanism/closures/line_rows.py).
#pragma once

#include "mechanism/wrench_partials.hpp"
#include "mechanism/rows.hpp"

namespace mbdae {

bool touches(const Row& r);                                        // along a line through a contact point
double line_wrench(const Row& r, const Pair& pair, double* w);     // g, and the wrench on b, (6,)
// The wrench's rate (6,) for velocities of the frames; contact kinematics if given.
void line_rate(const Row& r, const Pair& pair, const double* Va, const double* Vb, const ContactKinematics* touch, double* dw);
void line_partials(const Row& r, const Pair& pair, WrenchPartials& t);   // Da and Db, as w' is linear in the velocities

}  // namespace mbdae
