#include "understory/output/copc/copc_writer.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "understory/output/copc/chunk_table.h"
#include "understory/output/output_constants.h"
#include "understory/util/error.h"
#include "understory/util/files/atomic_file.h"
#include "understory/util/parallel.h"
#include "understory/util/stable_sort.h"

namespace understory {
namespace {

using namespace output_constants::copc;

constexpr std::size_t kHeader = 375;
constexpr std::size_t kRecordHeader = 54;    // of a VLR
constexpr std::size_t kExtendedHeader = 60;  // of an EVLR
constexpr std::size_t kInfo = 160;
constexpr std::uint16_t kInfoId = 1;
constexpr std::uint16_t kHierarchyId = 1000;

template <typename T>
void put(std::string& out, T value) {
  std::array<char, sizeof(T)> bytes;
  std::memcpy(bytes.data(), &value, sizeof(T));
  out.append(bytes.data(), bytes.size());
}
template <typename T>
void put_at(std::string& out, std::size_t at, T value) {
  std::memcpy(out.data() + at, &value, sizeof(T));
}
template <typename T>
T get(const std::string& from, std::size_t at) {
  T value{};
  UNDERSTORY_CHECK(at + sizeof(T) <= from.size());
  std::memcpy(&value, from.data() + at, sizeof(T));
  return value;
}

// Bytes padded with zeros.
void put_name(std::string& out, const char* name, std::size_t size) {
  std::string padded(name);
  padded.resize(size, '\0');
  out += padded;
}

// The header of a record, extended (with eight bytes for its length) or not.
template <typename Length>
void put_record(std::string& out, std::uint16_t id, Length length, const char* meaning) {
  put(out, std::uint16_t{0});
  put_name(out, "copc", 16);
  put(out, id);
  put(out, length);
  put_name(out, meaning, 32);
}

// Where LASzip puts things into a file: header and records, then the place of the table of chunks,
// the chunks, the table.
struct LaszipFile {
  std::string bytes;

  LaszipFile(const std::vector<LasPointSteps>& points, const std::string& name,
             const LasOptions& options) {
    std::ostringstream stream(std::ios::binary);
    LasStream las(stream, name, options, {true, true});
    for (const LasPointSteps& point : points)
      las.add(point);
    las.close();
    bytes = std::move(stream).str();
  }
  [[nodiscard]] std::size_t points_at() const { return get<std::uint32_t>(bytes, 96); }
  [[nodiscard]] std::uint32_t records() const { return get<std::uint32_t>(bytes, 100); }
  // The one chunk.
  [[nodiscard]] std::string chunk() const {
    const std::size_t begin = points_at() + sizeof(std::int64_t);
    const auto end = static_cast<std::size_t>(get<std::int64_t>(bytes, points_at()));
    UNDERSTORY_CHECK(begin <= end && end <= bytes.size());
    return bytes.substr(begin, end - begin);
  }
};

// Bounds of a cloud, in steps and in time.
struct Extent {
  std::array<std::int64_t, 3> low{};
  std::array<std::int64_t, 3> high{};
  double first_s = 0.0;
  double last_s = 0.0;
  std::uint64_t points = 0;

  void add(const LasPointSteps& point) {
    const std::array<std::int64_t, 3> place{point.x, point.y, point.z};
    if (points == 0) {
      low = high = place;
      first_s = last_s = point.gps_time;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], place[axis]);
      high[axis] = std::max(high[axis], place[axis]);
    }
    first_s = std::min(first_s, point.gps_time);
    last_s = std::max(last_s, point.gps_time);
    ++points;
  }
  // The longest axis, and how many steps it has.
  [[nodiscard]] std::size_t longest() const {
    std::size_t best = 0;
    for (std::size_t axis = 1; axis < 3; ++axis)
      if (high[axis] - low[axis] > high[best] - low[best]) best = axis;
    return best;
  }
  // The side of the cube around all, in steps: the longest axis and a little more. No point then
  // lies on the border of a node, where readers round to either side.
  [[nodiscard]] double side() const {
    return static_cast<double>(high[longest()] - low[longest()]) + kBorderSteps;
  }
};

