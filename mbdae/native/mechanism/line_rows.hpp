// Rows that act along a line through a point, w = [e; p x e]: contact heights, no-slip rows, knife edges, cams, gears,
// screws (mbdae/mechanism/closures/line_rows.py).
#pragma once

#include "mechanism/frames.hpp"

namespace mbdae {

bool has_contact(const Row& r);  // whether its line passes through a contact point

// Return g and set the wrench on b; contact: of rows with a contact point.
template <class S>
S line_wrench(const Row& r, const Frames<S>& frames, const Contact<S>* contact, Wrench<S>& w);

}  // namespace mbdae
