// Rows along lines through a point, w = [e; p x e]: heights, grips, knife edges, gears, screws
// (mbdae/mechanism/closures/line_rows.py).
#pragma once

#include "mechanism/frames.hpp"

namespace mbdae {

bool has_contact(const Row& r);  // along a line through a contact point

// g, and the wrench on b; the contact of rows that touch.
template <class S>
S line_wrench(const Row& r, const Frames<S>& frames, const Contact<S>* contact, Wrench<S>& w);

}  // namespace mbdae
