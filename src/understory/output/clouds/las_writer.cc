#include "understory/output/clouds/las_writer.h"

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>

#include "understory/output/copc/copc_writer.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"

namespace understory {
namespace {

constexpr TimeNs kUnixAtGpsEpoch = 315'964'800 * kNsPerSecond;
constexpr TimeNs kAdjustedGps = 1'000'000'000 * kNsPerSecond;
// Of the offset, in steps of the scale.
constexpr double kMostSteps = 2147483647.0;
constexpr TimeNs kYear2000 = 946'684'800 * kNsPerSecond;

// Seconds by which GPS time is ahead of UTC; the leap seconds since 1999.
TimeNs gps_ahead_of_utc(TimeNs unix_time) {
  struct Leap {
    TimeNs since_s;
    TimeNs ahead_s;
  };
  constexpr std::array<Leap, 5> kLeaps = {{{1'483'228'800, 18},
                                           {1'435'708'800, 17},
                                           {1'341'100'800, 16},
                                           {1'230'768'000, 15},
                                           {1'136'073'600, 14}}};
  for (const Leap& leap : kLeaps) {
    if (unix_time >= leap.since_s * kNsPerSecond) return leap.ahead_s * kNsPerSecond;
  }
  return 13 * kNsPerSecond;
}

double las_time(TimeNs stamp) {
  if (stamp < kYear2000) return to_seconds(stamp);
  return to_seconds(stamp + gps_ahead_of_utc(stamp) - kUnixAtGpsEpoch - kAdjustedGps);
}

}  // namespace

bool has_room(const LasOptions& options, const Eigen::Vector3d& point) {
  return ((point - options.offset).cwiseQuotient(options.scale).array().abs() < kMostSteps).all();
}

struct LasWriter::Impl {
  std::filesystem::path path;
  LasOptions options;
  std::ofstream stream;
  std::optional<LasStream> las;
  std::optional<CopcWriter> copc;
  std::uint64_t count = 0;
  bool committed = false;

  [[noreturn]] void fail() const {
    throw OutputError(path.string(), std::string("cannot be written: ") + std::strerror(errno));
  }
  ~Impl() {
    las.reset();
    stream.close();
    if (committed) return;
    std::error_code ignored;
    std::filesystem::remove(part_path(path), ignored);
  }

  [[nodiscard]] std::int32_t scaled(double value, int axis) const {
    const double offset = options.offset[axis];
    const double scale = options.scale[axis];
    const double steps = std::round((value - offset) / scale);
    if (!(std::abs(steps) < kMostSteps)) {
      throw OutputError(path.string(),
                        fmt::format("coordinate {} m does not fit: expected one within {:.0f} km "
                                    "of the offset {} m",
                                    value, 2147483.647 * scale, offset));
    }
    return static_cast<std::int32_t>(steps);
  }
};

LasWriter::LasWriter(const std::filesystem::path& path, const LasOptions& options)
    : impl_(std::make_unique<Impl>()) {
  Impl& self = *impl_;
  self.path = path;
  self.options = options;
  errno = 0;
  self.stream.open(part_path(path), std::ios::binary | std::ios::trunc);
  if (!self.stream) self.fail();
  self.las.emplace(self.stream, path.string(), options,
                   LasStream::Form{path.extension() == ".laz", false});
  if (options.copc) self.copc.emplace(copc_path(path), options);
}

LasWriter::~LasWriter() = default;

std::uint64_t LasWriter::points() const {
  return impl_->count;
}

void LasWriter::add(const LasRecord& point) {
  Impl& self = *impl_;
  LasPointSteps steps;
  steps.x = self.scaled(point.x, 0);
  steps.y = self.scaled(point.y, 1);
  steps.z = self.scaled(point.z, 2);
  steps.gps_time = point.gps_time.value_or(las_time(point.stamp));
  steps.intensity = point.intensity;
  steps.classification = point.classification;
  steps.tree_id = point.tree_id;
  steps.height_above_ground = point.height_above_ground;
  self.las->add(steps);
  if (self.copc) self.copc->add(steps);
  ++self.count;
}

void LasWriter::commit(const ProgressSink& progress) {
  Impl& self = *impl_;
  self.las->close();
  errno = 0;
  self.stream.close();
  if (!self.stream) self.fail();
  if (self.copc) self.copc->commit(progress);
  sync_and_rename(part_path(self.path), self.path);
  self.committed = true;
}

}  // namespace understory
