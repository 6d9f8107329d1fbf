#include "understory/simulation/scene/shapes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "understory/util/angles.h"

namespace understory {
namespace {

using Vector = Eigen::Vector3d;

void add_triangle(Shape& shape, const Vector& a, const Vector& b, const Vector& c) {
  const int first = static_cast<int>(shape.vertices.size());
  shape.vertices.push_back(a.cast<float>());
  shape.vertices.push_back(b.cast<float>());
  shape.vertices.push_back(c.cast<float>());
  shape.triangles.emplace_back(first, first + 1, first + 2);
}

Vector any_direction(Random& random) {
  const double z = random.uniform(-1.0, 1.0);
  const double angle = random.uniform(0.0, kTau);
  const double r = std::sqrt(1.0 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// A leaf or a tuft of needles: one triangle of the given size, turned anyhow.
void add_leaf(Shape& shape, const Vector& place, double length, double width, Random& random) {
  const Vector along = any_direction(random);
  const Vector across = along.cross(any_direction(random)).normalized();
  add_triangle(shape, place - 0.5 * length * along, place + 0.5 * length * along,
               place + width * across);
}

// A thin branch: two crossing blades that taper to a point, seen from every side.
void add_branch(Shape& shape, const Vector& from, const Vector& to, double radius) {
  const Vector axis = (to - from).normalized();
  Vector side = axis.cross(Vector::UnitZ());
  if (side.norm() < 1e-3) side = Vector::UnitX();
  side.normalize();
  const Vector up = axis.cross(side);
  // Cut in pieces so that the boxes around slanting branches stay small.
  const int pieces = std::max(1, static_cast<int>((to - from).norm() / 0.2));
  for (const Vector& blade : {side, up}) {
    for (int i = 0; i < pieces; ++i) {
      const double u = static_cast<double>(i) / pieces;
      const double v = static_cast<double>(i + 1) / pieces;
      const Vector a = from + u * (to - from);
      const Vector b = from + v * (to - from);
      const double wide = radius * (1.0 - 0.8 * u);
      add_triangle(shape, a - wide * blade, a + wide * blade, b);
    }
  }
}

struct Habit {
  double whorl_m;     // between whorls
  int branches;       // in a whorl
  double angle_top;   // of branches above the horizontal at the top, rad
  double angle_base;  // and at the crown's base
  double leaf_length_m;
  double leaf_width_m;
  double leaves_per_m;  // of branch
  double spread_m;      // of leaves around the branch
};

Habit habit_of(Species species) {
  switch (species) {
    case Species::kPine:
      return {0.42, 5, 0.8, -0.1, 0.175, 0.10, 19.0, 0.16};
    case Species::kSpruce:
      return {0.30, 6, 0.5, -0.35, 0.145, 0.08, 17.0, 0.09};
    case Species::kBirch:
      return {0.30, 3, 1.1, 0.6, 0.09, 0.07, 21.0, 0.22};
  }
  return {};
}

// Radius of the crown at a share of its length, 0 at the base.
double crown_profile(Species species, double u) {
  switch (species) {
    case Species::kPine:
      return u < 0.35 ? 0.75 + 0.71 * u : std::sqrt(1.0 - std::pow((u - 0.35) / 0.65, 2.0));
    case Species::kSpruce:
      return 1.0 - 0.93 * u;
    case Species::kBirch:
      return std::pow(std::sin(std::numbers::pi * (0.14 + 0.82 * u)), 0.7);
  }
  return 1.0;
}

// Share of their needles that the branches of a pine keep. Those in the shade of the crown above
// are long and thin, and many of them bare.
double lit_share(Species species, double u, Random& random) {
  if (species != Species::kPine) return 1.0;
  const double light = std::clamp(0.45 + 1.6 * u, 0.0, 1.0);
  return light * random.uniform(1.6 * light - 0.6, 1.0 + 0.6 * (1.0 - light));
}

// A branch with leaves: where it begins, metres, where it points, rad, and the share of its leaves.
struct LivingBranch {
  Vector root;
  double azimuth;
  double slope;
  double length;
  double foliage;
};

void add_living_branch(Shape& shape, const Habit& habit, const LivingBranch& branch,
                       Random& random) {
  const auto& [root, azimuth, slope, length, foliage] = branch;
  const Vector out(std::cos(azimuth) * std::cos(slope), std::sin(azimuth) * std::cos(slope),
                   std::sin(slope));
  const Vector tip = root + length * out;
  add_branch(shape, root, tip, std::min(0.02, 0.004 + 0.006 * length));
  const int leaves = static_cast<int>(habit.leaves_per_m * length * foliage + random.uniform());
  for (int i = 0; i < leaves; ++i) {
    const double u = 0.15 + 0.9 * std::sqrt(random.uniform());
    const double spread = habit.spread_m * (1.25 - 0.6 * u) * std::min(1.0, length);
    const Vector place = root + u * length * out + spread * random.normal() * any_direction(random);
    add_leaf(shape, place, habit.leaf_length_m * random.uniform(0.7, 1.3),
             habit.leaf_width_m * random.uniform(0.7, 1.3), random);
  }
}

}  // namespace

Shape grow_crown(Species species, const CrownSize& size, Random& random) {
  const Habit habit = habit_of(species);
  Shape shape;
  if (size.foliage <= 0.0) return shape;  // a winter without twigs: for tests
  const double length = size.height_m - size.crown_base_m;
  for (double z = 0.0; z < length; z += habit.whorl_m * random.uniform(0.75, 1.25)) {
    const double u = z / length;
    const double turn = random.uniform(0.0, kTau);
    for (int k = 0; k < habit.branches; ++k) {
      if (random.chance(0.12)) continue;
      const double azimuth = turn + kTau * k / habit.branches + 0.25 * random.normal();
      const double slope =
          habit.angle_base + (habit.angle_top - habit.angle_base) * u + 0.12 * random.normal();
      const double radius =
          size.crown_radius_m * crown_profile(species, u) * random.uniform(0.65, 1.1);
      const double reach = std::max(0.12, radius / std::max(0.5, std::cos(slope)));
      const LivingBranch branch{Vector(0.0, 0.0, size.crown_base_m + z), azimuth, slope,
                                std::min(reach, 0.8 * (length - z) + 0.3),
                                size.foliage * std::max(0.0, lit_share(species, u, random))};
      add_living_branch(shape, habit, branch, random);
    }
  }
  return shape;
}

Shape grow_dead_branches(Species species, const CrownSize& size, Random& random) {
  Shape shape;
  const double lowest = species == Species::kSpruce ? 0.4 : 1.6;
  const double per_m = (species == Species::kBirch ? 1.0 : 7.0) * size.dead_branches;
  const double span = std::max(0.0, size.crown_base_m - lowest);
  const int count = static_cast<int>(per_m * span + random.uniform());
  for (int i = 0; i < count; ++i) {
    const double share = std::pow(random.uniform(), 0.65);  // more of them towards the crown
    const double z = lowest + share * span;
    const double azimuth = random.uniform(0.0, kTau);
    const double length = random.uniform(0.15, 0.75) * size.crown_radius_m * (0.35 + 0.65 * share);
    const double slope = random.normal(-0.1, 0.3);
    const Vector root(0.0, 0.0, z);
    const Vector out(std::cos(azimuth) * std::cos(slope), std::sin(azimuth) * std::cos(slope),
                     std::sin(slope));
    const Vector tip = root + length * out;
    add_branch(shape, root, tip, 0.007);
    const int twigs = static_cast<int>(random.below(4));
    for (int k = 0; k < twigs; ++k) {
      const Vector fork = root + random.uniform(0.3, 0.9) * (tip - root);
      add_branch(shape, fork, fork + 0.4 * length * (0.6 * out + 0.5 * any_direction(random)),
                 0.003);
    }
  }
  return shape;
}

Shape grow_plant(PlantKind kind, Random& random) {
  Shape shape;
  if (kind == PlantKind::kSeedling) {
    add_branch(shape, Vector::Zero(), Vector(0.0, 0.0, 1.0), 0.012);
    for (int i = 0; i < 260; ++i) {
      const double z = 0.12 + 0.88 * random.uniform();
      const double r = 0.30 * (1.05 - z) * std::sqrt(random.uniform());
      const double angle = random.uniform(0.0, kTau);
      add_leaf(shape, {r * std::cos(angle), r * std::sin(angle), z}, 0.06, 0.035, random);
    }
  } else if (kind == PlantKind::kShrub) {
    for (int k = 0; k < 9; ++k) {
      const Vector lean = any_direction(random);
      const Vector tip(0.4 * lean.x(), 0.4 * lean.y(), random.uniform(0.6, 1.0));
      add_branch(shape, Vector(0.05 * lean.x(), 0.05 * lean.y(), 0.0), tip, 0.006);
      for (int i = 0; i < 40; ++i) {
        const Vector place =
            tip * random.uniform(0.25, 1.05) + 0.1 * random.normal() * any_direction(random);
        add_leaf(shape, place, 0.05, 0.035, random);
      }
    }
  } else {
    for (int i = 0; i < 110; ++i) {
      const double r = 0.7 * std::sqrt(random.uniform());
      const double angle = random.uniform(0.0, kTau);
      add_leaf(shape, {r * std::cos(angle), r * std::sin(angle), random.uniform(0.1, 1.0)}, 0.085,
               0.042, random);
    }
  }
  return shape;
}

}  // namespace understory
