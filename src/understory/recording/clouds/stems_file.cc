#include "understory/recording/clouds/stems_file.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "understory/recording/clouds/text_lines.h"
#include "understory/util/error.h"
#include "understory/util/read_error.h"

namespace understory {
namespace {

constexpr std::size_t kMaxLineBytes = std::size_t{1} << 16;
constexpr double kMaxRangeM = 10'000.0;  // no sensor sees a stem from farther away

enum Column {
  kFrame,
  kTime,
  kX,
  kY,
  kZ,
  kAxisX,
  kAxisY,
  kAxisZ,
  kLength,
  kDbh,
  kScore,
  kRadius,
  kRadiusSd,
  kXx,
  kXy,
  kYy,
  kZz,
  kColumns
};
constexpr std::array<std::string_view, kColumns> kNames = {
    "frame", "timestamp", "x",        "y",           "z",  "axis_x", "axis_y", "axis_z", "length_m",
    "dbh_m", "score",     "radius_m", "radius_sd_m", "xx", "xy",     "yy",     "zz"};

class GzipLines {
 public:
  explicit GzipLines(const std::filesystem::path& path) : file_(path.string()) {
    if (!std::filesystem::exists(path)) fail("no such file or folder");
    if (!std::filesystem::is_regular_file(path)) fail("expected a file that can be read");
    stream_ = gzopen(path.c_str(), "rb");
    if (stream_ == nullptr) fail("expected a file that can be read");
    gzbuffer(stream_, 1U << 17);
  }
  ~GzipLines() {
    if (stream_ != nullptr) gzclose(stream_);
  }
  GzipLines(const GzipLines&) = delete;
  GzipLines& operator=(const GzipLines&) = delete;

  bool next(std::string_view& line) {
    ++number_;
    const bool read = gzgets(stream_, buffer_.data(), static_cast<int>(buffer_.size())) != nullptr;
    line = read ? std::string_view(buffer_.data()) : std::string_view();
    if (line.size() + 1 == buffer_.size()) fail("expected a table with lines of less than 64 KiB");
    if (line.empty() || line.back() != '\n') check_end();
    return read;
  }

  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError(file_, number_ > 0 ? "line " + std::to_string(number_) : "", expected);
  }

 private:
  // Where text ends without the end of a line: the end of the file, or a stream cut short.
  void check_end() const {
    const int reason = errno;
    int code = Z_OK;
    const char* message = gzerror(stream_, &code);
    if (code == Z_ERRNO)
      throw ReadError(file_, "line " + std::to_string(number_), reason != 0 ? reason : EIO);
    if (code != Z_OK && code != Z_STREAM_END)
      fail(std::string("expected an undamaged gzip stream: ") + message);
  }

  std::string file_;
  gzFile stream_ = nullptr;
  std::vector<char> buffer_ = std::vector<char>(kMaxLineBytes);
  std::size_t number_ = 0;
};

// Which cell holds which column; -1: absent.
struct Header {
  std::array<int, kColumns> cell{};
  std::size_t cells = 0;
};

Header read_header(GzipLines& lines, Log& log) {
  std::string_view line;
  if (!lines.next(line)) lines.fail("expected a header line with the names of the columns");
  if (line.substr(0, 3) == "\xef\xbb\xbf") line.remove_prefix(3);
  while (!line.empty() && (line.back() == '\n' || line.back() == '\r'))
    line.remove_suffix(1);
  Header header;
  header.cell.fill(-1);
  std::string unknown;
  for (const std::string_view name : split_cells(line, ',')) {
    const auto at = std::find(kNames.begin(), kNames.end(), name);
    if (at == kNames.end())
      unknown += (unknown.empty() ? "" : ", ") + std::string(name.substr(0, 40));
    else
      header.cell[static_cast<std::size_t>(at - kNames.begin())] = static_cast<int>(header.cells);
    ++header.cells;
  }
  for (const Column needed : {kFrame, kX, kY, kZ}) {
    if (header.cell[needed] < 0)
      lines.fail("expected a column '" + std::string(kNames[needed]) + "'");
  }
  if (!unknown.empty()) log.info("stems: unknown columns passed over: " + unknown);
  return header;
}

// The cells of one row.
class Row {
 public:
  Row(const Header& header, const GzipLines& lines) : header_(header), lines_(lines) {}

  void set(std::string_view line) {
    while (!line.empty() && (line.back() == '\n' || line.back() == '\r'))
      line.remove_suffix(1);
    cells_.clear();
    std::size_t begin = 0;
    while (true) {
      const std::size_t end = line.find(',', begin);
      cells_.push_back(line.substr(begin, end == line.npos ? line.npos : end - begin));
      if (end == line.npos) break;
      begin = end + 1;
    }
    if (cells_.size() != header_.cells)
      lines_.fail("expected " + std::to_string(header_.cells) + " cells, found " +
                  std::to_string(cells_.size()));
  }

