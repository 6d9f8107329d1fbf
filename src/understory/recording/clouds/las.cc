#include "understory/recording/clouds/las.h"

#include <laszip/laszip_api.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>
#include <fstream>
#include <istream>
#include <memory>
#include <streambuf>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "understory/recording/clouds/las_vlrs.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

using namespace las_bytes;

constexpr std::size_t kSmallestHeader = 227;
constexpr std::size_t kLargestPoint = 4096;
constexpr std::array<std::uint32_t, 11> kRecordLengths{20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
// Classes of the standard.
constexpr std::uint8_t kLowNoise = 7;
constexpr std::uint8_t kHighNoise = 18;
constexpr std::size_t kTreeColumns = sizeof(std::uint32_t) + sizeof(float);

std::uint32_t plain_length(const LasHeader& header) {
  return kRecordLengths[static_cast<std::size_t>(header.point_format)];
}

[[noreturn]] void fail(const ByteSource& file, std::uint64_t at, const std::string& expected) {
  throw InputError(file.name(), "byte " + std::to_string(at), expected);
}

bool has_time(int format) {
  return format == 1 || format >= 3;
}

void report_break(const ByteSource& file, const LasHeader& header, std::uint64_t read, Log& log) {
  if (read == header.points) return;
  const std::string text = std::to_string(read) + " of " + std::to_string(header.points) +
                           " points can be read; the rest is damaged or cut off";
  if (read == 0) throw InputError(file.name(), "", "expected points: " + text);
  report_finding(log, Finding::kDamage, file.name() + ": " + text);
}

class PointDecoder {
 public:
  explicit PointDecoder(const LasHeader& header) : header_(header) {}

  // Of an uncompressed record.
  [[nodiscard]] LasPoint from_record(const std::uint8_t* raw) const {
    std::array<std::int32_t, 3> xyz;
    std::memcpy(xyz.data(), raw, sizeof(xyz));
    LasPoint point;
    point.position = position(xyz[0], xyz[1], xyz[2]);
    std::uint16_t intensity = 0;
    std::memcpy(&intensity, raw + 12, 2);
    point.intensity = intensity;
    const bool modern = header_.point_format >= 6;
    point.classification = modern ? raw[16] : static_cast<std::uint8_t>(raw[15] & 0x1F);
    point.withheld = (raw[15] & (modern ? 0x04 : 0x80)) != 0;
    if (header_.has_gps_time) std::memcpy(&point.gps_time, raw + (modern ? 22 : 20), 8);
    if (header_.has_trees) take_columns(raw + plain_length(header_), point);
    return point;
  }
  [[nodiscard]] LasPoint from_laszip(const laszip_point& raw) const {
    LasPoint point;
    point.position = position(raw.X, raw.Y, raw.Z);
    point.intensity = raw.intensity;
    point.classification =
        header_.point_format >= 6 ? raw.extended_classification : raw.classification;
    point.withheld = header_.point_format >= 6 ? (raw.extended_classification_flags & 0x04) != 0
                                               : raw.withheld_flag != 0;
    point.gps_time = header_.has_gps_time ? raw.gps_time : 0.0;
    if (header_.has_trees && raw.num_extra_bytes >= static_cast<laszip_I32>(kTreeColumns))
      take_columns(raw.extra_bytes, point);
    return point;
  }

 private:
  static void take_columns(const std::uint8_t* raw, LasPoint& point) {
    std::memcpy(&point.tree_id, raw, sizeof(point.tree_id));
    std::memcpy(&point.height_above_ground, raw + sizeof(point.tree_id),
                sizeof(point.height_above_ground));
  }
  [[nodiscard]] Eigen::Vector3d position(double x, double y, double z) const {
    return header_.offset + header_.scale.cwiseProduct(Eigen::Vector3d(x, y, z));
  }
  const LasHeader& header_;
};

void read_uncompressed(ByteSource& file, const LasHeader& header, Log& log,
                       const std::function<void(const LasPoint&)>& visit) {
  constexpr std::uint64_t kAtOnce = 4096;
  const PointDecoder decoder(header);
  std::vector<std::uint8_t> part;
  std::uint64_t read = 0;
  while (read < header.points) {
    const std::uint64_t want = std::min(kAtOnce, header.points - read);
    file.read(header.point_position + read * header.record_length, want * header.record_length,
              part);
    const std::uint64_t got = part.size() / header.record_length;
    for (std::uint64_t i = 0; i < got; ++i)
      visit(decoder.from_record(part.data() + i * header.record_length));
    read += got;
    if (got < want) break;
  }
  report_break(file, header, read, log);
}

// Whether LASzip reads the table of chunks at the end of a file.
enum class ChunkTable : std::uint8_t { kRead, kLeftOut };

// Shows LASzip a file whose header holds its own record alone. LASzip frees what it has not yet
// allocated when a record of a damaged header ends its reading. Points keep their places.
class CleanedFile : public ByteSource {
 public:
  CleanedFile(ByteSource& file, ChunkTable table) : file_(file) {
    std::vector<std::uint8_t> header;
    file.read(0, 375, header);
    const auto header_size = get<std::uint16_t>(header, 94);
    const auto points = get<std::uint32_t>(header, 96);
    const bool long_enough = header_size >= (header[25] >= 4 ? 375 : header[25] == 3 ? 235 : 227);
    const std::vector<std::uint8_t> record =
        find_record(header_size, points, get<std::uint32_t>(header, 100));
    constexpr std::size_t kItems = kVlrHeader + 32;  // their number, then 6 bytes each
    if (!long_enough || header[24] != 1 || header[25] > 4 ||
        record.size() != kItems + 2 + 6 * std::size_t{get<std::uint16_t>(record, kItems)} ||
        header_size + record.size() > points)
      fail(file, header_size, "expected LASzip's record in the header");
    file.read(0, header_size, start_);
    const std::uint32_t records = 1;
    std::memcpy(start_.data() + 100, &records, 4);
    // Waveforms and records behind the points are not read.
    if (header[25] >= 3) std::memset(start_.data() + 227, 0, 8);
    if (header[25] >= 4) std::memset(start_.data() + 235, 0, 12);
    start_.insert(start_.end(), record.begin(), record.end());
    // A cut has taken the table of chunks away. LASzip does without if the table's place lies
    // before the first chunk: that means it was never written.
    table_at_ = points;
    file.read(points, sizeof(std::uint64_t), table_);
    if (table_.size() == sizeof(std::uint64_t) &&
        (table == ChunkTable::kLeftOut || get<std::uint64_t>(table_, 0) >= file.size()))
      std::memcpy(table_.data(), &table_at_, sizeof(table_at_));
  }

  std::size_t read(std::uint64_t offset, std::uint8_t* into, std::size_t count) override {
    const std::size_t got = file_.read(offset, into, count);
    for (std::size_t i = 0; i < got && offset + i < start_.size(); ++i)
      into[i] = start_[static_cast<std::size_t>(offset) + i];
    for (std::size_t i = 0; i < table_.size(); ++i) {
      if (table_at_ + i >= offset && table_at_ + i < offset + got)
        into[static_cast<std::size_t>(table_at_ + i - offset)] = table_[i];
    }
    return got;
  }
  [[nodiscard]] std::uint64_t size() const override { return file_.size(); }
  [[nodiscard]] const std::string& name() const override { return file_.name(); }

 private:
  [[nodiscard]] std::vector<std::uint8_t> find_record(std::uint64_t at, std::uint64_t end,
                                                      std::uint32_t records) {
    std::vector<std::uint8_t> head;
    for (std::uint32_t i = 0; i < std::min(records, kMostVlrs) && at + kVlrHeader <= end; ++i) {
      file_.read(at, kVlrHeader, head);
      if (head.size() < kVlrHeader) break;
      const std::uint64_t size = kVlrHeader + get<std::uint16_t>(head, 20);
      if (text_of(head, 2, 16) == "laszip encoded" && get<std::uint16_t>(head, 18) == 22204 &&
          at + size <= end) {
        std::vector<std::uint8_t> record;
        file_.read(at, size, record);
        return record;
      }
      at += size;
    }
    return {};
  }

  ByteSource& file_;
  std::vector<std::uint8_t> start_;
  std::vector<std::uint8_t> table_;  // where the table of chunks lies, and where that is written
  std::uint64_t table_at_ = 0;
};

// A stream over a ByteSource, for LASzip.
class SourceBuffer : public std::streambuf {
 public:
  explicit SourceBuffer(ByteSource& file) : file_(file) {}

 protected:
  int_type underflow() override {
    const std::uint64_t next = begin_ + static_cast<std::uint64_t>(egptr() - eback());
    const std::size_t got =
        file_.read(next, reinterpret_cast<std::uint8_t*>(window_.data()), window_.size());
    begin_ = next;
    setg(window_.data(), window_.data(), window_.data() + got);
    return got == 0 ? traits_type::eof() : traits_type::to_int_type(window_[0]);
  }
  pos_type seekoff(off_type offset, std::ios_base::seekdir way, std::ios_base::openmode) override {
    const auto here = static_cast<off_type>(begin_ + static_cast<std::uint64_t>(gptr() - eback()));
    const off_type from = way == std::ios_base::beg   ? 0
                          : way == std::ios_base::cur ? here
                                                      : static_cast<off_type>(file_.size());
    return seekpos(from + offset, std::ios_base::in);
  }
  pos_type seekpos(pos_type position, std::ios_base::openmode) override {
    const off_type at = position;
    if (at < 0) return pos_type(off_type(-1));
    const auto loaded = static_cast<off_type>(egptr() - eback());
    const off_type relative = at - static_cast<off_type>(begin_);
    if (relative >= 0 && relative < loaded) {
      setg(eback(), eback() + relative, egptr());
    } else {
      begin_ = static_cast<std::uint64_t>(at);
      setg(window_.data(), window_.data(), window_.data());
    }
    return position;
  }

 private:
  ByteSource& file_;
  std::uint64_t begin_ = 0;  // of what is loaded
  std::array<char, 1U << 16> window_{};
};

struct LaszipCloser {
  void operator()(void* reader) const {
    laszip_close_reader(reader);
    laszip_destroy(reader);
  }
};

// Decodes with LASzip until it gives up and hands parts of the points to `pass`.
void decode_compressed(ByteSource& file, const LasHeader& header, ChunkTable table,
                       const std::function<void(const std::vector<LasPoint>&)>& pass) {
  constexpr std::size_t kAtOnce = 1024;
  CleanedFile cleaned(file, table);
  SourceBuffer buffer(cleaned);
  std::istream stream(&buffer);
  laszip_POINTER raw = nullptr;
  if (laszip_create(&raw) != 0) return;
  const std::unique_ptr<void, LaszipCloser> reader(raw);
  laszip_BOOL compressed = 0;
  laszip_point* point = nullptr;
  if (laszip_open_reader_stream(raw, stream, &compressed) != 0 ||
      laszip_get_point_pointer(raw, &point) != 0)
    return;
  const PointDecoder decoder(header);
  std::vector<LasPoint> part;
  for (std::uint64_t read = 0; read < header.points && laszip_read_point(raw) == 0; ++read) {
    part.push_back(decoder.from_laszip(*point));
    if (part.size() < kAtOnce) continue;
    pass(part);
    part.clear();
  }
  pass(part);
}

bool write_all(int pipe, const void* data, std::size_t size) {
  const auto* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(pipe, at, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    at += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

// LASzip allocates the sizes that a damaged file states, up to 4 GB. (A sanitizer's own memory is
// far beyond any limit.)
void limit_memory() {
#if !defined(UNDERSTORY_SANITIZED)
  constexpr rlim_t kMore = rlim_t{1} << 30;
  std::ifstream file("/proc/self/statm");
  rlim_t size = 0, resident = 0, shared = 0, text = 0, library = 0, data = 0;
  if (!(file >> size >> resident >> shared >> text >> library >> data)) return;
  rlimit limit{};
  if (::getrlimit(RLIMIT_DATA, &limit) != 0) return;
  const rlim_t wanted = data * static_cast<rlim_t>(::sysconf(_SC_PAGESIZE)) + kMore;
  limit.rlim_cur = std::min(limit.rlim_cur, wanted);
  ::setrlimit(RLIMIT_DATA, &limit);
#endif
}

// What the process that decodes came to, beside the points.
constexpr int kDecoded = 0;
constexpr int kGaveUp = 1;
constexpr int kUnreadable = 2;

// Notes that the system could not read the file: LASzip takes that for its end.
class WatchedFile : public ByteSource {
 public:
  explicit WatchedFile(ByteSource& file) : file_(file) {}
  std::size_t read(std::uint64_t offset, std::uint8_t* into, std::size_t count) override {
    try {
      return file_.read(offset, into, count);
    } catch (const ReadError&) {
      unreadable_ = true;
      throw;
    }
  }
  [[nodiscard]] std::uint64_t size() const override { return file_.size(); }
  [[nodiscard]] const std::string& name() const override { return file_.name(); }
  [[nodiscard]] bool unreadable() const { return unreadable_; }

 private:
  ByteSource& file_;
  bool unreadable_ = false;
};

// In the process that decodes: never returns.
[[noreturn]] void serve_points(ByteSource& file, const LasHeader& header, ChunkTable table,
                               int pipe) {
  WatchedFile watched(file);
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGPIPE})
    std::signal(signal, SIG_DFL);
  limit_memory();
  try {
    decode_compressed(watched, header, table, [&](const std::vector<LasPoint>& points) {
      if (!write_all(pipe, points.data(), points.size() * sizeof(LasPoint))) ::_exit(kGaveUp);
    });
  } catch (...) {
    ::_exit(watched.unreadable() ? kUnreadable : kGaveUp);
  }
  ::_exit(watched.unreadable() ? kUnreadable : kDecoded);
}

// The end of a pipe and the process at its other end.
struct Decoding {
  int pipe = -1;
  pid_t process = -1;
  ~Decoding() { (void)wait(); }
  // Closes the pipe and returns what the process came to.
  int wait() {
    if (pipe >= 0) ::close(pipe);
    int status = 0;
    if (process > 0) {
      while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
      }
    }
    pipe = -1;
    process = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : kGaveUp;
  }
};

