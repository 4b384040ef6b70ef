// A convex body of frame b on a surface of frame a: contact kinematics (mbdae/mechanism/closures/contact.py).
#pragma once

#include <map>
#include <string>

#include "math/geometry.hpp"

namespace mbdae {

template <class S>
struct Frames;

struct Shape {
  enum Body { sphere, wheel, ellipsoid } body = sphere;
  enum Surface { plane, ball, cylinder } surface = plane;
  double rim = 0, tyre = 0, curve = 0;
  double axle[3] = {0, 0, 0}, squares[3] = {0, 0, 0}, centre[3] = {0, 0, 0};  // of semi-axes
  double flat = 0, polar = 0;  // thresholds
};

inline const std::map<std::string, Shape::Body> BODIES = {
    {"sphere", Shape::sphere}, {"wheel", Shape::wheel}, {"ellipsoid", Shape::ellipsoid}};
inline const std::map<std::string, Shape::Surface> SURFACES = {
    {"plane", Shape::plane}, {"sphere", Shape::ball}, {"cylinder", Shape::cylinder}};

// The normal towards b, the lowest point, the tangents ahead and to the left.
template <class S>
struct Contact {
  Vec3<S> n, p, ahead, left;
};

template <class S>
Contact<S> touch(const Shape& shape, const Frames<S>& frames);

}  // namespace mbdae
