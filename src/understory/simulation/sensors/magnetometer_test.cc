#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "understory/simulation/carrier/carrier.h"
#include "understory/simulation/sensors/magnetometer.h"
#include "understory/util/angles.h"

namespace understory {
namespace {

TEST(Magnetometer, PointsNorthUntilIronBendsIt) {
  SiteConfig site;
  site.mag.noise_ut = 0.0;
  site.mag.declination_deg = -12.0;
  std::vector<Vector6d> controls(40, Vector6d::Zero());
  for (Vector6d& control : controls)
    control[5] = 0.7;  // faces 0.7 rad north of east
  const CarrierPath path(CarrierPath::Spline(controls, 0.05));
  const auto heading = [&](const SiteConfig& config) {
    Magnetometer mag(config, path, 0);
    for (int i = 0; i < 50; ++i)
      (void)mag.next();
    const Eigen::Vector3d field = 1e6 * mag.next().field;
    EXPECT_NEAR(field.norm(), config.mag.field_ut, 12.0);
    // Yaw from east such that the field points to magnetic north.
    return 90.0 - config.mag.declination_deg - std::atan2(field.y(), field.x()) / kDegree;
  };
  EXPECT_NEAR(heading(site), 0.7 / kDegree, 1e-6);
  double sum = 0.0;
  for (int seed = 1; seed <= 20; ++seed) {
    site.seed = seed;
    site.mag.hard_iron_ut = 5.0;
    site.mag.soft_iron = 0.03;
    sum += std::pow(heading(site) - 0.7 / kDegree, 2.0) / 20.0;
  }
  EXPECT_GT(std::sqrt(sum), 5.0);  // the papers: 15 to 20 degrees
  EXPECT_LT(std::sqrt(sum), 25.0);
}

}  // namespace
}  // namespace understory
