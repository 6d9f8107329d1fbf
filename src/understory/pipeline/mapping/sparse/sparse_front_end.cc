#include "understory/pipeline/mapping/sparse/sparse_front_end.h"

#include <fmt/format.h>

#include <utility>

#include "understory/features/lidar_stems.h"
#include "understory/geometry/pose_io.h"
#include "understory/sensor/scan_content.h"
#include "understory/util/error.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

constexpr const char* kViewsFile = "views.bin";

}  // namespace

SparseFrontEnd::SparseFrontEnd(const SparseMappingConfig& config, const RunConditions& conditions,
                               const std::filesystem::path& folder, Log& log)
    : config_(config), folder_(folder), pacer_(config.pace, config.front_end, &log) {
  if (!conditions.imu_refused.empty()) refuse_imu(conditions.imu_refused);
}

std::vector<PositionedScan> SparseFrontEnd::handle(const Event& event, const Rig& rig) {
  if (journal_ == nullptr) journal_ = std::make_unique<ViewJournal>(folder_ / kViewsFile);
  if (const auto* scan = std::get_if<ScanPtr>(&event)) return on_scan(*scan, rig);
  if (const auto* fix = std::get_if<GnssFix>(&event)) {
    journal_->on_fix(*fix);
    counted_.on_fix(*fix);
  }
  if (const auto* sample = std::get_if<ImuSample>(&event)) on_sample(*sample, rig);
  return {};
}

// The recording has said so where it does not know the IMU's place; it may learn it later.
void SparseFrontEnd::on_sample(const ImuSample& sample, const Rig& rig) {
  imu_usage_.add(sample, rig.body_from_imu.has_value(), ImuNoiseConfig());
  if (!rig.body_from_imu) return;
  pacer_.add(sample);
  clock_.add_sample(sample);
}

std::vector<PositionedScan> SparseFrontEnd::on_scan(const ScanPtr& scan, const Rig& rig) {
  const ScopedTimer timer(times_, "scan");
  if (scans_ == 0 && !rig.further_lidars.empty() && !all_have_level_rings(*scan, rig)) {
    throw InputError(rig.lidar_model.empty() ? "the lidar" : rig.lidar_model, "",
                     "its lines sweep over the whole field of view, so single scans show no cut of "
                     "a stem. Scans of several lidars are not gathered over time. Name one lidar "
                     "with --lidar-topic, or use --front-end dense");
  }
  ++scans_;
  const std::uint64_t content = content_of(*scan);
  repeated_ += is_repetition(content, last_content_) ? 1 : 0;
  last_content_ = content;
  last_scan_end_ = scan->end();
  waiting_ends_.push_back(last_scan_end_);
  points_have_times_ = scan->has_point_times;
  return record(pacer_.add(scan, rig), rig);
}

std::vector<PositionedScan> SparseFrontEnd::record(const std::vector<StemScan>& results,
                                                   const Rig& rig) {
  std::vector<PositionedScan> positioned;
  for (const StemScan& result : results) {
    const StampedPose pose{result.view.stamp, result.step.world_from_body};
    positioned.push_back({waiting_ends_.front(), pose, std::nullopt, false, std::nullopt});
    check_clock(result, waiting_ends_.front(), rig);
    waiting_ends_.pop_front();
    journal_->on_pose(pose, result.positioned);
    counted_.on_pose(pose, result.positioned);
    if (!result.positioned) continue;
    last_stems_ = result.view.stems.size();
    if (!result.keep) continue;
    journal_->on_view(result.view, result.step);
    counted_.on_view(result.view, result.step);
  }
  return positioned;
}

// Nothing of the run depends on it. Without times of points nobody knows which moment a scan shows.
void SparseFrontEnd::check_clock(const StemScan& result, TimeNs end, const Rig& rig) {
  if (!rig.body_from_imu || !points_have_times_ || !result.positioned) return;
  const SparseStepStatus status = result.step.status;
  if (status == SparseStepStatus::kWeak || status == SparseStepStatus::kUnmatched) {
    clock_.break_off();
    return;
  }
  clock_.add_scan(result.view.stamp, end, result.step.world_from_body.rotation(),
                  rig.body_from_imu->rotation());
}

