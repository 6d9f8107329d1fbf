#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "understory/calibration/lidar_imu/clock_check.h"
#include "understory/calibration/lidar_imu/online_calibration.h"
#include "understory/georeference/satellites/in_match/satellite_belief.h"
#include "understory/map/keyframes/keyframe_map.h"
#include "understory/odometry/dense/dense_odometry.h"
#include "understory/odometry/dense/recovery.h"
#include "understory/odometry/dense/start_in_motion.h"
#include "understory/pipeline/judgement/imu_usage.h"
#include "understory/pipeline/mapping/adaptation.h"
#include "understory/pipeline/mapping/dense/fix_file.h"
#include "understory/pipeline/mapping/dense/map_points.h"
#include "understory/pipeline/mapping/dense/paths_between_scans.h"
#include "understory/pipeline/mapping/dense/stored_clouds.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/run_folder/journal.h"
#include "understory/recording/recording.h"
#include "understory/sensor/gnss_fix.h"
#include "understory/util/log.h"
#include "understory/util/timing.h"

namespace understory {

// A scan with fewer points after preprocessing tells nothing.
inline constexpr std::size_t kFewPoints = 100;

// Counts of one run, for run.json and for what to distrust.
struct DenseCounts {
  std::uint64_t scans = 0;
  std::uint64_t unmatched = 0;    // no usable match; the prediction stands in
  std::uint64_t gated = 0;        // dropped by the velocity gate (P2-8)
  std::uint64_t empty_scans = 0;  // hardly any point left after preprocessing
  std::uint64_t segments = 1;     // pieces of map that hang together by predictions only
  std::uint64_t lost_in_a_row = 0;
  std::uint64_t parts = 0;  // of a turn, at the beginning of the recording; left out
  TimeNs first_lost = 0;    // when the second piece began
  std::uint64_t imu_samples = 0;
  std::uint64_t points = 0;
  std::uint64_t weather_points = 0;  // that the weather filter dropped
  std::uint64_t carried_points = 0;  // that go along with the lidar and were not matched
  std::uint64_t by_satellites = 0;   // scans whose match or place satellites told something of
  std::uint64_t repeated = 0;        // scans that hold the same points as the one before
  std::uint64_t last_content = 0;    // of the last scan, see content_of
  std::uint64_t predictions = 0;     // of trajectory_imu.tum
  std::uint64_t coasted = 0;         // those without the IMU, by constant velocity
  // Of trajectory_partial.tum: parts of scans, and those with a match. Then the sums of the times
  // from first to last point, of parts and of the whole scans.
  std::uint64_t scan_parts = 0;
  std::uint64_t scan_parts_matched = 0;
  std::uint64_t cut_scans = 0;
  TimeNs parts_span = 0;
  TimeNs cut_scans_span = 0;
  std::uint64_t by_tree_tops = 0;  // scans matched by their tree tops alone
};

// The front end that matches all points of a scan to a local map. It runs positioning (first
// graph), keyframes and local map (second graph), and the journal. The files in `folder` belong to
// it. `config` is adapted to the sensors (adapt()). Not thread-safe.
class DenseFrontEnd : public FrontEnd {
 public:
  // An IMU that `conditions` refuse or doubt is left out, or is left out until it is clear whether
  // it is right.
  DenseFrontEnd(const DenseMappingConfig& config, const SensorTraits& traits,
                const RunConditions& conditions, std::filesystem::path folder, Log& log);

  // `rig` is looked at when the first scan comes, and for the places of sensors that become known
  // later: they are used from then on.
  std::vector<PositionedScan> handle(const Event& event, const Rig& rig) override;
  std::vector<PositionedScan> finish(const Rig& rig) override;
  // Loops are taken over as soon as they are found.
  void run_in_real_time() override { map_->take_loops_when_found(); }
  [[nodiscard]] TimeNs first_scan() const override { return traits_.first_scan; }
  [[nodiscard]] ImuFinding imu_finding() const override;
  [[nodiscard]] std::optional<RefinedImu> refined_imu() const override;
  [[nodiscard]] FrontEndProgress progress() const override;
  [[nodiscard]] bool has_map() const override { return !map_->keyframes().empty(); }
  [[nodiscard]] std::string why_no_map(const Recording& source) const override;
  [[nodiscard]] std::unique_ptr<MapMaker> map_maker(const ReadRecording& recording) override;

  // State to go on from.
  void sync() override;
  void save(BinaryWriter& writer) const override;
  [[nodiscard]] std::vector<CountedFile> files() const override;
  // Instead of `handle`ing from the start.
  void load(BinaryReader& reader, const Rig& rig) override;

