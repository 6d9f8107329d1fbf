#pragma once

#include <deque>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "understory/calibration/lidar_imu/clock_check.h"
#include "understory/odometry/stems/stem_pacer.h"
#include "understory/pipeline/judgement/imu_usage.h"
#include "understory/pipeline/mapping/front_end.h"
#include "understory/pipeline/run_folder/view_journal.h"
#include "understory/recording/recording.h"

namespace understory {

// The front end that matches stems to stems: finds the stems of each scan, positions it by them and
// keeps views of them. Views, poses and fixes lie on disk until the recording is over: memory does
// not grow with it. Its state can be saved between gaps of positioning (`settled`).
class SparseFrontEnd : public FrontEnd {
 public:
  // An IMU that `conditions` refuse is left out. `folder` is the work folder.
  SparseFrontEnd(const SparseMappingConfig& config, const RunConditions& conditions,
                 const std::filesystem::path& folder, Log& log);

  std::vector<PositionedScan> handle(const Event& event, const Rig& rig) override;
  std::vector<PositionedScan> finish(const Rig& rig) override;
  void run_in_real_time() override {}

  void sync() override;
  void save(BinaryWriter& writer) const override;
  [[nodiscard]] std::vector<CountedFile> files() const override;
  void load(BinaryReader& reader, const Rig& rig) override;
  [[nodiscard]] TimeNs last_scan_end() const override { return last_scan_end_; }
  // Whether no scan waits for its pose.
  [[nodiscard]] bool settled() const override { return waiting_ends_.empty(); }
  [[nodiscard]] TimeNs first_scan() const override { return counted_.first_scan; }
  [[nodiscard]] ImuFinding imu_finding() const override;
  [[nodiscard]] FrontEndProgress progress() const override;
  [[nodiscard]] bool has_map() const override { return counted_.views > 0; }
  [[nodiscard]] std::string why_no_map(const Recording& source) const override;
  [[nodiscard]] std::unique_ptr<MapMaker> map_maker(const ReadRecording& recording) override;

  [[nodiscard]] const SparseMappingConfig& config() const { return config_; }
  // Of these, how many held the same points as the one before.
  [[nodiscard]] std::uint64_t repeated() const { return repeated_; }
  [[nodiscard]] std::size_t positioned() const { return counted_.positioned; }
  // Of every scan, and the views that are kept. At the end, from `map_maker` to `hand_over`.
  [[nodiscard]] const std::vector<StampedPose>& path() const { return found_.path; }
  [[nodiscard]] const std::vector<StemView>& views() const { return found_.views; }
  [[nodiscard]] const StageTimes& times() const { return times_; }
  // At the end: what was found, which is here no more then. `steps` are those of the views.
  void hand_over(std::vector<StemView>& views, std::vector<SparseStep>& steps,
                 std::vector<StampedPose>& path, std::vector<GnssFix>& fixes);
  // For how long the IMU's samples could not be used.
  [[nodiscard]] const ImuUsage& imu_usage() const { return imu_usage_; }
  [[nodiscard]] ImuTrust imu_trust() const { return pacer_.imu_trust(); }
  // How late the IMU's clock seems to be; nothing where it is not used or not told.
  [[nodiscard]] std::optional<ClockCheckResult> clock_check() const;

  // Why this run does without the IMU: an earlier pass found it to be wrong; empty if it does not.
  [[nodiscard]] const std::string& imu_refused() const { return imu_refused_; }

 private:
  // What the journal holds, by number.
  struct Counted : ViewSink {
    void on_pose(const StampedPose& pose, bool positioned) override;
    void on_view(const StemView& view, const SparseStep& step) override;
    void on_fix(const GnssFix& fix) override;
    std::size_t scans = 0;
    std::size_t positioned = 0;
    std::size_t views = 0;
    std::size_t fixes = 0;
    TimeNs first_scan = 0;
  };
  // The same as it is.
  struct Found : ViewSink {
    void on_pose(const StampedPose& pose, bool positioned) override;
    void on_view(const StemView& view, const SparseStep& step) override;
    void on_fix(const GnssFix& fix) override;
    std::vector<StampedPose> path;
    std::vector<StemView> views;
    std::vector<SparseStep> steps;
    std::vector<GnssFix> fixes;
  };
  void recall();
  [[nodiscard]] std::vector<PositionedScan> on_scan(const ScanPtr& scan, const Rig& rig);
  void on_sample(const ImuSample& sample, const Rig& rig);
  std::vector<PositionedScan> record(const std::vector<StemScan>& results, const Rig& rig);
  void check_clock(const StemScan& result, TimeNs end, const Rig& rig);
  void refuse_imu(const std::string& reason);

  SparseMappingConfig config_;
  std::filesystem::path folder_;
  StemPacer pacer_;
  std::unique_ptr<ViewJournal> journal_;  // from the first event on
  std::deque<TimeNs> waiting_ends_;       // of scans that have no pose yet
  TimeNs last_scan_end_ = 0;
  std::string imu_refused_;
  ImuUsage imu_usage_;
  LidarImuClockCheck clock_{ImuNoiseConfig(), LidarImuClockCheck::Turns::kAboutUp};
  bool points_have_times_ = false;  // of the last scan
  std::size_t scans_ = 0;           // of which the last may still wait
  std::uint64_t repeated_ = 0;
  std::uint64_t last_content_ = 0;
  std::size_t last_stems_ = 0;
  Counted counted_;
  Found found_;  // empty until the recording is over
  StageTimes times_;
};

}  // namespace understory