std::optional<ClockCheckResult> SparseFrontEnd::clock_check() const {
  if (!imu_refused_.empty() || !config_.front_end.imu.use || !pacer_.imu_trust().usable)
    return std::nullopt;
  return clock_.result();
}

void SparseFrontEnd::Counted::on_pose(const StampedPose& pose, bool was_positioned) {
  if (scans == 0) first_scan = pose.stamp;
  ++scans;
  positioned += was_positioned ? 1 : 0;
}

void SparseFrontEnd::Counted::on_view(const StemView& /*view*/, const SparseStep& /*step*/) {
  ++views;
}

void SparseFrontEnd::Counted::on_fix(const GnssFix& /*fix*/) {
  ++fixes;
}

void SparseFrontEnd::Found::on_pose(const StampedPose& pose, bool /*positioned*/) {
  path.push_back(pose);
}

void SparseFrontEnd::Found::on_view(const StemView& view, const SparseStep& step) {
  views.push_back(view);
  steps.push_back(step);
}

void SparseFrontEnd::Found::on_fix(const GnssFix& fix) {
  fixes.push_back(fix);
}

// Reads back what was put on disk.
void SparseFrontEnd::recall() {
  found_ = {};
  found_.path.reserve(counted_.scans);
  found_.views.reserve(counted_.views);
  found_.steps.reserve(counted_.views);
  found_.fixes.reserve(counted_.fixes);
  if (journal_ != nullptr) journal_->replay(found_);
}

std::vector<PositionedScan> SparseFrontEnd::finish(const Rig& rig) {
  return record(pacer_.finish(rig), rig);
}

ImuFinding SparseFrontEnd::imu_finding() const {
  const ImuTrust trust = pacer_.imu_trust();
  if (trust.trusted || !imu_refused_.empty()) return {};
  return {ImuFinding::Verdict::kWrong, trust.reason};
}

FrontEndProgress SparseFrontEnd::progress() const {
  return {"stems", scans_, fmt::format("{} stems", last_stems_)};
}

void SparseFrontEnd::hand_over(std::vector<StemView>& views, std::vector<SparseStep>& steps,
                               std::vector<StampedPose>& path, std::vector<GnssFix>& fixes) {
  views = std::move(found_.views);
  steps = std::move(found_.steps);
  path = std::move(found_.path);
  fixes = std::move(found_.fixes);
}

void SparseFrontEnd::refuse_imu(const std::string& reason) {
  imu_refused_ = reason;
  pacer_.refuse_imu();
}

void SparseFrontEnd::sync() {
  if (journal_ != nullptr) journal_->sync();
}

std::vector<CountedFile> SparseFrontEnd::files() const {
  if (journal_ == nullptr) return {};
  return {{kViewsFile, journal_->count()}};
}

void SparseFrontEnd::save(BinaryWriter& writer) const {
  writer.put(journal_ != nullptr ? journal_->count() : RecordCount());
  writer.put(last_scan_end_);
  writer.put(imu_refused_);
  imu_usage_.save(writer);
  clock_.save(writer);
  writer.put(repeated_);
  writer.put(last_content_);
  pacer_.save(writer);
}

void SparseFrontEnd::load(BinaryReader& reader, const Rig& /*rig*/) {
  const auto known = reader.get<RecordCount>();
  if (known.records > 0)
    journal_ = std::make_unique<ViewJournal>(folder_ / kViewsFile, known, counted_);
  scans_ = counted_.scans;
  last_scan_end_ = reader.get<TimeNs>();
  const std::string refused = reader.get_string();
  if (!refused.empty()) refuse_imu(refused);
  imu_usage_.load(reader);
  clock_.load(reader);
  repeated_ = reader.get<std::uint64_t>();
  last_content_ = reader.get<std::uint64_t>();
  pacer_.load(reader);
}

}  // namespace understory
