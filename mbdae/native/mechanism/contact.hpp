// A convex body of frame b on a surface of frame a: contact kinematics (mbdae/mechanism/closures/contact.py).
#pragma once

#include "math/fields.hpp"
#include "math/geometry.hpp"

namespace mbdae {

template <class S>
struct Frames;

struct Shape {
  NAMED_ENUM(enum class, Body, sphere, wheel, ellipsoid)
  NAMED_ENUM(enum class, Surface, plane, sphere, cylinder)
  Body body = Body::sphere;
  Surface surface = Surface::plane;
  double rim = 0, tyre = 0, curve = 0;  // radii; that of the surface is negative where the body rolls inside
  double axle[3] = {0, 0, 0}, squares[3] = {0, 0, 0}, centre[3] = {0, 0, 0};  // squares: of semi-axes
  double parallel = 0;                                                        // threshold

  FIELDS(body, surface, rim, tyre, curve, axle, squares, centre, parallel)
};

// The normal towards b, the lowest point, the tangents ahead and to the left.
template <class S>
struct Contact {
  Vec3<S> n, p, ahead, left;
};

template <class S>
Contact<S> contact_of(const Shape& shape, const Frames<S>& frames);

}  // namespace mbdae
