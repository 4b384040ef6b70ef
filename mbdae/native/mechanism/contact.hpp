// Contact kinematics of a convex body on frame b and a surface on frame a (mbdae/mechanism/closures/contact.py).
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
  double rim = 0, tyre = 0, curve = 0;  // radii of rim, cross-section, surface (< 0: the body rolls inside)
  double axle[3] = {0, 0, 0}, squares[3] = {0, 0, 0}, centre[3] = {0, 0, 0};  // squares: squared semi-axes
  double parallel = 0;  // threshold of the sine of the angle between normal and axle

  FIELDS(body, surface, rim, tyre, curve, axle, squares, centre, parallel)
};

// The normal towards b, the contact point on b, the longitudinal and the lateral tangent.
template <class S>
struct Contact {
  Vec3<S> n, p, longitudinal, lateral;
};

template <class S>
Contact<S> contact_of(const Shape& shape, const Frames<S>& frames);

}  // namespace mbdae