// LASzip reads and writes out of bounds on damaged data, so it decodes in a process of its own. If
// that process ends early, what came before is kept. Returns the number of points.
std::uint64_t read_apart(ByteSource& file, const LasHeader& header, ChunkTable table,
                         const std::function<void(const LasPoint&)>& visit) {
  static_assert(std::is_trivially_destructible_v<LasPoint>);
  const CleanedFile checked(file, table);
  std::array<int, 2> ends{};
  if (::pipe(ends.data()) != 0) throw InternalError("no pipe for LASzip's process");
  Decoding decoding;
  decoding.pipe = ends[0];
  decoding.process = ::fork();
  if (decoding.process == 0) {
    ::close(ends[0]);
    serve_points(file, header, table, ends[1]);
  }
  ::close(ends[1]);
  if (decoding.process < 0) throw InternalError("no process for LASzip");
  std::vector<char> part(1024 * sizeof(LasPoint));
  std::size_t have = 0;
  std::uint64_t read = 0;
  while (true) {
    const ssize_t got = ::read(decoding.pipe, part.data() + have, part.size() - have);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    have += static_cast<std::size_t>(got);
    const std::size_t whole = have / sizeof(LasPoint);
    for (std::size_t i = 0; i < whole; ++i) {
      LasPoint point;
      std::memcpy(static_cast<void*>(&point), part.data() + i * sizeof(LasPoint), sizeof(point));
      visit(point);
    }
    read += whole;
    have -= whole * sizeof(LasPoint);
    std::memmove(part.data(), part.data() + whole * sizeof(LasPoint), have);
  }
  if (decoding.wait() == kUnreadable)
    throw ReadError(file.name(), "behind point " + std::to_string(read), EIO);
  return read;
}

