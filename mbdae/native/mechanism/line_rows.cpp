#include "mechanism/line_rows.hpp"

namespace mbdae {

namespace {

// The line of a row: a direction e through p; g.
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

// The x and y along the axes of a.
template <class S>
Vec2<S> in_plane(const Frames<S>& x, const Vec3<S>& d) {
  return {{dot(column(x.Ra, 0), d), dot(column(x.Ra, 1), d)}};
}

template <class S>
Vec3<S> in_world(const Frames<S>& x, const S& first, const S& second) {
  return first * column(x.Ra, 0) + second * column(x.Ra, 1);
}

// A point of a profile near the given one, c(s) and c'(s).
template <class S>
struct ProfilePoint {
  Vec2<S> c, d;

  ProfilePoint(const Profile::Point& at, const S& ds)
      : c{{at.c[0] + at.d[0] * ds, at.c[1] + at.d[1] * ds}}, d{{at.d[0] + at.dd[0] * ds, at.d[1] + at.dd[1] * ds}} {}
};

template <class S>
Vec3<S> unit(const Vec3<S>& x) {
  return 1 / sqrt(dot(x, x)) * x;
}

// The nearest point satisfies c' . (x - c) = 0: a step of Newton's method at the solution gives its derivatives.
template <class S>
Line<S> of_roller(const Row& r, const Frames<S>& x) {
  const Vec2<S> at = in_plane(x, x.pb - x.pa);
  const double known[2] = {value(at.x[0]), value(at.x[1])};
  const Profile::Point nearest = r.profile->nearest(known);
  const Vec2<S> off{{at.x[0] - nearest.c[0], at.x[1] - nearest.c[1]}};
  const double bend = nearest.d[0] * nearest.d[0] + nearest.d[1] * nearest.d[1] -
                      (nearest.dd[0] * value(off.x[0]) + nearest.dd[1] * value(off.x[1]));
  const ProfilePoint<S> c(nearest, dot(nearest.d, off) / bend);
  const S size = sqrt(c.d.x[0] * c.d.x[0] + c.d.x[1] * c.d.x[1]), side = r.profile->side / size;
  const Vec2<S> n{{side * c.d.x[1], -side * c.d.x[0]}};
  const S g = n.x[0] * (at.x[0] - c.c.x[0]) + n.x[1] * (at.x[1] - c.c.x[1]) - r.length;
  return {in_world(x, n.x[0], n.x[1]), x.pb, g};
}

// The support point satisfies c' . n = 0.
template <class S>
Line<S> of_flat_face(const Row& r, const Frames<S>& x) {
  const Vec3<S> e = x.Rb * Vec3<double>(r.b);
  const Vec2<S> n = in_plane(x, e);
  const double known[2] = {value(n.x[0]), value(n.x[1])};
  const Profile::Point nearest = r.profile->support(known);
  const S ds = -1 / (nearest.dd[0] * known[0] + nearest.dd[1] * known[1]) * dot(nearest.d, n);
  const ProfilePoint<S> c(nearest, ds);
  const Vec3<S> p = x.pa + in_world(x, c.c.x[0], c.c.x[1]);
  return {e, p, dot(e, x.pb - p)};
}

// Through the point at the distances of the radii from both axes, perpendicular to them (line_rows.py: Bevel).
template <class S>
Line<S> of_bevel(const Row& r, const Frames<S>& x) {
  const Vec3<S> ka = x.Ra * Vec3<double>(r.a), kb = x.Rb * Vec3<double>(r.b), e = unit(cross(ka, kb));
  const Vec3<S> na = cross(e, ka), nb = cross(kb, e);  // p . n = y for these and e
  const Vec3<S> of_a = cross(nb, e), of_b = cross(e, na), of_e = cross(na, nb);
  const S ya = dot(na, x.pa) + r.length, yb = dot(nb, x.pb) + r.other_length, ye = dot(e, x.pa);
  return {e, 1 / dot(na, of_a) * (ya * of_a + yb * of_b + ye * of_e), 0};
}

template <class S>
Line<S> line_of(const Row& r, const Frames<S>& x, const Contact<S>* contact) {
  switch (r.kind) {
    case Row::height:
      return {contact->n, contact->p,
              dot(contact->n, contact->p - x.pa) - (r.shape.surface == Shape::Surface::plane ? 0 : r.shape.curve)};
    case Row::grip:
      return {r.direction[0] * contact->ahead + r.direction[1] * contact->left, contact->p, 0};
    case Row::roller:
      return of_roller(r, x);
    case Row::flat_face:
      return of_flat_face(r, x);
    case Row::knife_edge:
      return {x.Rb * Vec3<double>(r.b), x.pb, 0};
    case Row::bevel:
      return of_bevel(r, x);
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
