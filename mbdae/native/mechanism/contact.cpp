// Contact normal, point and tangents of a rolling body on a surface.
#include "mechanism/contact.hpp"

#include "mechanism/frames.hpp"

namespace mbdae {

namespace {

template <class S>
S normalize(Vec3<S>& x) {  // |x|; x becomes x/|x|
  const S length = sqrt(dot(x, x));
  x = 1 / length * x;
  return length;
}

template <class S>
Vec3<S> normal(const Shape& shape, const Frames<S>& x) {
  const Vec3<double> z = column(x.Ra, 2);
  if (shape.surface == Shape::Surface::plane) return z;
  Vec3<S> n = x.pb - x.pa;
  if (shape.surface == Shape::Surface::cylinder) n = n - dot(z, n) * z;
  if (!(value(normalize(n)) > 0)) throw FallBackToPython();
  return shape.curve < 0 ? -1.0 * n : n;
}

}  // namespace

template <class S>
Contact<S> contact_of(const Shape& shape, const Frames<S>& x) {
  Contact<S> out;
  const Vec3<S> n = out.n = normal(shape, x);
  out.p = x.pb;
  if (shape.body == Shape::Body::ellipsoid) {
    const Vec3<S> Dn = x.Rb * scaled(shape.squares, transposed(x.Rb, n));
    out.p = out.p + x.Rb * Vec3<double>(shape.centre) - 1 / sqrt(dot(n, Dn)) * Dn;
  }
  out.p = out.p - shape.tyre * n;
  if (shape.body == Shape::Body::wheel) {
    const Vec3<S> axle = x.Rb * Vec3<double>(shape.axle);
    out.longitudinal = cross(axle, n);
    if (!(value(normalize(out.longitudinal)) > shape.parallel)) throw FallBackToPython();
    // longitudinal x axle is the unit vector along n - (n . axle) axle
    if (shape.rim > 0) out.p = out.p - shape.rim * cross(out.longitudinal, axle);
  } else if (shape.surface == Shape::Surface::plane) {
    out.longitudinal = column(x.Ra, 0);
  } else if (shape.surface == Shape::Surface::cylinder) {
    out.longitudinal = cross(column(x.Ra, 2), n), normalize(out.longitudinal);
  } else {
    const Vec3<double> longitudinal = column(x.Ra, 0);
    Vec3<S> w = n + column(x.Ra, 2);
    if (value(normalize(w)) > shape.parallel)
      out.longitudinal = longitudinal - 2 * dot(w, longitudinal) * w;
    else
      out.longitudinal = cross(longitudinal, n), normalize(out.longitudinal);
  }
  out.lateral = cross(n, out.longitudinal);
  return out;
}

template Contact<double> contact_of(const Shape&, const Frames<double>&);
template Contact<Dual<1>> contact_of(const Shape&, const Frames<Dual<1>>&);
template Contact<Dual<6>> contact_of(const Shape&, const Frames<Dual<6>>&);

}  // namespace mbdae
