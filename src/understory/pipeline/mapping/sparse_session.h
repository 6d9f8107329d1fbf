#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "understory/odometry/stems/stem_pacer.h"
#include "understory/output/run_tables.h"
#include "understory/pipeline/judgement/imu_hearing.h"
#include "understory/pipeline/mapping/sparse_mapping_config.h"
#include "understory/pipeline/run_folder/resumable.h"
#include "understory/pipeline/run_folder/view_journal.h"
#include "understory/recording/recording.h"

namespace understory {

// The moving part of a run by stems: takes events in order of time, positions scans, writes the
// views that are kept. Its whole state can be saved between gaps of positioning (`settled`).
// Not thread-safe.
class SparseSession : public Resumable, private ViewSink {
 public:
  // `stems_file` appears with `finish`; `folder` is the work folder.
  SparseSession(const SparseMappingConfig& config, const std::filesystem::path& stems_file,
                const std::filesystem::path& folder, Log& log);

  void handle(const Event& event, const Rig& rig);
  // At the recording's end, or where it is stopped: what still waits, and the file of stems if any
  // view was kept.
  void finish(const Rig& rig);

  void sync() override;
  void save(BinaryWriter& writer) const override;
  [[nodiscard]] std::vector<CountedFile> files() const override;
  void load(BinaryReader& reader, const Rig& rig) override;
  [[nodiscard]] TimeNs last_scan_end() const override { return last_scan_end_; }
  // Whether no scan waits for its pose; only then the state can be saved.
  [[nodiscard]] bool settled() const { return waiting_ends_.empty(); }

  // Called with the end of each scan that has got its pose.
  void on_settled(std::function<void(TimeNs)> tell) { tell_settled_ = std::move(tell); }
  [[nodiscard]] std::size_t scans() const { return scans_; }  // of which the last may still wait
  // Of these, how many held the same points as the one before.
  [[nodiscard]] std::uint64_t repeated() const { return repeated_; }
  [[nodiscard]] std::size_t positioned() const { return positioned_; }
  [[nodiscard]] std::size_t last_stems() const { return last_stems_; }
  [[nodiscard]] std::vector<StampedPose>& path() { return path_; }   // of every scan
  [[nodiscard]] std::vector<SparseStep>& steps() { return steps_; }  // of the views kept
  [[nodiscard]] std::vector<GnssFix>& fixes() { return fixes_; }
  [[nodiscard]] StageTimes& times() { return times_; }
  // For how long the IMU's samples could not be used.
  [[nodiscard]] const ImuHearing& imu_hearing() const { return imu_hearing_; }
  [[nodiscard]] ImuTrust imu_trust() const { return pacer_.imu_trust(); }

  // Before the first event: does without the IMU, because an earlier pass found it to be wrong.
  void refuse_imu(const std::string& reason);
  // Why; empty if it was not refused.
  [[nodiscard]] const std::string& imu_refused() const { return imu_refused_; }

 private:
  void on_scan(const ScanPtr& scan, const Rig& rig);
  void on_sample(const ImuSample& sample, const Rig& rig);
  void record(const std::vector<StemScan>& results);
  void on_pose(const StampedPose& pose, bool positioned) override;
  void on_view(const StemView& view, const SparseStep& step) override;
  void on_fix(const GnssFix& fix) override;

  std::filesystem::path folder_;
  StemPacer pacer_;
  StemsWriter stems_;
  std::unique_ptr<ViewJournal> journal_;  // from the first event on
  std::function<void(TimeNs)> tell_settled_;
  std::deque<TimeNs> waiting_ends_;  // of scans that have no pose yet
  TimeNs last_scan_end_ = 0;
  std::string imu_refused_;
  ImuHearing imu_hearing_;
  std::size_t scans_ = 0;
  std::uint64_t repeated_ = 0;
  std::uint64_t last_content_ = 0;
  std::size_t positioned_ = 0;
  std::size_t last_stems_ = 0;
  std::vector<StampedPose> path_;
  std::vector<SparseStep> steps_;
  std::vector<GnssFix> fixes_;
  StageTimes times_;
};

}  // namespace understory