  [[nodiscard]] std::string_view text(Column column) const {
    const int cell = header_.cell[column];
    if (cell < 0) return {};
    std::string_view text = cells_[static_cast<std::size_t>(cell)];
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t'))
      text.remove_prefix(1);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\t'))
      text.remove_suffix(1);
    return text;
  }

  // NaN where the cell is empty or the column absent.
  [[nodiscard]] double number(Column column) const {
    const std::string_view cell = text(column);
    if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
    const std::optional<double> value = to_number(cell);
    if (!value)
      lines_.fail("expected a number in column '" + std::string(kNames[column]) + "', found '" +
                  std::string(cell.substr(0, 40)) + "'");
    return *value;
  }

  // NaN where unknown.
  [[nodiscard]] float finite(Column column) const {
    const double value = number(column);
    if (std::isinf(value))
      lines_.fail("expected a finite number in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  // Of a tree or its error, NaN where unknown.
  [[nodiscard]] float size(Column column) const {
    constexpr double kTallest = 200.0;
    const double value = number(column);
    if (value < 0.0 || value > kTallest)
      lines_.fail("expected 0 to 200 m in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  // NaN where unknown.
  [[nodiscard]] float variance(Column column) const {
    const double value = number(column);
    if (value <= 0.0 || std::isinf(value))
      lines_.fail("expected a variance above 0 in column '" + std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

  [[nodiscard]] float position(Column column) const {
    const double value = number(column);
    if (!(std::abs(value) < kMaxRangeM))
      lines_.fail("expected a position within 10 km of the sensor in column '" +
                  std::string(kNames[column]) + "'");
    return static_cast<float>(value);
  }

 private:
  const Header& header_;
  const GzipLines& lines_;
  std::vector<std::string_view> cells_;
};

int frame_of(const Row& row, const GzipLines& lines) {
  const std::string_view text = row.text(kFrame);
  int frame = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), frame);
  if (error != std::errc() || end != text.data() + text.size() || frame < 0)
    lines.fail("expected a frame number (0, 1, ...) in column 'frame'");
  return frame;
}

TimeNs stamp_of(const Row& row, int frame, const GzipLines& lines) {
  const std::string text(row.text(kTime));
  TimeNs stamp = static_cast<TimeNs>(frame) * kNsPerSecond;
  if (text.empty() || parse_seconds(text, stamp)) return stamp;
  const std::optional<double> seconds = to_number(text);  // 1.7e3
  if (!seconds || !(std::abs(*seconds) < 9e9)) lines.fail("expected a time in column 'timestamp'");
  return from_seconds(*seconds);
}

Eigen::Vector3f axis_of(const Row& row, const GzipLines& lines) {
  const Eigen::Vector3d axis(row.number(kAxisX), row.number(kAxisY), row.number(kAxisZ));
  if (axis.array().isNaN().all()) return Eigen::Vector3f::Constant(Stem::kUnknown);
  const double length = axis.norm();
  if (!(length > 0.1 && length < 10.0)) lines.fail("expected a direction in axis_x,axis_y,axis_z");
  return (axis / length).cast<float>();
}

Stem stem_of(const Row& row, const GzipLines& lines) {
  Stem stem;
  stem.point = {row.position(kX), row.position(kY), row.position(kZ)};
  stem.axis = axis_of(row, lines);
  stem.length_m = row.size(kLength);
  stem.dbh_m = row.size(kDbh);
  stem.score = row.finite(kScore);
  stem.radius_m = row.size(kRadius);
  stem.radius_sd_m = row.size(kRadiusSd);
  stem.xx = row.variance(kXx);
  stem.xy = row.finite(kXy);
  stem.yy = row.variance(kYy);
  stem.zz = row.variance(kZz);
  return stem;
}

}  // namespace

std::vector<StemView> read_stem_views(const std::filesystem::path& path, Log& log) {
  GzipLines lines(path);
  const Header header = read_header(lines, log);
  Row row(header, lines);
  std::vector<StemView> views;
  std::string_view line;
  while (lines.next(line)) {
    if (line.find_first_not_of(" \t\r\n") == line.npos || line.front() == '#') continue;
    row.set(line);
    const int frame = frame_of(row, lines);
    const TimeNs stamp = stamp_of(row, frame, lines);
    if (views.empty() || views.back().frame != frame) {
      if (!views.empty() && frame < views.back().frame)
        lines.fail("expected the rows of a frame together and frames in ascending order");
      if (!views.empty() && stamp <= views.back().stamp)
        lines.fail("expected a timestamp that grows from frame to frame");
      if (!views.empty()) views.back().stems.shrink_to_fit();
      views.push_back({frame, stamp, {}});
    } else if (stamp != views.back().stamp) {
      lines.fail("expected one timestamp for all rows of a frame");
    }
    views.back().stems.push_back(stem_of(row, lines));
  }
  if (views.empty()) lines.fail("expected at least one row with a stem");
  return views;
}

}  // namespace understory
