// What writers of tables hand back is what readers of these tables get, bit for bit: so a run need
// not read its own files.
#include <gtest/gtest.h>

#include <bit>

#include "understory/evaluation/trajectory.h"
#include "understory/output/run_tables.h"
#include "understory/recording/clouds/stems_file.h"
#include "understory/util/files/folder_test_support.h"
#include "understory/util/random.h"

namespace understory {
namespace {

float between(Random& random, double low, double high) {
  return static_cast<float>(random.uniform(low, high));
}

Stem any_stem(Random& random) {
  Stem stem;
  stem.point = {between(random, -40.0, 40.0), between(random, -40.0, 40.0),
                between(random, -0.0004, 0.0004)};
  stem.axis = Eigen::Vector3f(between(random, -0.2, 0.2), between(random, -0.2, 0.2), 1.0F);
  stem.axis.normalize();
  stem.length_m = between(random, 0.1, 20.0);
  stem.dbh_m = between(random, 0.05, 0.9);
  stem.score = between(random, 0.0, 1.0);
  stem.xx = between(random, 1e-5, 0.1);
  stem.xy = between(random, -0.01, 0.01);
  stem.yy = between(random, 1e-5, 0.1);
  stem.zz = between(random, 1e-4, 90.0);
  return stem;  // its radius is not known
}

std::vector<std::uint32_t> bits_of(const Stem& stem) {
  std::vector<std::uint32_t> bits;
  for (const float value : {stem.point.x(), stem.point.y(), stem.point.z(), stem.axis.x(),
                            stem.axis.y(), stem.axis.z(), stem.length_m, stem.dbh_m, stem.score,
                            stem.radius_m, stem.radius_sd_m, stem.xx, stem.xy, stem.yy, stem.zz})
    bits.push_back(std::isnan(value) ? 0x7FC00000U : std::bit_cast<std::uint32_t>(value));
  return bits;
}

TEST(WrittenValues, StemsAreThoseThatAReaderGets) {
  const test::TemporaryFolder folder;
  Random random(4);
  StemsWriter writer(folder / "stems.csv.gz");
  std::vector<StemView> written;
  for (int frame = 0; frame < 20; ++frame) {
    StemView view{frame, 1'700'000'000'000'000'001 + frame * kNsPerSecond, {}};
    for (int i = 0; i < 20; ++i)
      view.stems.push_back(writer.add(frame, view.stamp, any_stem(random)));
    Stem bare;  // nothing but its place is known
    bare.point = {1.0F, 2.0F, 3.0F};
    view.stems.push_back(writer.add(frame, view.stamp, bare));
    written.push_back(view);
  }
  writer.commit();
  Log log;
  const std::vector<StemView> read = read_stem_views(folder / "stems.csv.gz", log);
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t k = 0; k < read.size(); ++k) {
    EXPECT_EQ(read[k].stamp, written[k].stamp);
    ASSERT_EQ(read[k].stems.size(), written[k].stems.size());
    for (std::size_t i = 0; i < read[k].stems.size(); ++i)
      EXPECT_EQ(bits_of(read[k].stems[i]), bits_of(written[k].stems[i])) << k << " " << i;
  }
}

TEST(WrittenValues, PosesAreThoseThatAReaderGets) {
  const test::TemporaryFolder folder;
  Random random(5);
  TumWriter writer(folder / "trajectory.tum");
  Trajectory written;
  for (int i = 0; i < 200; ++i) {
    Vector6d screw;
    for (int k = 0; k < 6; ++k)
      screw[k] = random.uniform(-3.0, 3.0);
    written.push_back(writer.add({1'700'000'000'000'000'003 + i, Pose::exp(screw)}));
  }
  writer.commit();
  const Trajectory read = read_trajectory(folder / "trajectory.tum");
  ASSERT_EQ(read.size(), written.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    EXPECT_EQ(read[i].stamp, written[i].stamp);
    EXPECT_EQ(read[i].world_from_body.matrix(), written[i].world_from_body.matrix()) << i;
    EXPECT_EQ(read[i].world_from_body.rotation().coeffs(),
              written[i].world_from_body.rotation().coeffs());
  }
}

}  // namespace
}  // namespace understory
