#include <gtest/gtest.h>

#include <cstddef>

#include "understory/calibration/lidar_imu/clock_check.h"
#include "understory/calibration/lidar_imu/online_calibration.h"
#include "understory/georeference/satellites/in_match/satellite_belief.h"
#include "understory/georeference/satellites/online_georeference.h"
#include "understory/map/keyframes/returning_keyframes.h"
#include "understory/map/loop_closer.h"
#include "understory/odometry/dense/lidar_agreement.h"
#include "understory/odometry/dense/recovery.h"
#include "understory/odometry/imu/imu_watch.h"
#include "understory/pipeline/judgement/imu_usage.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/pipeline/mapping/sensor_traits.h"
#include "understory/pipeline/run_folder/checkpoint.h"
#include "understory/preprocess/carried_returns.h"
#include "understory/preprocess/streams/event_orderer.h"
#include "understory/recording/messages/event_bytes.h"
#include "understory/recording/messages/fix_joiner.h"
#include "understory/recording/messages/topic_statistics.h"
#include "understory/sensor/sensor_io.h"

namespace understory {
namespace {

template <typename Put>
std::size_t size_of(const Put& put) {
  BinaryWriter writer;
  put(writer);
  return writer.bytes().size();
}

// A regression: what the parts of a checkpoint keep had grown, and its number had not. A run that
// was begun before would have been read as another one. Where this fails, kCheckpointFormat grows
// by one, and the sizes here become the new ones.
TEST(CheckpointFormat, GrowsWithWhatIsKept) {
  EXPECT_EQ(kCheckpointFormat, 19);
  Log log;
  const auto saved = [](const auto& part) {
    return size_of([&](BinaryWriter& writer) { part.save(writer); });
  };
  EXPECT_EQ(saved(EventOrderer(EventOrderer::Config(), log)), 1142U);
  EXPECT_EQ(saved(ImuWatch(9.81, nullptr)), 613U);
  EXPECT_EQ(saved(ImuUsage()), 25U);
  EXPECT_EQ(saved(LidarAgreement()), 13U);
  EXPECT_EQ(saved(LidarOffsetSums()), 244U);
  EXPECT_EQ(saved(LidarImuClockCheck()), 41U);
  EXPECT_EQ(saved(OnlineImuCalibration()), 569U);
  EXPECT_EQ(size_of([](BinaryWriter& writer) { put_conditions(writer, {}); }), 24U);
  EXPECT_EQ(saved(OnlineGeoreference(OnlineGeoreferenceConfig())), 221439U);
  EXPECT_EQ(saved(TopicStatistics()), 136U);
  EXPECT_EQ(saved(Recovery(30)), 108U);
  EXPECT_EQ(saved(CarriedReturns(CarriedReturnsConfig())), 20U);
  EXPECT_EQ(saved(LoopCloser(LoopCloserConfig(), LocalMapConfig())), 17U);
  EXPECT_EQ(saved(SatelliteBelief(SatelliteBeliefConfig(), 0.1)), 221683U);
  EXPECT_EQ(saved(ReturningKeyframes()), 16U);
  EXPECT_EQ(sizeof(DenseCounts), 184U);
  EXPECT_EQ(saved(FixJoiner()), 55U);
  EXPECT_EQ(size_of([](BinaryWriter& writer) { put_traits(writer, {}); }), 62U);
  EXPECT_EQ(size_of([](BinaryWriter& writer) { put_rig(writer, {}); }), 148U);
  EXPECT_EQ(size_of([](BinaryWriter& writer) { put_fix(writer, {}); }), 160U);
  EXPECT_EQ(size_of([](BinaryWriter& writer) { put_imu(writer, {}); }), 57U);
}

}  // namespace
}  // namespace understory
