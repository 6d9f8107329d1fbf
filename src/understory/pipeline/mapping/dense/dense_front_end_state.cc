// What of a session lies on the disk, and its state to go on from.
#include "understory/geometry/pose_io.h"
#include "understory/pipeline/mapping/dense/dense_front_end.h"
#include "understory/sensor/sensor_io.h"
#include "understory/util/error.h"

namespace understory {
void DenseFrontEnd::sync() {
  store_fixes();
  fix_file_.sync();
  if (!started()) return;
  journal_->sync();
  between_.sync();
  clouds_.sync();
  map_->sync();
}

std::vector<CountedFile> DenseFrontEnd::files() const {
  std::vector<CountedFile> files;
  if (started()) {
    files = map_->files();
    files.push_back({kJournalFile, journal_->count()});
    clouds_.list(files);
    between_.list(files);
  }
  if (fix_file_.exists()) files.push_back({fix_file_.name(), fix_file_.count()});
  return files;
}

void DenseFrontEnd::save(BinaryWriter& writer) const {
  UNDERSTORY_CHECK(settled() || !started());
  writer.put(conditions_.imu_refused);
  writer.put(conditions_.imu_doubted);
  writer.put(conditions_.imu_cleared);
  if (conditions_.imu_cleared) writer.put(conditions_.imu_judged_s);
  writer.put(fix_file_.count());
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
  between_.save(writer);
  clouds_.save(writer);
  map_->save(writer);
  odometry_->save(writer);
  if (satellites_) satellites_->save(writer);
}

void DenseFrontEnd::store_fixes() {
  fix_file_.append(received_.fixes);
  received_.fixes.clear();
}

std::size_t DenseFrontEnd::fix_count() const {
  return fix_file_.size() + received_.fixes.size();
}

std::vector<GnssFix> DenseFrontEnd::fixes() const {
  std::vector<GnssFix> fixes = fix_file_.read();
  fixes.insert(fixes.end(), received_.fixes.begin(), received_.fixes.end());
  return fixes;
}

void DenseFrontEnd::load(BinaryReader& reader, const Rig& rig) {
  const std::string refused = reader.get_string();
  if (!refused.empty()) refuse_imu(refused);
  conditions_.imu_doubted = reader.get<bool>();
  conditions_.imu_cleared = reader.get<bool>();
  if (conditions_.imu_cleared) conditions_.imu_judged_s = reader.get<double>();
  fix_file_.go_on(reader.get<RecordCount>());
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
  between_.load(reader);
  clouds_.load(reader);
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
