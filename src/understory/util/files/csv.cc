#include "understory/util/files/csv.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/read_error.h"
#include "understory/util/fixed_text.h"

namespace understory {
namespace {

constexpr std::size_t kMaxColumns = 256;

std::string lower_case(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> split(std::string_view line, std::string_view separators,
                                    bool merge) {
  std::vector<std::string_view> parts;
  std::size_t begin = 0;
  while (begin <= line.size()) {
    const std::size_t end = std::min(line.find_first_of(separators, begin), line.size());
    if (end > begin || !merge) parts.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

void split_csv(std::string_view line, std::vector<std::string_view>& cells,
               std::deque<std::string>& unquoted) {
  unquoted.clear();
  if (line.find('"') == std::string_view::npos) {
    cells = split(line, ",", false);
    return;
  }
  cells.clear();
  bool quoted = false;
  unquoted.emplace_back();
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    const bool doubled = quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"';
    if (c == ',' && !quoted) {
      unquoted.emplace_back();
    } else if (c != '"' || doubled) {
      unquoted.back() += c;
    }
    if (doubled) {
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    }
  }
  cells.assign(unquoted.begin(), unquoted.end());
}

std::optional<double> to_number(std::string_view text) {
  text = trimmed(text);
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || end != text.data() + text.size()) return std::nullopt;
  // What is too small or too large to be told apart from 0 or infinity.
  if (error == std::errc::result_out_of_range) return value;
  if (error != std::errc()) return std::nullopt;
  return value;
}

std::optional<std::uint64_t> to_count(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::string csv_cell(double value, int decimals) {
  if (!std::isfinite(value)) return "";
  return fixed_text(value, decimals);
}

std::string csv_text(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"') result += '"';
    result += c == '\n' || c == '\r' ? ' ' : c;
  }
  return result + '"';
}

struct LineReader::Stream {
  gzFile file = nullptr;
  std::array<char, 1U << 16> buffer{};
  std::size_t begin = 0;  // of what has not been returned yet
  std::size_t end = 0;
  std::uint64_t buffer_position = 0;  // of the buffer's first byte, unpacked
  ~Stream() {
    if (file != nullptr) gzclose(file);
  }
};

LineReader::LineReader(const std::filesystem::path& path, LineEdit edit)
    : path_(path), edit_(std::move(edit)), stream_(std::make_unique<Stream>()) {
  if (!std::filesystem::exists(path)) throw InputError(path.string(), "", "no such file or folder");
  if (!std::filesystem::is_regular_file(path))
    throw InputError(path.string(), "", "expected a file that can be read");
  stream_->file = gzopen(path.c_str(), "rb");
  if (stream_->file == nullptr)
    throw InputError(path.string(), "", "expected a file that can be read");
}

LineReader::~LineReader() = default;

void LineReader::fail(const std::string& expected) const {
  throw InputError(file(), line_number_ > 0 ? position() : "", expected);
}

void LineReader::fail_next(const std::string& expected) const {
  throw InputError(file(), "line " + std::to_string(line_number_ + 1), expected);
}

// Reads the next piece of the file; false at its end.
bool LineReader::refill() {
  Stream& s = *stream_;
  s.buffer_position += s.end;
  s.begin = s.end = 0;
  errno = 0;
  const int read = gzread(s.file, s.buffer.data(), static_cast<unsigned>(s.buffer.size()));
  if (read > 0) {
    s.end = static_cast<std::size_t>(read);
    return true;
  }
  const int reason = errno;
  int code = Z_OK;
  const char* message = gzerror(s.file, &code);
  if (code == Z_ERRNO)
    throw ReadError(file(), "line " + std::to_string(line_number_ + 1), reason != 0 ? reason : EIO);
  if (code != Z_OK && code != Z_STREAM_END)
    fail_next(std::string("expected an undamaged gzip stream: ") + message);
  return false;
}

bool LineReader::next(std::string& line) {
  line.clear();
  Stream& s = *stream_;
  bool any = false;
  while (true) {
    if (s.begin == s.end && !refill()) break;
    any = true;
    const char* from = s.buffer.data() + s.begin;
    const auto* end = static_cast<const char*>(std::memchr(from, '\n', s.end - s.begin));
    const std::size_t bytes =
        end != nullptr ? static_cast<std::size_t>(end - from) : s.end - s.begin;
    const bool too_long = line.size() + bytes > kMaxLineBytes;
    if (too_long && !cut_long_lines_) fail_next("expected text with lines of less than a megabyte");
    if (!too_long) line.append(from, bytes);
    s.begin += bytes;
    if (end == nullptr) continue;
    ++s.begin;
    break;
  }
  if (!any) return false;
  ++line_number_;
  while (!line.empty() && line.back() == '\r')
    line.pop_back();
  if (edit_) edit_(line);
  return true;
}

void LineReader::save(BinaryWriter& writer) const {
  writer.put(stream_->buffer_position + stream_->begin);
  writer.put(static_cast<std::uint64_t>(line_number_));
}

void LineReader::load(BinaryReader& reader) {
  Stream& s = *stream_;
  const auto place = reader.get<std::uint64_t>();
  line_number_ = reader.get<std::uint64_t>();
  s.begin = s.end = 0;
  s.buffer_position = place;
  if (place > static_cast<std::uint64_t>(std::numeric_limits<z_off_t>::max()) ||
      gzseek(s.file, static_cast<z_off_t>(place), SEEK_SET) < 0)
    fail_next("expected the file that was read before");
}

namespace {

// Spreadsheets of many countries write semicolons, and the names are then one.
std::string expected_column(const std::string& column, const std::vector<std::string>& names) {
  const bool semicolons = names.size() == 1 && names.front().find(';') != std::string::npos;
  return "expected a column '" + column + "'" +
         (semicolons ? ": columns are separated by commas, and here by semicolons" : "");
}

}  // namespace

CsvReader::CsvReader(const std::filesystem::path& path, const std::vector<std::string>& required,
                     CsvFormat format)
    : lines_(path, format.edit), format_(std::move(format)) {
  if (format_.on_short_row) lines_.cut_long_lines();
  read_header();
  for (const std::string& name : required) {
    if (!find({name})) fail(expected_column(name, names_));
  }
}

void CsvReader::read_header() {
  std::string_view header;
  do {
    if (!lines_.next(line_))
      throw InputError(lines_.file(), "", "expected a header line with the names of the columns");
    header = line_;
    if (header.substr(0, 3) == "\xef\xbb\xbf") header.remove_prefix(3);
    header = trimmed(header);
    if (format_.header_in_comment && header.substr(0, 1) == "#") {
      header.remove_prefix(1);
      if (header.find(',') == std::string_view::npos) header = {};
    }
  } while (header.empty());
  split_csv(header, cells_, unquoted_);
  for (const std::string_view name : cells_) {
    if (names_.size() == kMaxColumns) break;
    names_.push_back(format_.any_case ? lower_case(trimmed(name)) : std::string(trimmed(name)));
    columns_.emplace(names_.back(), names_.size() - 1);
  }
}

std::optional<std::size_t> CsvReader::find(const std::vector<std::string>& names) const {
  for (const std::string& name : names) {
    const auto column = columns_.find(name);
    if (column != columns_.end()) return column->second;
  }
  return std::nullopt;
}

std::size_t CsvReader::require(const std::vector<std::string>& names) const {
  if (const auto column = find(names)) return *column;
  fail(expected_column(names.front(), names_));
}

bool CsvReader::next() {
  while (lines_.next(line_)) {
    const std::string_view content = trimmed(line_);
    if (content.empty() || content.front() == '#') continue;
    split_csv(line_, cells_, unquoted_);
    if (cells_.size() == names_.size()) return true;
    // A comma at the end of each row adds an empty cell.
    const bool only_blank =
        cells_.size() > names_.size() &&
        std::all_of(cells_.begin() + static_cast<std::ptrdiff_t>(names_.size()), cells_.end(),
                    [](std::string_view cell) { return trimmed(cell).empty(); });
    if (only_blank && !format_.exact_width) return true;
    std::string problem = "expected " + std::to_string(names_.size()) + " cells, found " +
                          std::to_string(cells_.size());
    if (cells_.size() > names_.size()) {
      // More cells would be read into wrong columns.
      fail(problem + ". Are there decimal commas? Decimals are written with a point");
    }
    if (!format_.on_short_row) fail(problem);
    format_.on_short_row(problem);
  }
  return false;
}

std::string_view CsvReader::text(const std::string& column) const {
  const auto at = columns_.find(column);
  return at == columns_.end() ? std::string_view() : text(at->second);
}

double CsvReader::number(std::size_t column) const {
  const std::string_view cell = text(column);
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  const std::optional<double> value = to_number(cell);
  if (!value) {
    fail("expected a number in column '" + names_[column] + "', found '" +
         std::string(cell.substr(0, 40)) + "'");
  }
  return *value;
}

double CsvReader::number(const std::string& column) const {
  const auto at = columns_.find(column);
  return at == columns_.end() ? std::numeric_limits<double>::quiet_NaN() : number(at->second);
}

double CsvReader::finite(const std::string& column) const {
  const double value = number(column);
  if (!std::isfinite(value)) fail("expected a finite number in column '" + column + "'");
  return value;
}

}  // namespace understory
