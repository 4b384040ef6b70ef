// Lines of contacts, cams, gears and screws, along which a row acts.
#include "mechanism/line_rows.hpp"

namespace mbdae {

namespace {

// The line of a row: the direction e, a point p, and the constraint value g.
template <class S>
struct Line {
  Vec3<S> e, p;
  S g;
};

template <class S>
struct Vec2 {
  S x[2];
};

template <class S>
S dot(const double* a, const Vec2<S>& b) {
  return a[0] * b.x[0] + a[1] * b.x[1];
}

// Components along the x and y axes of a.
template <class S>
Vec2<S> in_plane(const Frames<S>& x, const Vec3<S>& d) {
  return {{dot(column(x.Ra, 0), d), dot(column(x.Ra, 1), d)}};
}

template <class S>
Vec3<S> in_world(const Frames<S>& x, const S& first, const S& second) {
  return first * column(x.Ra, 0) + second * column(x.Ra, 1);
}

// A profile point c(s + ds) and its tangent c', to first order in ds.
template <class S>
struct ProfilePoint {
  Vec2<S> c, d;

  ProfilePoint(const Profile::Point& x, const S& ds)
      : c{{x.c[0] + x.d[0] * ds, x.c[1] + x.d[1] * ds}}, d{{x.d[0] + x.dd[0] * ds, x.d[1] + x.dd[1] * ds}} {}
};

template <class S>
Vec3<S> unit(const Vec3<S>& x) {
  return 1 / sqrt(dot(x, x)) * x;
}

// The nearest profile point satisfies c' . (x - c) = 0: one Newton step at the solution gives its derivatives.
template <class S>
Line<S> roller_line(const Row& r, const Frames<S>& x) {
  const Vec2<S> local = in_plane(x, x.pb - x.pa);
  const double xy[2] = {value(local.x[0]), value(local.x[1])};
  const Profile::Point nearest = r.profile->nearest(xy);
  const Vec2<S> offset{{local.x[0] - nearest.c[0], local.x[1] - nearest.c[1]}};
  const double derivative = nearest.d[0] * nearest.d[0] + nearest.d[1] * nearest.d[1] -
                            (nearest.dd[0] * value(offset.x[0]) + nearest.dd[1] * value(offset.x[1]));
  const ProfilePoint<S> c(nearest, dot(nearest.d, offset) / derivative);
  const S size = sqrt(c.d.x[0] * c.d.x[0] + c.d.x[1] * c.d.x[1]), side = r.profile->side / size;
  const Vec2<S> n{{side * c.d.x[1], -side * c.d.x[0]}};
  const S g = n.x[0] * (local.x[0] - c.c.x[0]) + n.x[1] * (local.x[1] - c.c.x[1]) - r.length;
  return {in_world(x, n.x[0], n.x[1]), x.pb, g};
}

// The support point of a flat face satisfies c' . n = 0.
template <class S>
Line<S> flat_face_line(const Row& r, const Frames<S>& x) {
  const Vec3<S> e = x.Rb * Vec3<double>(r.b);
  const Vec2<S> n = in_plane(x, e);
  const double xy[2] = {value(n.x[0]), value(n.x[1])};
  const Profile::Point nearest = r.profile->support(xy);
  const S ds = -1 / (nearest.dd[0] * xy[0] + nearest.dd[1] * xy[1]) * dot(nearest.d, n);
  const ProfilePoint<S> c(nearest, ds);
  const Vec3<S> p = x.pa + in_world(x, c.c.x[0], c.c.x[1]);
  return {e, p, dot(e, x.pb - p)};
}

// Bevel gear: perpendicular to both axes, through the point whose distances from them are the radii (line_rows.py).
template <class S>
Line<S> bevel_line(const Row& r, const Frames<S>& x) {
  const Vec3<S> ka = x.Ra * Vec3<double>(r.a), kb = x.Rb * Vec3<double>(r.b), e = unit(cross(ka, kb));
  const Vec3<S> na = cross(e, ka), nb = cross(kb, e);  // p is the solution of p . n = y for na, nb and e
  const Vec3<S> dual_a = cross(nb, e), dual_b = cross(e, na), dual_e = cross(na, nb);
  const S ya = dot(na, x.pa) + r.length, yb = dot(nb, x.pb) + r.other_length, ye = dot(e, x.pa);
  return {e, 1 / dot(na, dual_a) * (ya * dual_a + yb * dual_b + ye * dual_e), 0};
}

template <class S>
Line<S> line_of(const Row& r, const Frames<S>& x, const Contact<S>* contact) {
  switch (r.kind) {
    case Row::height:
      return {contact->n, contact->p,
              dot(contact->n, contact->p - x.pa) - (r.shape.surface == Shape::Surface::plane ? 0 : r.shape.curve)};
    case Row::grip:
      return {r.direction[0] * contact->longitudinal + r.direction[1] * contact->lateral, contact->p, 0};
    case Row::roller:
      return roller_line(r, x);
    case Row::flat_face:
      return flat_face_line(r, x);
    case Row::knife_edge:
      return {x.Rb * Vec3<double>(r.b), x.pb, 0};
    case Row::bevel:
      return bevel_line(r, x);
    case Row::screw: {
      const Vec3<S> e = x.Ra * Vec3<double>(r.a);
      return {e, x.pb, dot(e, x.pb - x.pa)};
    }
    default: {  // gear
      const Vec3<S> d = x.pb - x.pa;
      return {unit(cross(x.Ra * Vec3<double>(r.a), d)), x.pa + r.length * d, 0};
    }
  }
}

}  // namespace

bool has_contact(const Row& r) { return r.kind == Row::height || r.kind == Row::grip; }

template <class S>
S line_wrench(const Row& r, const Frames<S>& x, const Contact<S>* contact, Wrench<S>& w) {
  const Line<S> l = line_of(r, x, contact);
  w = wrench_at(l.p, l.e);
  if (r.kind == Row::screw) w.moment = w.moment - r.length * l.e;
  return l.g;
}

template double line_wrench(const Row&, const Frames<double>&, const Contact<double>*, Wrench<double>&);
template Dual<1> line_wrench(const Row&, const Frames<Dual<1>>&, const Contact<Dual<1>>*, Wrench<Dual<1>>&);
template Dual<6> line_wrench(const Row&, const Frames<Dual<6>>&, const Contact<Dual<6>>*, Wrench<Dual<6>>&);

}  // namespace mbdae
