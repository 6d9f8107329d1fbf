// What of a session lies on the disk, and its state to go on from.
#include "understory/geometry/pose_io.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kFixesFile = "fixes.bin";

void put_last(BinaryWriter& writer, const ScanClouds::Last& last) {
  writer.put(last.keyframe);
  put_pose(writer, last.keyframe_from_body);
}

ScanClouds::Last get_last(BinaryReader& reader) {
  ScanClouds::Last last;
  last.keyframe = reader.get<std::uint64_t>();
  last.keyframe_from_body = get_pose(reader);
  return last;
}

}  // namespace

void DenseFrontEnd::sync() {
  store_fixes();
  if (fixes_file_) fixes_file_->sync();
  if (!started()) return;
  journal_->sync();
  if (imu_path_) imu_path_->sync();
  if (partial_path_) partial_path_->sync();
  clouds_->sync();
  if (far_clouds_) far_clouds_->sync();
  map_->sync();
}

std::vector<CountedFile> DenseFrontEnd::files() const {
  std::vector<CountedFile> files;
  if (started()) {
    files = map_->files();
    files.push_back({kJournalFile, journal_->count()});
    files.push_back({kCloudsFile, clouds_->clouds().count()});
    if (far_clouds_) files.push_back({kFarCloudsFile, far_clouds_->clouds().count()});
    if (imu_path_) files.push_back({kImuPathFile, imu_path_->count()});
    if (partial_path_) files.push_back({kPartialPathFile, partial_path_->count()});
  }
  if (fixes_file_) files.push_back({kFixesFile, fixes_file_->count()});
  return files;
}

void DenseFrontEnd::save(BinaryWriter& writer) const {
  UNDERSTORY_CHECK(settled() || !started());
  writer.put(imu_refused_);
  writer.put(imu_doubted_);
  writer.put(imu_cleared_s_.has_value());
  if (imu_cleared_s_) writer.put(*imu_cleared_s_);
  writer.put(fixes_file_ ? fixes_file_->count() : RecordCount());
  writer.put(received_.counts);
  received_.imu_usage.save(writer);
  received_.clock.save(writer);
  if (received_.calibration) received_.calibration->save(writer);
  writer.put(last_scan_end_);
  recovery_.save(writer);
  put_optional(writer, rig_.body_from_imu, put_pose);
  put_optional(writer, rig_.body_from_gnss, put_pose);
  put_optional(writer, rig_.body_from_second_gnss, put_pose);
  writer.put(started());
  writer.put(static_cast<std::uint64_t>(received_.imu.size()));
  for (const ImuSample& sample : received_.imu)
    put_imu(writer, sample);
  if (!started()) return;
  writer.put(journal_->count());
  if (imu_path_) writer.put(imu_path_->count());
  if (partial_path_) writer.put(partial_path_->count());
  for (const ScanClouds* clouds : {clouds_.get(), far_clouds_.get()}) {
    if (clouds == nullptr) continue;
    put_optional(writer, clouds->last(), put_last);
    writer.put(clouds->clouds().count());
  }
  map_->save(writer);
  odometry_->save(writer);
  if (satellites_) satellites_->save(writer);
}

void DenseFrontEnd::store_fixes() {
  if (received_.fixes.empty()) return;
  if (!fixes_file_) fixes_file_ = std::make_unique<RecordFile>(folder_ / kFixesFile);
  for (const GnssFix& fix : received_.fixes) {
    BinaryWriter record;
    put_fix(record, fix);
    fixes_file_->append({bytes_of(record.bytes())});
  }
  received_.fixes.clear();
}

std::size_t DenseFrontEnd::fix_count() const {
  const std::uint64_t away = fixes_file_ ? fixes_file_->count().records : 0;
  return static_cast<std::size_t>(away) + received_.fixes.size();
}

std::vector<GnssFix> DenseFrontEnd::fixes() const {
  std::vector<GnssFix> fixes;
  fixes.reserve(fix_count());
  if (fixes_file_) {
    fixes_file_->for_each([&](std::uint64_t /*offset*/, RecordFile::Bytes bytes) {
      BinaryReader record({bytes.begin(), bytes.end()}, fixes_file_->path().string());
      fixes.push_back(get_fix(record));
    });
  }
  fixes.insert(fixes.end(), received_.fixes.begin(), received_.fixes.end());
  return fixes;
}

void DenseFrontEnd::load(BinaryReader& reader, const Rig& rig) {
  const std::string refused = reader.get_string();
  if (!refused.empty()) refuse_imu(refused);
  imu_doubted_ = reader.get<bool>();
  if (reader.get<bool>()) imu_cleared_s_ = reader.get<double>();
  const auto fixes = reader.get<RecordCount>();
  if (fixes.records > 0) fixes_file_ = std::make_unique<RecordFile>(folder_ / kFixesFile, fixes);
  received_.counts = reader.get<DenseCounts>();
  received_.imu_usage.load(reader);
  received_.clock.load(reader);
  if (received_.calibration) received_.calibration->load(reader);
  last_scan_end_ = reader.get<TimeNs>();
  recovery_.load(reader);
  const auto body_from_imu = get_optional(reader, get_pose);
  const auto body_from_gnss = get_optional(reader, get_pose);
  const auto body_from_second_gnss = get_optional(reader, get_pose);
  const bool was_started = reader.get<bool>();
  const auto waiting = reader.get<std::uint64_t>();
  for (std::uint64_t i = 0; i < waiting; ++i)
    received_.imu.push_back(get_imu(reader));
  if (!was_started) return;
  journal_ = std::make_unique<Journal>(folder_ / kJournalFile, reader.get<RecordCount>());
  load_paths_between(reader);
  const auto load_clouds = [&](const ScanCloudsConfig& config, const char* file) {
    const auto last = get_optional(reader, get_last);
    const auto known = reader.get<RecordCount>();
    return std::make_unique<ScanClouds>(config, folder_ / file, known, last, times_);
  };
  clouds_ = load_clouds(clouds_config(), kCloudsFile);
  if (keeps_far_clouds()) far_clouds_ = load_clouds(far_clouds_config(), kFarCloudsFile);
  opening_.reset();
  rig_ = rig;
  rig_.body_from_imu = body_from_imu;
  rig_.body_from_gnss = body_from_gnss;
  rig_.body_from_second_gnss = body_from_second_gnss;
  map_->load(reader);
  make_odometry(Rig(rig_));
  odometry_->load(reader);
  make_satellites();
  if (satellites_) satellites_->load(reader);
}

}  // namespace understory