// A table of chunks that is there and not whole gives no point at all: LASzip then does without it.
void read_compressed(ByteSource& file, const LasHeader& header, Log& log,
                     const std::function<void(const LasPoint&)>& visit) {
  std::uint64_t read = read_apart(file, header, ChunkTable::kRead, visit);
  if (read == 0 && header.points > 0) read = read_apart(file, header, ChunkTable::kLeftOut, visit);
  report_break(file, header, read, log);
}

void read_fields(const std::vector<std::uint8_t>& raw, LasHeader& header) {
  header.version_minor = raw[25];
  const std::uint8_t format = get<std::uint8_t>(raw, 104);
  header.compressed = (format & 0xC0) != 0;
  header.point_format = format & 0x3F;
  // LASzip writes itself as the generating software.
  constexpr std::string_view kOwn = "understory";
  constexpr std::ptrdiff_t kSystem = 26;
  header.of_this_program = std::equal(kOwn.begin(), kOwn.end(), raw.begin() + kSystem);
  header.has_gps_time = has_time(header.point_format);
  header.gps_week_time = (get<std::uint16_t>(raw, 6) & 1U) == 0;
  header.record_length = get<std::uint16_t>(raw, 105);
  header.point_position = get<std::uint32_t>(raw, 96);
  header.points = get<std::uint32_t>(raw, 107);
  if (header.version_minor >= 4 && raw.size() >= 255) {
    const auto points = get<std::uint64_t>(raw, 247);
    if (points > 0) header.points = points;
  }
  for (int i = 0; i < 3; ++i) {
    const auto step = static_cast<std::size_t>(i);
    header.scale[i] = get<double>(raw, 131 + 8 * step);
    header.offset[i] = get<double>(raw, 155 + 8 * step);
    header.high[i] = get<double>(raw, 179 + 16 * step);
    header.low[i] = get<double>(raw, 187 + 16 * step);
  }
}

}  // namespace

