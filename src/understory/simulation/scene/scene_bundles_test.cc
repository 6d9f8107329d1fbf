#include "understory/simulation/scene/scene_bundles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "understory/simulation/world.h"
#include "understory/util/random.h"

namespace understory {
namespace {

Eigen::Vector3f somewhere(Random& random, double reach) {
  return Eigen::Vector3d(random.uniform(-reach, reach), random.uniform(-reach, reach),
                         random.uniform(-reach, reach))
      .cast<float>();
}

Eigen::Vector3f any_direction(Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal())
      .normalized()
      .cast<float>();
}

// Eight rays of a beam of 6 mrad and 1 cm, or of one much wider.
std::vector<Ray> beam(Random& random, const Eigen::Vector3f& from, const Eigen::Vector3f& along,
                      float spread) {
  std::vector<Ray> rays(kLanes);
  for (Ray& ray : rays) {
    ray.origin = from + 0.01F * any_direction(random);
    ray.direction = (along + spread * any_direction(random)).normalized();
  }
  return rays;
}

RayLanes lanes(const std::vector<Ray>& rays) {
  std::array<float, kLanes> values[6];
  for (std::size_t i = 0; i < kLanes; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) {
      values[k][i] = rays[i].origin[k];
      values[k + 3][i] = rays[i].direction[k];
    }
  }
  return {
      {Lanes::load(values[0].data()), Lanes::load(values[1].data()), Lanes::load(values[2].data())},
      {Lanes::load(values[3].data()), Lanes::load(values[4].data()),
       Lanes::load(values[5].data())}};
}

LaneMask all_lanes() {
  return Lanes(0.0F) <= Lanes(0.0F);
}

