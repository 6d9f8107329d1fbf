#include "understory/pipeline/inventory/streamed_cloud.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <system_error>
#include <utility>

#include "understory/pipeline/pipeline_constants.h"
#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/clouds/e57.h"
#include "understory/recording/clouds/las.h"
#include "understory/util/error.h"

namespace understory {
namespace {

using namespace pipeline_constants::cloud_tiles;

// What is known before the points are read.
struct Stated {
  std::uint64_t points = 0;
  double extent_m = 0.0;
};

// A damaged header may state any number of points: each takes a byte at least.
std::uint64_t believable(std::uint64_t points, const ByteSource& file) {
  return std::min(points, file.size());
}

Stated stated_by(const LasHeader& header, const ByteSource& file) {
  return {believable(header.points, file), (header.high - header.low).head<2>().maxCoeff()};
}

Stated stated_by(const E57Header& header, const ByteSource& file) {
  std::uint64_t points = 0;
  for (const E57Scan& scan : header.scans)
    points += scan.points;
  return {believable(points, file), 0.0};
}

bool in_memory(const Stated& stated, const CloudTilesConfig& config) {
  return config.size_m == 0.0 &&
         static_cast<double>(stated.points) * kBytesPerPointWhole <= 1e6 * config.max_memory_mb;
}

void check_space(const CloudTiling& tiling, const Stated& stated) {
  std::error_code unknown;
  const std::filesystem::space_info space = std::filesystem::space(tiling.folder, unknown);
  const double bytes = kDiskBytesPerPoint + (tiling.copc ? kCopcDiskBytesPerPoint : 0.0);
  const double needed = bytes * static_cast<double>(stated.points);
  if (unknown || static_cast<double>(space.available) >= needed) return;
  throw OutputError(tiling.folder.string(),
                    fmt::format("about {:.1f} GB are needed for the tiles of a cloud of {} million "
                                "points and its results, {:.1f} GB are free",
                                needed / 1e9, stated.points / 1'000'000,
                                static_cast<double>(space.available) / 1e9));
}

// What is done to each point of a file.
struct PlaceChanges {
  const PlaceChange& first;  // may be empty
  const std::vector<CloudMove>& moves;
};

// Takes the points of a file one after another.
class Sorter {
 public:
  Sorter(StreamedCloud& cloud, const PlaceChanges& changes)
      : cloud_(cloud), change_(changes.first), moves_(changes.moves) {}

  void add(const Eigen::Vector3d& position, float intensity, double gps_time) {
    if (!is_place(position)) {
      ++cloud_.about.not_finite;
      return;
    }
    const Eigen::Vector3d place = change_ ? change_(position) : position;
    if (count_ == 0) begin(place);
    TilePoint point;
    point.place = (place - origins_.front()).cast<float>();
    for (std::size_t i = 0; i < moves_.size(); ++i)
      point.place = moves_[i].point(origins_[i], point.place);
    point.intensity = intensity;
    point.gps_time = gps_time;
    cloud_.tiles->add(point);
    const Eigen::Vector3d at = cloud_.tiles->world(point);
    if (count_ == 0) first_ = at;
    if (count_++ % cloud_.sample_step == 0) cloud_.sample.emplace_back(at - first_);
  }

 private:
  void begin(const Eigen::Vector3d& first) {
    origins_.push_back(cloud_origin(first));
    for (const CloudMove& move : moves_)
      origins_.push_back(move.origin(origins_.back()));
    cloud_.about.origin = origins_.back();
    cloud_.tiles->set_origin(origins_.back());
  }

  StreamedCloud& cloud_;
  const PlaceChange& change_;
  const std::vector<CloudMove>& moves_;
  std::vector<Eigen::Vector3d> origins_;  // before each move, and at the end
  Eigen::Vector3d first_ = Eigen::Vector3d::Zero();
  std::uint64_t count_ = 0;
};

StreamedCloud begin_cloud(PointCloudFile about, const Stated& stated, const CloudTiling& tiling) {
  check_space(tiling, stated);
  StreamedCloud cloud;
  cloud.about = std::move(about);
  cloud.sample_step = static_cast<std::size_t>(stated.points / kSample + 1);
  cloud.tiles = std::make_shared<CloudTiles>(tiling.folder, tiling.config, stated.extent_m);
  return cloud;
}

StreamedCloud end_cloud(StreamedCloud cloud, const std::string& path, int threads) {
  if (cloud.tiles->points() == 0)
    throw InputError(path, "", "holds no point with usable coordinates");
  cloud.tiles->finish(threads);
  return cloud;
}

std::optional<StreamedCloud> stream_las(ByteSource& file, const CloudTiling& tiling,
                                        const PlaceChanges& changes, Log& log,
                                        const ProgressSink& progress) {
  const LasHeader header = read_las_header(file);
  const Stated stated = stated_by(header, file);
  if (in_memory(stated, tiling.config)) return std::nullopt;
  StreamedCloud cloud = begin_cloud(described_by(header), stated, tiling);
  cloud.has_times = header.has_gps_time;
  cloud.has_intensity = true;
  Sorter sorter(cloud, changes);
  const auto left_out = read_las_points(file, header, log, [&](const LasPoint& point) {
    progress.poll();
    sorter.add(point.position, point.intensity, point.gps_time);
  });
  if (cloud.tiles->points() == 0 && cloud.about.not_finite == 0) refuse_all_noise(file, left_out);
  return end_cloud(std::move(cloud), file.name(), tiling.threads);
}

std::optional<StreamedCloud> stream_e57(ByteSource& file, const CloudTiling& tiling,
                                        const PlaceChanges& changes, Log& log,
                                        const ProgressSink& progress) {
  const E57Header header = read_e57_header(file);
  const Stated stated = stated_by(header, file);
  if (in_memory(stated, tiling.config)) return std::nullopt;
  StreamedCloud cloud = begin_cloud(described_by(header), stated, tiling);
  cloud.has_intensity = header.has_intensity();
  Sorter sorter(cloud, changes);
  bool first = true;
  read_e57_points(file, header, log, [&](const E57Point& point) {
    progress.poll();
    if (first && point.position.allFinite()) {
      cloud.about.step = header.scans.front().step_at(point.position);
      first = false;
    }
    sorter.add(point.position, point.intensity, 0.0);
  });
  return end_cloud(std::move(cloud), file.name(), tiling.threads);
}

}  // namespace

std::optional<StreamedCloud> stream_cloud(const std::string& path, const CloudTiling& tiling,
                                          const PlaceChange& change,
                                          const std::vector<CloudMove>& moves, Log& log,
                                          const ProgressSink& progress) {
  const PlaceChanges changes{change, moves};
  const auto file = open_file(path);
  if (file->size() == 0) throw InputError(path, "", "the file is empty");
  switch (cloud_format(*file)) {
    case CloudFormat::kLas:
      return stream_las(*file, tiling, changes, log, progress);
    case CloudFormat::kE57:
      return stream_e57(*file, tiling, changes, log, progress);
    default:
      return std::nullopt;
  }
}

}  // namespace understory
