#include "understory/recording/clouds/cloud_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/clouds/e57.h"
#include "understory/recording/clouds/las.h"
#include "understory/recording/messages/point_cloud.h"
#include "understory/util/error.h"

namespace understory {
namespace {

// Beyond this a float keeps less than a tenth of a millimetre.
constexpr double kFarFromOrigin = 1000.0;
// In millimetres the Earth's coordinates, of UTM, too, reach to 1e10.
constexpr double kFarthestPlace = 1e10;

// Appends points and settles the origin with the first one.
class Collector {
 public:
  Collector(PointCloudFile& cloud, const PlaceChange& change) : cloud_(cloud), change_(change) {}

  // False if the point is no place.
  bool add(const Eigen::Vector3d& position) {
    if (!is_place(position)) {
      ++cloud_.not_finite;
      return false;
    }
    const Eigen::Vector3d place = change_ ? change_(position) : position;
    if (cloud_.points.empty()) cloud_.origin = cloud_origin(place);
    cloud_.points.push_back((place - cloud_.origin).cast<float>());
    return true;
  }

 private:
  PointCloudFile& cloud_;
  const PlaceChange& change_;
};

PointCloudFile read_las_cloud(ByteSource& file, Log& log, const ProgressSink& progress,
                              const PlaceChange& change) {
  const LasHeader header = read_las_header(file);
  PointCloudFile cloud = described_by(header);
  Collector collector(cloud, change);
  const auto left_out = read_las_points(file, header, log, [&](const LasPoint& point) {
    progress.poll();
    if (!collector.add(point.position)) return;
    cloud.intensity.push_back(point.intensity);
    cloud.classification.push_back(point.classification);
    if (header.has_gps_time) cloud.gps_time.push_back(point.gps_time);
  });
  if (cloud.points.empty() && cloud.not_finite == 0) refuse_all_noise(file, left_out);
  return cloud;
}

PointCloudFile read_e57_cloud(ByteSource& file, Log& log, const ProgressSink& progress,
                              const PlaceChange& change) {
  const E57Header header = read_e57_header(file);
  PointCloudFile cloud = described_by(header);
  const bool intensity = header.has_intensity();
  Collector collector(cloud, change);
  read_e57_points(file, header, log, [&](const E57Point& point) {
    progress.poll();
    if (collector.add(point.position) && intensity) cloud.intensity.push_back(point.intensity);
  });
  if (!cloud.points.empty())
    cloud.step = header.scans.front().step_at(cloud.origin + cloud.points.front().cast<double>());
  return cloud;
}

std::uint16_t ring_number(double value) {
  constexpr double kMost = std::numeric_limits<std::uint16_t>::max();
  return value >= 0.0 && value <= kMost ? static_cast<std::uint16_t>(value) : std::uint16_t{0};
}

PointCloudFile from_table(const CloudTable& table, const std::string& name,
                          const PlaceChange& change) {
  const PointCloud2Message message = table.message(0);
  const auto layout = CloudLayout::find(message);
  if (!layout) throw InputError(name, "header", "expected the fields x, y and z");
  PointCloudFile cloud;
  cloud.format = table.format;
  Collector collector(cloud, change);
  for (std::size_t i = 0; i < table.size(); ++i) {
    const std::uint8_t* raw = table.data.data() + i * table.point_step;
    const Eigen::Vector3d position(layout->x().read(raw), layout->y().read(raw),
                                   layout->z().read(raw));
    if (!collector.add(position)) continue;
    if (layout->intensity().size > 0)
      cloud.intensity.push_back(static_cast<float>(layout->intensity().read(raw)));
    if (layout->has_ring()) cloud.ring.push_back(ring_number(layout->ring().read(raw)));
  }
  if (layout->x().type == FieldType::kFloat32) {
    const auto far = static_cast<float>(cloud.origin.cwiseAbs().maxCoeff());
    cloud.step = static_cast<double>(std::nextafter(far, std::numeric_limits<float>::max()) - far);
  }
  return cloud;
}

}  // namespace

bool is_place(const Eigen::Vector3d& position) {
  return position.allFinite() && position.cwiseAbs().maxCoeff() <= kFarthestPlace;
}

Eigen::Vector3d cloud_origin(const Eigen::Vector3d& first) {
  if (first.cwiseAbs().maxCoeff() <= kFarFromOrigin) return Eigen::Vector3d::Zero();
  return first.array().round();
}

PointCloudFile described_by(const LasHeader& header) {
  PointCloudFile cloud;
  cloud.coordinate_system = header.coordinate_system;
  cloud.gps_week_time = header.gps_week_time;
  cloud.las_step = header.scale.maxCoeff();
  cloud.format = std::string(header.compressed ? "LAZ" : "LAS") + " 1." +
                 std::to_string(header.version_minor) + ", point format " +
                 std::to_string(header.point_format);
  return cloud;
}

PointCloudFile described_by(const E57Header& header) {
  PointCloudFile cloud;
  cloud.coordinate_system = header.coordinate_system;
  cloud.format = "E57, " + std::to_string(header.scans.size()) +
                 (header.scans.size() == 1 ? " scan" : " scans");
  return cloud;
}

PointCloudFile read_cloud(ByteSource& file, Log& log, const ProgressSink& progress,
                          const PlaceChange& change) {
  PointCloudFile cloud;
  switch (cloud_format(file)) {
    case CloudFormat::kLas:
      cloud = read_las_cloud(file, log, progress, change);
      break;
    case CloudFormat::kE57:
      cloud = read_e57_cloud(file, log, progress, change);
      break;
    case CloudFormat::kPcd:
      cloud = from_table(read_pcd(file, log), file.name(), change);
      break;
    case CloudFormat::kPly:
      cloud = from_table(read_ply(file, log), file.name(), change);
      break;
    case CloudFormat::kKitti:
      cloud = from_table(read_kitti(file, log), file.name(), change);
      break;
    case CloudFormat::kUnknown:
      throw InputError(file.name(), "byte 0",
                       "expected a cloud (.las, .laz, .e57, .pcd, .ply, .bin)");
  }
  if (cloud.points.empty())
    throw InputError(file.name(), "", "holds no point with usable coordinates");
  return cloud;
}

bool has_map_name(const std::filesystem::path& path) {
  constexpr std::array<const char*, 5> kEndings = {".las", ".laz", ".e57", ".ply", ".pcd"};
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

PointCloudFile read_cloud(const std::string& path, Log& log, const ProgressSink& progress,
                          const PlaceChange& change) {
  const auto file = open_file(path);
  if (file->size() == 0) throw InputError(path, "", "the file is empty");
  return read_cloud(*file, log, progress, change);
}

}  // namespace understory