// Whether a ray is in a box at some range from 0 to 100, in twice the digits.
bool passes(const Ray& ray, const Eigen::AlignedBox3f& box) {
  double from = 0.0;
  double to = 100.0;
  for (Eigen::Index k = 0; k < 3; ++k) {
    const double a = (double(box.min()[k]) - ray.origin[k]) / ray.direction[k];
    const double b = (double(box.max()[k]) - ray.origin[k]) / ray.direction[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to;
}

TEST(FatRay, MeetsEveryBoxThatOneOfItsRaysMeets) {
  Random random(4, 1);
  std::vector<Eigen::AlignedBox3f> boxes;
  for (int i = 0; i < 3000; ++i) {
    const Eigen::Vector3f corner = somewhere(random, 20.0);
    boxes.emplace_back(corner, corner + somewhere(random, 1.0).cwiseAbs());
    if (i % 5 == 0) boxes.back().max()[i % 3] = boxes.back().min()[i % 3];  // flat
  }
  const BoxTree tree(boxes);
  std::size_t met = 0;
  for (int round = 0; round < 300; ++round) {
    Eigen::Vector3f along = any_direction(random);
    if (round % 3 == 0) along[round % 9 / 3] = 0.0F;  // rays go both ways along an axis
    const std::vector<Ray> rays =
        beam(random, somewhere(random, 25.0), along.normalized(), round % 2 == 0 ? 0.003F : 0.3F);
    std::set<std::uint32_t> found;
    float far = 100.0F;
    walk(
        tree, FatRay(lanes(rays), all_lanes(), tree.frame()), 0.0F, far, [](std::uint32_t) {},
        [&](std::uint32_t place, float) { found.insert(tree.order()[place]); });
    met += found.size();
    for (std::uint32_t i = 0; i < boxes.size(); ++i) {
      const bool passed = std::any_of(rays.begin(), rays.end(),
                                      [&](const Ray& ray) { return passes(ray, boxes[i]); });
      ASSERT_TRUE(!passed || found.count(i) == 1) << "box " << i << " in round " << round;
    }
  }
  EXPECT_LT(met, 300U * 400U);  // it does leave out most of them
}

// A place's distance outside of the convex hull of two balls, in twice the digits. It is the least
// over the balls between, along which it has one minimum.
double outside(const RoundCone& cone, const Eigen::Vector3d& place) {
  const auto off = [&](double u) {
    const Eigen::Vector3d centre =
        (1.0 - u) * cone.foot.cast<double>() + u * cone.top.cast<double>();
    return (place - centre).norm() - ((1.0 - u) * cone.foot_radius + u * cone.top_radius);
  };
  double low = 0.0;
  double high = 1.0;
  while (high - low > 1e-6) {
    const double third = (high - low) / 3.0;
    off(low + third) < off(high - third) ? high -= third : low += third;
  }
  return off(0.5 * (low + high));
}

TEST(RoundCone, IsMetOnItsSurfaceAndNotPassedThrough) {
  Random random(5, 1);
  int met = 0;
  for (int round = 0; round < 150; ++round) {
    const Eigen::Vector3f foot = somewhere(random, 1.0);
    const RoundCone cone(foot, static_cast<float>(random.uniform(0.02, 0.4)),
                         foot + somewhere(random, 1.2),
                         static_cast<float>(random.uniform(0.01, 0.3)));
    const Eigen::Vector3f from = 15.0F * any_direction(random);
    const Eigen::Vector3f to = 0.5F * (cone.foot + cone.top);
    std::vector<Ray> rays = beam(random, from, (to - from).normalized(), 0.02F);
    for (Ray& ray : rays)
      ray.direction *= 0.5F;  // need not be of unit length
    RayHits struck{100.0F, 0.0F, 0.0F};
    cone.meet(lanes(rays), 0.0F, 7, struck);
    std::array<float, kLanes> ranges;
    struck.range.store(ranges.data());
    for (std::size_t i = 0; i < kLanes; ++i) {
      const Eigen::Vector3d origin = rays[i].origin.cast<double>();
      const Eigen::Vector3d direction = rays[i].direction.cast<double>();
      double nearest = 1e9;  // of the ray's places before what it met
      for (double t = 24.0; t < std::min(36.0F, ranges[i] - 0.01F); t += 0.02)
        nearest = std::min(nearest, outside(cone, origin + t * direction));
      EXPECT_GT(nearest, ranges[i] < 100.0F ? 0.0 : -1e-4) << "round " << round;
      if (ranges[i] >= 100.0F) continue;
      ++met;
      const Eigen::Vector3d place = origin + double(ranges[i]) * direction;
      EXPECT_NEAR(outside(cone, place), 0.0, 2e-5);
      const Eigen::Vector3d normal = cone.normal(place.cast<float>()).cast<double>().normalized();
      EXPECT_NEAR(outside(cone, place + 0.05 * normal), 0.05, 1e-3);
    }
  }
  EXPECT_GT(met, 600);
}

TEST(Disc, IsMetWithinItsRadius) {
  Random random(6, 1);
  int met = 0;
  for (int round = 0; round < 500; ++round) {
    const std::vector<TreeCloud::Disc> one = {
        {somewhere(random, 1.0), any_direction(random), 0.3F}};
    const RayShape shape(one);
    const Eigen::Vector3f from = 5.0F * any_direction(random);
    const std::vector<Ray> rays = beam(random, from, (one[0].centre - from).normalized(), 0.05F);
    RayHits struck{100.0F, 0.0F, 0.0F};
    shape.cast(lanes(rays), all_lanes(), 0.0F, struck);
    std::array<float, kLanes> ranges;
    struck.range.store(ranges.data());
    for (std::size_t i = 0; i < kLanes; ++i) {
      const double at = double((one[0].centre - rays[i].origin).dot(one[0].normal)) /
                        double(rays[i].direction.dot(one[0].normal));
      const double off =
          (rays[i].origin + static_cast<float>(at) * rays[i].direction - one[0].centre).norm();
      if (std::abs(off - 0.3) < 1e-4) continue;
      ASSERT_EQ(ranges[i] < 100.0F, off < 0.3);
      if (off > 0.3) continue;
      ++met;
      EXPECT_NEAR(ranges[i], at,
                  2e-5 * (1.0 + 1.0 / std::abs(rays[i].direction.dot(one[0].normal))));
    }
  }
  EXPECT_GT(met, 1000);
}

TEST(ObjectField, MeetsObjectsWhereTheyAreNow) {
  Cones ball;
  ball.add(Eigen::Vector3d::Zero(), 0.5);
  ball.join();
  ball.add(Eigen::Vector3d::Zero(), 0.5);
  const RayShape shape(ball);
  ObjectField::Placement placed;
  placed << Eigen::Matrix3f::Identity(), Eigen::Vector3f(10.0F, 0.0F, 0.0F);
  ObjectField field;
  const std::uint32_t first = field.add(shape, placed);
  placed.col(3).x() = 20.0F;
  field.add(shape, placed);
  field.commit();
  Random random(9, 1);
  const Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  const std::vector<Ray> east = beam(random, origin, Eigen::Vector3f::UnitX(), 0.001F);
  const std::vector<Ray> north = beam(random, origin, Eigen::Vector3f::UnitY(), 0.001F);
  const auto range = [&](const std::vector<Ray>& rays) {
    RayHits struck{100.0F, 0.0F, 0.0F};
    field.cast(lanes(rays), all_lanes(), 0.0F, struck);
    std::array<float, kLanes> ranges;
    struck.range.store(ranges.data());
    return *std::min_element(ranges.begin(), ranges.end());
  };
  EXPECT_NEAR(range(east), 9.5F, 0.02F);
  EXPECT_EQ(range(north), 100.0F);
  placed.col(3) = Eigen::Vector3f(0.0F, 30.0F, 0.0F);
  field.move(first, placed);
  field.commit();
  EXPECT_NEAR(range(east), 19.5F, 0.02F);
  EXPECT_NEAR(range(north), 29.5F, 0.02F);
  placed.col(1).y() = 8.0F;  // eight times as long towards the rays
  field.move(first, placed);
  field.commit();
  EXPECT_NEAR(range(north), 26.0F, 0.02F);
  field.show(first, false);
  EXPECT_EQ(range(north), 100.0F);
}

struct Difference {
  int beams = 0;
  int rays_that_met = 0;
  int others = 0;  // another thing or more than a millimetre away
};

// Casts the same beams into a scene for rays and into one for bundles.
Difference compare(const std::vector<std::string>& settings, const char* name, double wind_s,
                   double stand_s) {
  std::vector<std::string> bundled = settings;
  bundled.emplace_back("lidar.rays_per_beam=8");
  SimulatedWorld by_rays(load_site(name, settings));
  SimulatedWorld by_beams(load_site(name, bundled));
  by_rays.scene.arrange(wind_s, stand_s);
  by_beams.scene.arrange(wind_s, stand_s);
  Random random(7, 1);
  Difference difference;
  for (; difference.beams < 4000; ++difference.beams) {
    const Eigen::Vector3f place =
        by_rays.plan.path.pose(random.uniform(0.0, by_rays.plan.path.duration_s()))
            .translation()
            .cast<float>();
    Eigen::Vector3f along = any_direction(random);
    along.z() *= 0.5F;
    std::vector<Ray> rays = beam(random, place, along.normalized(), 0.003F);
    for (Ray& ray : rays)
      ray.time_s = 0.03F;
    std::array<Hit, kLanes> first;
    std::array<Hit, kLanes> second;
    by_rays.scene.cast(rays.data(), kLanes, 0.5F, 55.0F, first.data());
    by_beams.scene.cast(rays.data(), kLanes, 0.5F, 55.0F, second.data(), kLanes);
    for (std::size_t i = 0; i < kLanes; ++i) {
      const Hit& a = first[i];
      const Hit& b = second[i];
      difference.rays_that_met += a.surface != Surface::kNone ? 1 : 0;
      const bool same =
          a.surface == b.surface && a.tree == b.tree && a.reflectivity == b.reflectivity &&
          std::abs(a.range_m - b.range_m) < 1e-3F && std::abs(a.cosine - b.cosine) < 2e-3F;
      difference.others += same ? 0 : 1;
    }
  }
  return difference;
}

TEST(SceneBundles, MeetWhatRaysMeetInAStandInWind) {
  const Difference found = compare({"seed=3", "stand.size_x_m=60", "stand.size_y_m=60",
                                    "stand.boulders_per_ha=200", "stand.buildings=2"},
                                   "handheld", 8.0, 0.0);
  EXPECT_GT(found.rays_that_met, 8 * 1700);
  EXPECT_LT(found.others, 0.001 * found.rays_that_met);
}

TEST(SceneBundles, MeetWhatRaysMeetAfterAHarvest) {
  const Difference found = compare({"seed=3"}, "lieksa1", 900.0, 900.0);
  EXPECT_GT(found.rays_that_met, 8 * 1700);
  EXPECT_LT(found.others, 0.001 * found.rays_that_met);
}

TEST(SceneBundles, TakeBeamsOfAnyNumberOfRays) {
  SimulatedWorld world(load_site(
      "handheld", {"seed=3", "stand.size_x_m=50", "stand.size_y_m=50", "lidar.rays_per_beam=8"}));
  Random random(8, 1);
  const Eigen::Vector3f place = world.plan.path.pose(1.0).translation().cast<float>();
  for (const std::size_t count : {4UL, 7UL, 9UL, 21UL}) {
    std::vector<Ray> rays;
    while (rays.size() < 50 * count) {
      const std::vector<Ray> more = beam(random, place, any_direction(random), 0.003F);
      rays.insert(rays.end(), more.begin(), more.end());
    }
    rays.resize(50 * count);
    std::vector<Hit> together(rays.size());
    std::vector<Hit> alone(rays.size());
    world.scene.cast(rays.data(), rays.size(), 0.5F, 55.0F, together.data(), count);
    world.scene.cast(rays.data(), rays.size(), 0.5F, 55.0F, alone.data(), 1);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      ASSERT_EQ(together[i].range_m, alone[i].range_m) << count << " rays a beam, ray " << i;
      ASSERT_EQ(together[i].surface, alone[i].surface);
    }
  }
}

}  // namespace
}  // namespace understory
