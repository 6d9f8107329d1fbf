#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "understory/simulation/scene/fat_ray.h"

// What shapes are made of, each met by eight rays at once. `meet` lowers the rays' ranges where the
// thing lies within [near, range], notes its number there and says whether it did.
namespace understory {

// What rays met so far, ray by ray: the range, which is at first the limit. As bits, also the
// numbers of the primitive and of the object.
struct RayHits {
  Lanes range;
  Lanes primitive;
  Lanes object;

  bool take(LaneMask where, Lanes at, std::uint32_t number) {
    if (where.bits() == 0) return false;
    range = select(where, at, range);
    primitive = select(where, Lanes(std::bit_cast<float>(number)), primitive);
    return true;
  }
};

// As the map that takes its corners to (0,0,0), (1,0,0), (0,1,0), after Baldwin and Weber, Fast
// ray-triangle intersections by coordinate transformation (2016).
struct Triangle {
  Triangle(const Eigen::Vector3f& corner, const Eigen::Vector3f& second,
           const Eigen::Vector3f& third) {
    const Eigen::Vector3d from = corner.cast<double>();
    const Eigen::Vector3d e = second.cast<double>() - from;
    const Eigen::Vector3d f = third.cast<double>() - from;
    const Eigen::Vector3d n = e.cross(f);
    const double per = 1.0 / n.squaredNorm();  // without area all is infinite: never met
    rows << row(n, from), row(per * f.cross(n), from), row(per * n.cross(e), from);
  }

  [[nodiscard]] Eigen::Vector3f normal(const Eigen::Vector3f&) const {
    return rows.row(0).head<3>();
  }

  bool meet(const RayLanes& rays, float near, std::uint32_t number, RayHits& struck) const {
    constexpr float kSeam = 1e-5F;  // of an edge: what lies side by side leaves no gap
    const Lanes3& d = rays.direction;
    const Lanes3& o = rays.origin;
    const auto along = [&](int r) {
      return d.x * rows(r, 0) + d.y * rows(r, 1) + d.z * rows(r, 2);
    };
    const auto start = [&](int r) {
      return o.x * rows(r, 0) + o.y * rows(r, 1) + o.z * rows(r, 2) + rows(r, 3);
    };
    const Lanes at = (Lanes(0.0F) - start(0)) / along(0);
    const Lanes u = start(1) + at * along(1);
    const Lanes v = start(2) + at * along(2);
    const Lanes least(-kSeam);
    return struck.take((least <= u) & (least <= v) & (u + v <= Lanes(1.0F + kSeam)) &
                           (Lanes(near) <= at) & (at < struck.range),
                       at, number);
  }

  // Height above its plane, and shares of its two edges, of (x, y, z, 1).
  Eigen::Matrix<float, 3, 4, Eigen::RowMajor | Eigen::DontAlign> rows;

 private:
  static Eigen::RowVector4f row(const Eigen::Vector3d& v, const Eigen::Vector3d& from) {
    return Eigen::RowVector4d(v.x(), v.y(), v.z(), -v.dot(from)).cast<float>();
  }
};

// A flat round plate.
struct Disc {
  Eigen::Vector3f centre;
  Eigen::Vector3f axis;
  float radius_m = 0.0F;

  [[nodiscard]] Eigen::Vector3f normal(const Eigen::Vector3f&) const { return axis; }
  [[nodiscard]] Eigen::AlignedBox3f box() const {
    // A disc reaches farthest along an axis that lies in it.
    const Eigen::Array3f along = axis.normalized().array();
    const Eigen::Vector3f reach = radius_m * (1.0F - along.square()).max(0.0F).sqrt().matrix();
    return {centre - reach, centre + reach};
  }

  bool meet(const RayLanes& rays, float near, std::uint32_t number, RayHits& struck) const {
    const Lanes3& d = rays.direction;
    const Lanes3 to = {Lanes(centre.x()) - rays.origin.x, Lanes(centre.y()) - rays.origin.y,
                       Lanes(centre.z()) - rays.origin.z};
    const Lanes at = (to.x * axis.x() + to.y * axis.y() + to.z * axis.z()) /
                     (d.x * axis.x() + d.y * axis.y() + d.z * axis.z());
    const Lanes3 off = {at * d.x - to.x, at * d.y - to.y, at * d.z - to.z};
    return struck.take(
        (dot(off, off) < Lanes(radius_m * radius_m)) & (Lanes(near) <= at) & (at < struck.range),
        at, number);
  }
};

// The convex hull of two balls: their surfaces and the cone that touches both, along circles.
struct RoundCone {
  RoundCone(const Eigen::Vector3f& from, float radius_from, const Eigen::Vector3f& to,
            float radius_to)
      : foot(from), top(to), foot_radius(radius_from), top_radius(radius_to) {
    const float apart = (to - from).norm();
    const float narrows = radius_from - radius_to;
    if (!(apart > std::abs(narrows))) return;  // one ball holds the other
    axis = (to - from) / apart;
    length = apart;
    sine = narrows / apart;
    cosine2 = 1.0F - sine * sine;
  }

