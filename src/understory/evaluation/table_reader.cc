#include "understory/evaluation/table_reader.h"

#include <zlib.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <limits>

#include "understory/util/error.h"
#include "understory/util/read_error.h"

namespace understory {
namespace {

constexpr std::size_t kMaxLineBytes = std::size_t{1} << 20;

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

}  // namespace

struct LineReader::Stream {
  gzFile file = nullptr;
  std::array<char, 4096> buffer{};
  ~Stream() {
    if (file != nullptr) gzclose(file);
  }
};

LineReader::LineReader(const std::filesystem::path& path)
    : path_(path), stream_(std::make_unique<Stream>()) {
  if (!std::filesystem::exists(path)) throw InputError(path.string(), "", "no such file or folder");
  if (!std::filesystem::is_regular_file(path)) {
    throw InputError(path.string(), "", "expected a file that can be read");
  }
  stream_->file = gzopen(path.c_str(), "rb");
  if (stream_->file == nullptr) {
    throw InputError(path.string(), "", "expected a file that can be read");
  }
}

LineReader::~LineReader() = default;

bool LineReader::next(std::string& line) {
  line.clear();
  while (gzgets(stream_->file, stream_->buffer.data(), static_cast<int>(stream_->buffer.size())) !=
         nullptr) {
    line += stream_->buffer.data();
    if (!line.empty() && line.back() == '\n') break;
    if (line.size() > kMaxLineBytes) {
      throw InputError(file(), "line " + std::to_string(line_number_ + 1),
                       "expected text with lines of less than a megabyte");
    }
  }
  const int reason = errno;
  int code = Z_OK;
  const char* message = gzerror(stream_->file, &code);
  if (code == Z_ERRNO) {
    throw ReadError(file(), "line " + std::to_string(line_number_ + 1), reason != 0 ? reason : EIO);
  }
  if (code != Z_OK && code != Z_STREAM_END) {
    throw InputError(file(), "line " + std::to_string(line_number_ + 1),
                     std::string("expected an undamaged gzip stream: ") + message);
  }
  if (line.empty()) return false;
  ++line_number_;
  while (!line.empty() && (line.back() == '\n' || line.back() == '\r'))
    line.pop_back();
  return true;
}

std::vector<std::string_view> split(std::string_view line, std::string_view separators,
                                    bool merge) {
  std::vector<std::string_view> parts;
  std::size_t begin = 0;
  while (begin <= line.size()) {
    std::size_t end = line.find_first_of(separators, begin);
    if (end == std::string_view::npos) end = line.size();
    if (end > begin || !merge) parts.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

bool parse_number(std::string_view text, double& value) {
  text = trimmed(text);
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

CsvReader::CsvReader(const std::filesystem::path& path, const std::vector<std::string>& required)
    : lines_(path) {
  do {
    if (!lines_.next(line_)) {
      throw InputError(lines_.file(), "", "expected a header line with the names of the columns");
    }
  } while (trimmed(line_).empty());
  std::string_view header = line_;
  if (header.substr(0, 3) == "\xef\xbb\xbf") header.remove_prefix(3);
  const std::vector<std::string_view> names = split(header, ",", false);
  width_ = names.size();
  for (std::size_t i = 0; i < names.size(); ++i)
    columns_.emplace(trimmed(names[i]), i);
  for (const std::string& name : required) {
    if (!has(name)) {
      throw InputError(lines_.file(), lines_.position(), "expected a column '" + name + "'");
    }
  }
}

bool CsvReader::next() {
  while (lines_.next(line_)) {
    const std::string_view content = trimmed(line_);
    if (content.empty() || content.front() == '#') continue;
    cells_ = split(line_, ",", false);
    if (cells_.size() < width_) {
      throw InputError(
          lines_.file(), lines_.position(),
          "expected " + std::to_string(width_) + " cells, found " + std::to_string(cells_.size()));
    }
    return true;
  }
  return false;
}

std::string_view CsvReader::text(const std::string& column) const {
  const auto at = columns_.find(column);
  return at == columns_.end() ? std::string_view() : trimmed(cells_[at->second]);
}

double CsvReader::number(const std::string& column) const {
  const std::string_view cell = text(column);
  if (cell.empty()) return std::numeric_limits<double>::quiet_NaN();
  double value = 0.0;
  if (!parse_number(cell, value)) {
    throw InputError(
        lines_.file(), lines_.position(),
        "expected a number in column '" + column + "', found '" + std::string(cell) + "'");
  }
  return value;
}

double CsvReader::finite(const std::string& column) const {
  const double value = number(column);
  if (!std::isfinite(value)) {
    throw InputError(lines_.file(), lines_.position(),
                     "expected a finite number in column '" + column + "'");
  }
  return value;
}

}  // namespace understory