  [[nodiscard]] bool started() const { return odometry_ != nullptr; }
  // False during the first scans, which may be done again; no state can be saved then.
  [[nodiscard]] bool settled() const override { return opening_ == nullptr; }
  [[nodiscard]] const DenseMappingConfig& config() const { return config_; }
  [[nodiscard]] const SensorTraits& traits() const { return traits_; }
  // Why this run does without the IMU; empty if it does not.
  [[nodiscard]] const std::string& imu_refused() const { return conditions_.imu_refused; }
  [[nodiscard]] bool imu_cleared() const { return conditions_.imu_cleared; }
  [[nodiscard]] const Rig& rig() const { return rig_; }
  [[nodiscard]] const DenseCounts& counts() const { return received_.counts; }
  // For how long the IMU's samples could not be used.
  [[nodiscard]] const ImuUsage& imu_usage() const { return received_.imu_usage; }
  // How far the IMU's clock and axes seem to be off; nothing where it is not used or not told.
  [[nodiscard]] std::optional<ClockCheckResult> clock_check() const;
  // Place and clock of the IMU by the whole run, and what it was mapped with: as in
  // `refined_imu`. Nothing without `refine_imu` and where the motion does not tell them.
  [[nodiscard]] std::optional<OnlineImuEstimate> imu_calibration() const;
  [[nodiscard]] const std::optional<RefinedImu>& imu_used() const {
    return conditions_.imu_refined;
  }
  [[nodiscard]] const KeyframeMap& map() const { return *map_; }
  [[nodiscard]] KeyframeMap& map() { return *map_; }
  // Whether the configuration of this run has it use an IMU.
  [[nodiscard]] bool imu_wanted() const { return config_.odometry.imu_enabled; }
  [[nodiscard]] const Journal& journal() const { return *journal_; }
  [[nodiscard]] PathsBetweenScans& paths_between() { return between_; }
  [[nodiscard]] const StoredClouds& clouds() const { return clouds_; }
  // All fixes so far, which lie on disk: read anew at each call.
  [[nodiscard]] std::vector<GnssFix> fixes() const;
  [[nodiscard]] std::size_t fix_count() const;
  [[nodiscard]] const DenseOdometry& odometry() const { return *odometry_; }
  // What satellites say of the scans; null where they do nothing (`gnss.match.use`).
  [[nodiscard]] const SatelliteBelief* satellites() const { return satellites_.get(); }
  [[nodiscard]] StageTimes& times() { return times_; }
  // Set after each scan, for progress and latency.
  [[nodiscard]] TimeNs last_scan_end() const override { return last_scan_end_; }
  // Of the IMU; nothing if there has been no sample.
  [[nodiscard]] std::optional<TimeNs> last_imu() const;

 private:
  static constexpr const char* kJournalFile = "journal.bin";

  // What came of the recording so far.
  struct Received {
    DenseCounts counts;
    ImuUsage imu_usage;
    LidarImuClockCheck clock;
    std::optional<OnlineImuCalibration> calibration;  // with `refine_imu`
    std::deque<ImuSample> imu;   // all before the first scan, then the last ones
    std::vector<GnssFix> fixes;  // those that are not on disk yet
  };

  // The first two scans, which may be done again (odometry/dense/start_in_motion.h), and what there
  // was before them.
  struct Opening {
    std::vector<Event> events;
    AssumedMotion motion;
    int rounds = 0;
    Received before;
  };

  void refuse_imu(const std::string& reason);
  void take(const Event& event, const Rig& rig);
  void store_fixes();
  void make_odometry(const Rig& rig);
  void tell_of_imu(TimeNs now);
  void make_satellites();
  // How a scan was positioned.
  void tell_satellites(const DenseEstimate& estimate);
  void take_fix(const GnssFix& fix);
  [[nodiscard]] ScanKnowledge knowledge_of(const Scan& scan);
  void complete_rig(const Rig& rig);
  [[nodiscard]] bool without_samples() const;
  void take_sample(const ImuSample& sample);
  void start_anew();
  void predict_at(TimeNs stamp);
  void match_parts(const Scan& scan);
  void consider_opening(const Scan& scan, const DenseEstimate& estimate);
  void repeat_opening(const AssumedMotion& motion);
  void leave_out_first();
  void on_scan(const Scan& scan);
  [[nodiscard]] DenseEstimate begin_segment(const Scan& scan, const Pose& about_there);
  void update_map(const DenseEstimate& estimate, ScanRecord& record);
  void watch_memory();
  void move_world(const Pose& new_world_from_old_world);
  void note_outcome(const DenseEstimate& estimate, ScanRecord& record);
  void note_middle(const DenseEstimate& estimate, const ScanRecord& record);
  void check_clock(const DenseEstimate& estimate, const ScanRecord& record);
  void refine_rig();

  DenseMappingConfig config_;
  SensorTraits traits_;
  RunConditions conditions_;  // what earlier starts of this run found of the IMU
  std::filesystem::path folder_;
  Log& log_;
  StageTimes times_;
  Rig rig_;
  Received received_;
  std::unique_ptr<DenseOdometry> odometry_;
  std::unique_ptr<SatelliteBelief> satellites_;
  std::unique_ptr<KeyframeMap> map_;
  MapPoints map_points_;
  std::unique_ptr<Journal> journal_;
  StoredClouds clouds_;
  PathsBetweenScans between_;
  FixFile fix_file_;
  TimeNs last_scan_end_ = 0;
  PositionedScan positioned_;  // the last one
  Recovery recovery_;
  std::unique_ptr<Opening> opening_;  // until the first scans are settled
};

}  // namespace understory
