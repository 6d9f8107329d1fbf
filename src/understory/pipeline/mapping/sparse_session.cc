#include "understory/pipeline/mapping/sparse_session.h"

#include <algorithm>

#include "understory/geometry/pose_io.h"
#include "understory/pipeline/mapping/scan_content.h"
#include "understory/util/timing.h"

namespace understory {
namespace {

constexpr const char* kViewsFile = "views.bin";

}  // namespace

SparseSession::SparseSession(const SparseMappingConfig& config,
                             const std::filesystem::path& stems_file,
                             const std::filesystem::path& folder, Log& log)
    : folder_(folder), pacer_(config.pace, config.front_end, &log), stems_(stems_file) {}

void SparseSession::handle(const Event& event, const Rig& rig) {
  if (journal_ == nullptr) journal_ = std::make_unique<ViewJournal>(folder_ / kViewsFile);
  if (const auto* scan = std::get_if<ScanPtr>(&event)) on_scan(*scan, rig);
  if (const auto* fix = std::get_if<GnssFix>(&event)) {
    journal_->on_fix(*fix);
    on_fix(*fix);
  }
  if (const auto* sample = std::get_if<ImuSample>(&event)) on_sample(*sample, rig);
}

// The recording has said so where it does not know the IMU's place; it may learn it later.
void SparseSession::on_sample(const ImuSample& sample, const Rig& rig) {
  imu_hearing_.add(sample, rig.body_from_imu.has_value(), ImuNoiseConfig());
  if (rig.body_from_imu) pacer_.add(sample);
}

void SparseSession::on_scan(const ScanPtr& scan, const Rig& rig) {
  const ScopedTimer timer(times_, "scan");
  ++scans_;
  const std::uint64_t content = content_of(*scan);
  repeated_ += content == last_content_ ? 1 : 0;
  last_content_ = content;
  last_scan_end_ = scan->end();
  waiting_ends_.push_back(last_scan_end_);
  record(pacer_.add(scan, rig));
}

void SparseSession::record(const std::vector<StemScan>& results) {
  for (const StemScan& result : results) {
    if (tell_settled_) tell_settled_(waiting_ends_.front());
    waiting_ends_.pop_front();
    const StampedPose pose{result.view.stamp, result.step.world_from_body};
    journal_->on_pose(pose, result.positioned);
    on_pose(pose, result.positioned);
    if (!result.positioned) continue;
    last_stems_ = result.view.stems.size();
    if (!result.keep) continue;
    journal_->on_view(result.view, result.step);
    on_view(result.view, result.step);
  }
}

void SparseSession::on_pose(const StampedPose& pose, bool positioned) {
  path_.push_back(pose);
  positioned_ += positioned ? 1 : 0;
}

void SparseSession::on_view(const StemView& view, const SparseStep& step) {
  for (const Stem& stem : view.stems)
    stems_.add(view.frame, view.stamp, stem);
  steps_.push_back(step);
}

void SparseSession::on_fix(const GnssFix& fix) {
  fixes_.push_back(fix);
}

void SparseSession::finish(const Rig& rig) {
  record(pacer_.finish(rig));
  if (!steps_.empty()) stems_.commit();
}

void SparseSession::refuse_imu(const std::string& reason) {
  imu_refused_ = reason;
  pacer_.refuse_imu();
}

void SparseSession::sync() {
  if (journal_ != nullptr) journal_->sync();
}

std::vector<CountedFile> SparseSession::files() const {
  if (journal_ == nullptr) return {};
  return {{kViewsFile, journal_->count()}};
}

void SparseSession::save(BinaryWriter& writer) const {
  writer.put(journal_ != nullptr ? journal_->count() : RecordCount());
  writer.put(last_scan_end_);
  writer.put(imu_refused_);
  imu_hearing_.save(writer);
  writer.put(repeated_);
  writer.put(last_content_);
  pacer_.save(writer);
}

void SparseSession::load(BinaryReader& reader, const Rig& /*rig*/) {
  const auto known = reader.get<RecordCount>();
  ViewSink& again = *this;
  if (known.records > 0)
    journal_ = std::make_unique<ViewJournal>(folder_ / kViewsFile, known, again);
  scans_ = path_.size();
  last_scan_end_ = reader.get<TimeNs>();
  const std::string refused = reader.get_string();
  if (!refused.empty()) refuse_imu(refused);
  imu_hearing_.load(reader);
  repeated_ = reader.get<std::uint64_t>();
  last_content_ = reader.get<std::uint64_t>();
  pacer_.load(reader);
}

}  // namespace understory