  // Outwards at a place on the surface: away from the ball that touches it there.
  [[nodiscard]] Eigen::Vector3f normal(const Eigen::Vector3f& place) const {
    const Eigen::Vector3f from_foot = place - foot;
    if (length == 0.0F) return foot_radius >= top_radius ? from_foot : (place - top).eval();
    const float along = (from_foot.dot(axis) - sine * foot_radius) / cosine2;
    return from_foot - std::clamp(along, 0.0F, length) * axis;
  }
  [[nodiscard]] Eigen::AlignedBox3f box() const {
    const Eigen::AlignedBox3f low((foot.array() - foot_radius).matrix(),
                                  (foot.array() + foot_radius).matrix());
    const Eigen::AlignedBox3f high((top.array() - top_radius).matrix(),
                                   (top.array() + top_radius).matrix());
    return low.merged(high);
  }

  // Where rays enter the body, or, where that lies before `near`, leave it.
  bool meet(const RayLanes& rays, float near, std::uint32_t number, RayHits& struck) const {
    Lanes at = pass<true>(rays);
    const LaneMask before = at < Lanes(near);
    if (before.bits() != 0) at = select(before, pass<false>(rays), at);
    return struck.take((Lanes(near) <= at) & (at < struck.range), at, number);
  }

  Eigen::Vector3f foot;
  Eigen::Vector3f top;
  float foot_radius;
  float top_radius;
  Eigen::Vector3f axis = Eigen::Vector3f::UnitZ();
  float length = 0.0F;  // 0 where there is no cone
  float sine = 0.0F;
  float cosine2 = 1.0F;

 private:
  // A line enters a convex body once, where it first enters one of the balls or, between their
  // circles, the cone. It leaves where it last leaves one of these. With a = height along the axis
  // above the foot, r = foot_radius, s = sine and c = cosine of half the cone's angle. Places w
  // from the foot lie on the cone where c^2 (|w|^2 - a^2) = (r - a s)^2.
  template <bool kEnter>
  [[nodiscard]] Lanes pass(const RayLanes& rays) const {
    const Lanes3& d = rays.direction;
    const Lanes dd = dot(d, d);
    const Lanes3 start = {rays.origin.x - foot.x(), rays.origin.y - foot.y(),
                          rays.origin.z - foot.z()};
    // From the place that is nearest to the foot: squares of small numbers lose less.
    const Lanes ahead = Lanes(0.0F) - dot(start, d) / dd;
    const Lanes3 w = {start.x + ahead * d.x, start.y + ahead * d.y, start.z + ahead * d.z};
    const Lanes ww = dot(w, w);
    const Lanes wd = dot(w, d);
    const Lanes3 v = {w.x - (top.x() - foot.x()), w.y - (top.y() - foot.y()),
                      w.z - (top.z() - foot.z())};
    const Lanes first = pass_ball<kEnter>(wd, dd, ww, foot_radius);
    const Lanes second = pass_ball<kEnter>(dot(v, d), dd, dot(v, v), top_radius);
    Lanes at = kEnter ? min(first, second) : max(first, second);
    if (length == 0.0F) return ahead + at;
    const Lanes rise = d.x * axis.x() + d.y * axis.y() + d.z * axis.z();
    const Lanes height = w.x * axis.x() + w.y * axis.y() + w.z * axis.z();
    const Lanes rs(foot_radius * sine);
    const Lanes a = dd * cosine2 - rise * rise;
    const Lanes b = wd * cosine2 - rise * (height - rs);
    const Lanes c =
        ww * cosine2 - height * height + (height + height) * rs - Lanes(foot_radius * foot_radius);
    const Lanes square = b * b - a * c;
    const Lanes root = sqrt(square);
    const Lanes t = (kEnter ? Lanes(0.0F) - b - root : root - b) / a;
    const Lanes up = height + t * rise;
    const LaneMask between =
        (rs <= up) & (up <= Lanes(length + top_radius * sine)) & (Lanes(0.0F) <= square);
    at = select(between, kEnter ? min(t, at) : max(t, at), at);
    return ahead + at;
  }

  // Range until a ray enters or leaves a ball, infinitely far or behind if it does not.
  template <bool kEnter>
  static Lanes pass_ball(Lanes wd, Lanes dd, Lanes ww, float radius) {
    constexpr float kFar = std::numeric_limits<float>::infinity();
    const Lanes square = wd * wd - dd * (ww - Lanes(radius * radius));
    const Lanes root = sqrt(square);
    const Lanes at = (kEnter ? Lanes(0.0F) - wd - root : root - wd) / dd;
    return select(Lanes(0.0F) <= square, at, Lanes(kEnter ? kFar : -kFar));
  }
};

}  // namespace understory