struct HierarchyEntry {
  CopcKey key;
  std::uint64_t at = 0;
  LazChunk chunk;
};

}  // namespace

std::filesystem::path copc_path(const std::filesystem::path& laz) {
  std::filesystem::path path = laz;
  return path.replace_extension(".copc.laz");
}

bool suits_copc(const LasOptions& options) {
  return options.scale.x() == options.scale.y() && options.scale.y() == options.scale.z();
}

struct CopcWriter::Impl {
  std::filesystem::path path;
  LasOptions options;
  CopcShape shape;
  PointCells cells;
  Extent extent;
  std::ofstream stream;
  std::uint64_t written = 0;
  std::vector<HierarchyEntry> hierarchy;
  bool committed = false;

  Impl(const std::filesystem::path& to, const LasOptions& how, const CopcShape& form)
      : path(to),
        options(how),
        shape(form),
        cells(to, kGridBits, std::min(kWaiting, form.most_in_memory)) {}
  ~Impl() {
    stream.close();
    if (committed) return;
    std::error_code ignored;
    std::filesystem::remove(part_path(path), ignored);
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[noreturn]] void fail() const {
    throw OutputError(path.string(), std::string("cannot be written: ") + std::strerror(errno));
  }
  void write(const std::string& bytes) {
    errno = 0;
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!stream) fail();
    written += bytes.size();
  }

  void write_nodes(std::vector<CopcNode>&& nodes) {
    std::vector<std::string> chunks(nodes.size());
    parallel_for(nodes.size(), 1, [&](std::size_t i) {
      chunks[i] = LaszipFile(nodes[i].points, path.string(), options).chunk();
    });
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      hierarchy.push_back({nodes[i].key,
                           written,
                           {static_cast<std::uint32_t>(nodes[i].points.size()),
                            static_cast<std::uint32_t>(chunks[i].size())}});
      write(chunks[i]);
    }
  }

  // In the order of the levels, so that a reader meets the root first.
  [[nodiscard]] std::string hierarchy_page() const {
    std::vector<HierarchyEntry> entries = hierarchy;
    if (entries.empty()) entries.emplace_back();  // the root, without points
    sort_stably(entries, [](const auto& a, const auto& b) { return a.key.level < b.key.level; });
    std::string page;
    for (const HierarchyEntry& entry : entries) {
      put(page, entry.key.level);
      for (const std::int32_t part : entry.key.at)
        put(page, part);
      put(page, entry.at);
      put(page, entry.chunk.bytes);
      put(page, entry.chunk.points);
    }
    return page;
  }

  // Bounds of the cloud as the header has them. Along the longest axis they are those of the cube,
  // because some readers (copclib) take its place from there.
  struct Bounds {
    Eigen::Vector3d low = Eigen::Vector3d::Zero();
    Eigen::Vector3d high = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] Bounds bounds() const {
    Bounds bounds;
    if (extent.points == 0) return bounds;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<Eigen::Index>(axis);
      const auto place = [&](double steps) {
        return options.scale[at] * steps + options.offset[at];
      };
      bounds.low[at] = place(static_cast<double>(extent.low[axis]));
      bounds.high[at] =
          place(axis == extent.longest() ? static_cast<double>(extent.low[axis]) + extent.side()
                                         : static_cast<double>(extent.high[axis]));
    }
    return bounds;
  }
  [[nodiscard]] std::string info(std::uint64_t page_at, std::uint64_t page_bytes) const {
    const Bounds around = bounds();
    const Eigen::Vector3d centre = around.low.array() + 0.5 * (around.high - around.low).maxCoeff();
    // Readers take centre less half: rounded, that must not lie above the lowest point.
    const double rounding =
        4.0 * std::numeric_limits<double>::epsilon() *
        std::max(around.low.cwiseAbs().maxCoeff(), around.high.cwiseAbs().maxCoeff());
    const double half = 0.5 * (around.high - around.low).maxCoeff() + rounding;
    std::string out;
    put_record(out, kInfoId, static_cast<std::uint16_t>(kInfo), "COPC info VLR");
    for (const double value :
         {centre.x(), centre.y(), centre.z(), half, std::ldexp(2.0 * half, -kSpacingBits)})
      put(out, value);
    put(out, page_at);
    put(out, page_bytes);
    put(out, extent.first_s);
    put(out, extent.last_s);
    out.resize(kRecordHeader + kInfo, '\0');
    return out;
  }

  // What LASzip would have written into the header.
  void complete(std::string& header, std::uint64_t points_at, std::uint32_t records,
                std::uint64_t hierarchy_at) const {
    put_at(header, 96, static_cast<std::uint32_t>(points_at));
    put_at(header, 100, records);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<Eigen::Index>(axis);
      put_at(header, 179 + 16 * axis, bounds().high[at]);
      put_at(header, 187 + 16 * axis, bounds().low[at]);
    }
    put_at(header, 235, hierarchy_at);
    put_at(header, 243, std::uint32_t{1});
    put_at(header, 247, extent.points);
    put_at(header, 255, extent.points);  // first returns
  }

  void write_file(const ProgressSink& progress) {
    const LaszipFile empty({}, path.string(), options);
    std::string header = empty.bytes.substr(0, kHeader);
    const std::string records = empty.bytes.substr(kHeader, empty.points_at() - kHeader);
    const std::uint64_t points_at = kHeader + kRecordHeader + kInfo + records.size();
    const CopcCube cube(extent.low, extent.side());
    // The places of the table and of the hierarchy are known at the end.
    write(header + info(0, 0) + records);
    write(std::string(sizeof(std::int64_t), '\0'));
    build_copc_octree(cells, cube, shape, path, progress,
                      [&](std::vector<CopcNode>&& nodes) { write_nodes(std::move(nodes)); });
    const std::uint64_t table_at = written;
    std::vector<LazChunk> chunks;
    for (const HierarchyEntry& entry : hierarchy)
      chunks.push_back(entry.chunk);
    write(laz_chunk_table(chunks));
    const std::uint64_t hierarchy_at = written;
    const std::string page = hierarchy_page();
    std::string record;
    put_record(record, kHierarchyId, static_cast<std::uint64_t>(page.size()), "EPT hierarchy");
    write(record + page);
    complete(header, points_at, empty.records() + 1, hierarchy_at);
    rewrite(0, header + info(hierarchy_at + kExtendedHeader, page.size()));
    std::string place;
    put(place, static_cast<std::int64_t>(table_at));
    rewrite(points_at, place);
  }
  void rewrite(std::uint64_t at, const std::string& bytes) {
    errno = 0;
    stream.seekp(static_cast<std::streamoff>(at));
    write(bytes);
  }
};

CopcWriter::CopcWriter(const std::filesystem::path& path, const LasOptions& options,
                       const CopcShape& shape)
    : impl_(std::make_unique<Impl>(path, options, shape)) {
  UNDERSTORY_CHECK(suits_copc(options));
  errno = 0;
  impl_->stream.open(part_path(path), std::ios::binary | std::ios::trunc);
  if (!impl_->stream) impl_->fail();
}

CopcWriter::~CopcWriter() = default;

void CopcWriter::add(const LasPointSteps& point) {
  impl_->extent.add(point);
  impl_->cells.add(point);
}

void CopcWriter::commit(const ProgressSink& progress) {
  Impl& self = *impl_;
  self.cells.settle();
  self.write_file(progress);
  errno = 0;
  self.stream.close();
  if (!self.stream) self.fail();
  sync_and_rename(part_path(self.path), self.path);
  self.committed = true;
}

}  // namespace understory
