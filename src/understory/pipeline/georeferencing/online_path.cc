#include "understory/pipeline/georeferencing/online_path.h"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <functional>
#include <optional>

#include "understory/georeference/satellites/split_fit.h"
#include "understory/georeference/systems/coordinate_system.h"
#include "understory/georeference/systems/default_system.h"
#include "understory/output/global_table.h"
#include "understory/sensor/second_antenna_place.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr const char* kFile = "global.bin";
constexpr const char* kTable = "global.csv.gz";

// A GlobalPose as bytes.
struct Record {
  TimeNs stamp = 0;
  std::array<double, 3> place{};  // latitude, longitude, height
  std::array<double, 4> rotation{};
  std::array<double, 3> place_sd_m{};
  std::array<double, 3> turn_sd_deg{};
  std::uint64_t known = 0;  // bits: place, height, heading
};

Record record_of(const GlobalPose& pose) {
  Record record;
  record.stamp = pose.stamp;
  record.place = {pose.place.latitude_deg, pose.place.longitude_deg, pose.place.height_m};
  Eigen::Vector4d::Map(record.rotation.data()) = pose.enu_from_body.coeffs();
  Eigen::Vector3d::Map(record.place_sd_m.data()) = pose.place_sd_m;
  Eigen::Vector3d::Map(record.turn_sd_deg.data()) = pose.turn_sd_deg;
  record.known =
      (pose.known ? 1U : 0U) + (pose.height_known ? 2U : 0U) + (pose.heading_known ? 4U : 0U);
  return record;
}

GlobalPose pose_of(const Record& record) {
  GlobalPose pose;
  pose.stamp = record.stamp;
  pose.place = {record.place[0], record.place[1], record.place[2]};
  pose.enu_from_body.coeffs() = Eigen::Vector4d::Map(record.rotation.data());
  pose.place_sd_m = Eigen::Vector3d::Map(record.place_sd_m.data());
  pose.turn_sd_deg = Eigen::Vector3d::Map(record.turn_sd_deg.data());
  pose.known = (record.known & 1U) != 0;
  pose.height_known = (record.known & 2U) != 0;
  pose.heading_known = (record.known & 4U) != 0;
  return pose;
}

void for_each_pose(const RecordFile& file, const std::function<void(const GlobalPose&)>& visit) {
  file.for_each([&](std::uint64_t offset, RecordFile::Bytes bytes) {
    Record record;
    if (bytes.size() != sizeof(record)) {
      throw InputError(file.path().string(), "at byte " + std::to_string(offset),
                       "expected the record of a scan");
    }
    std::memcpy(static_cast<void*>(&record), bytes.data(), sizeof(record));
    visit(pose_of(record));
  });
}

// The system of the columns easting and northing.
CoordinateSystem system_at(const GeodeticPlace& place, const GeoreferenceConfig& config) {
  const std::string& wish = config.coordinate_system;
  CoordinateSystem system(wish.empty() ? default_system(place, HeightWish::kEllipsoid) : wish);
  system.drop_vertical();
  return system;
}

// What the rows together say.
struct Shares {
  std::uint64_t scans = 0;
  std::uint64_t known = 0;
  std::uint64_t heading_known = 0;
  GlobalPose last;

  [[nodiscard]] std::map<std::string, Figure> figures(const std::string& system) const {
    const auto percent = [&](std::uint64_t part) {
      return 100.0 * static_cast<double>(part) / static_cast<double>(scans);
    };
    std::map<std::string, Figure> figures = {
        {"global_known_percent", percent(known)},
        {"global_heading_known_percent", percent(heading_known)}};
    if (!system.empty()) figures["global_coordinate_system"] = system;
    if (last.known) figures["global_plane_sd_end_m"] = last.place_sd_m.head<2>().norm();
    if (last.height_known) figures["global_height_sd_end_m"] = last.place_sd_m.z();
    if (last.heading_known) figures["global_heading_sd_end_deg"] = last.turn_sd_deg.z();
    return figures;
  }
};

}  // namespace

void OnlinePath::begin() {
  OnlineGeoreferenceConfig config;
  config.tilt_sd_deg = tilt_sd_deg(levelled_by_, 1.0);  // the path has no turn yet
  georeference_ = std::make_unique<OnlineGeoreference>(config);
}

void OnlinePath::take(const GnssFix& fix, const Rig& rig) {
  if (last_scan_end_ == 0) return;  // it lies before the path
  if (!georeference_) {
    begin();
    file_ = std::make_unique<RecordFile>(work_ / kFile);
  }
  georeference_->add_fix(
      fix, rig.body_from_gnss ? rig.body_from_gnss->translation() : Eigen::Vector3d::Zero(),
      second_antenna_of(rig));
}

void OnlinePath::take(const PositionedScan& scan) {
  last_scan_end_ = scan.end;
  if (!georeference_) return;
  if (scan.new_world_from_old_world) georeference_->move_world(*scan.new_world_from_old_world);
  if (scan.begins_piece) georeference_->begin_piece();
  last_ = georeference_->add_pose(scan.pose);
  const Record record = record_of(last_);
  file_->append({bytes_of(record)});
}

std::string OnlinePath::remark() const {
  if (!last_.known) return "";
  return fmt::format("on the globe within {:.1f} m", last_.place_sd_m.head<2>().norm());
}

std::map<std::string, Figure> OnlinePath::write(const std::filesystem::path& results,
                                                const GeoreferenceConfig& config) const {
  if (!file_) return {};
  std::optional<CoordinateSystem> system;
  GlobalWriter writer(results / kTable);
  Shares shares;
  for_each_pose(*file_, [&](const GlobalPose& pose) {
    if (pose.known && !system) system = system_at(pose.place, config);
    GlobalRow row;
    row.pose = pose;
    if (pose.known && !system->is_geographic()) {
      const GeodeticPlace& place = pose.place;
      if (const auto in_plane = system->from_place({place.latitude_deg, place.longitude_deg, 0.0}))
        row.grid = in_plane->head<2>();
    }
    writer.add(row);
    ++shares.scans;
    shares.known += pose.known ? 1 : 0;
    shares.heading_known += pose.heading_known ? 1 : 0;
    shares.last = pose;
  });
  writer.commit();
  if (shares.scans == 0) return {};
  std::map<std::string, Figure> figures = shares.figures(system ? system->code() : "");
  if (georeference_->has_headings())
    figures["global_second_antenna_used"] = georeference_->contradicts_headings() ? 0.0 : 1.0;
  return figures;
}

void OnlinePath::sync() {
  if (file_) file_->sync();
}

void OnlinePath::save(BinaryWriter& writer) const {
  writer.put(levelled_by_);
  writer.put(last_scan_end_);
  writer.put(georeference_ != nullptr);
  if (!georeference_) return;
  writer.put(file_->count());
  georeference_->save(writer);
}

std::vector<CountedFile> OnlinePath::files() const {
  if (!file_) return {};
  return {{kFile, file_->count()}};
}

void OnlinePath::load(BinaryReader& reader, const Rig& /*rig*/) {
  levelled_by_ = reader.get_enum(LevelledBy::kGravity);
  last_scan_end_ = reader.get<TimeNs>();
  if (!reader.get<bool>()) return;
  begin();
  file_ = std::make_unique<RecordFile>(work_ / kFile, reader.get<RecordCount>());
  georeference_->load(reader);
}

}  // namespace understory