LasHeader read_las_header(ByteSource& file) {
  std::vector<std::uint8_t> raw;
  file.read(0, 375, raw);
  if (raw.size() < kSmallestHeader || std::memcmp(raw.data(), "LASF", 4) != 0)
    fail(file, 0, "expected a LAS header");
  LasHeader header;
  read_fields(raw, header);
  const auto header_size = get<std::uint16_t>(raw, 94);
  if (header.point_format >= static_cast<int>(kRecordLengths.size()))
    fail(file, 104, "expected a point format from 0 to 10");
  if (header.record_length < plain_length(header) || header.record_length > kLargestPoint)
    fail(file, 105, "expected a record length that goes with the point format");
  if (!header.scale.allFinite() || !header.offset.allFinite() || header.scale.minCoeff() <= 0.0 ||
      header.scale.maxCoeff() > 1e6 || header.offset.cwiseAbs().maxCoeff() > 1e12)
    fail(file, 131, "expected finite scales and offsets");
  if (header_size < kSmallestHeader || header.point_position < header_size ||
      header.point_position > file.size())
    fail(file, 94, "expected the points behind the header");
  LasVlrs vlrs = read_las_vlrs(file, header_size, get<std::uint32_t>(raw, 100));
  header.coordinate_system = std::move(vlrs.coordinate_system);
  header.has_trees = vlrs.trees && header.record_length >= plain_length(header) + kTreeColumns;
  return header;
}

std::uint64_t read_las_points(ByteSource& file, const LasHeader& header, Log& log,
                              const std::function<void(const LasPoint&)>& visit) {
  std::uint64_t left_out = 0;
  const auto visit_used = [&](const LasPoint& point) {
    const bool noise = point.classification == kLowNoise || point.classification == kHighNoise;
    if (!header.of_this_program && (noise || point.withheld)) {
      ++left_out;
    } else {
      visit(point);
    }
  };
  if (header.compressed) {
    read_compressed(file, header, log, visit_used);
  } else {
    read_uncompressed(file, header, log, visit_used);
  }
  if (left_out > 0)
    log.warn("recording.noise",
             file.name() + ": " + std::to_string(left_out) +
                 " points are left out: they are withheld, or of the classes noise (7, 18)");
  return left_out;
}

void refuse_all_noise(const ByteSource& file, std::uint64_t left_out) {
  if (left_out > 0)
    throw InputError(file.name(), "", "all points are classed as noise (7, 18) or withheld");
}

}  // namespace understory
