#include <algorithm>
#include <cstring>
#include <optional>

#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/clouds/text_lines.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr std::size_t kMostFields = 256;
constexpr std::uint64_t kMostHeaderLines = 64;
constexpr std::uint64_t kLargestStep = 65'536;
constexpr std::uint64_t kMostPoints = 0xFFFF'FFFF;

struct PcdField {
  std::string name;
  std::uint64_t size = 4;
  char type = 'F';
  std::uint64_t count = 1;
};

struct PcdHeader {
  std::vector<PcdField> fields;
  std::uint64_t width = 0;
  std::uint64_t height = 1;
  std::uint64_t points = 0;
  std::string data;            // "ascii", "binary", "binary_compressed"
  std::uint64_t position = 0;  // of the points
};

class HeaderReader {
 public:
  HeaderReader(ByteSource& file) : file_(file), lines_(file) {}

  PcdHeader read() {
    std::string_view line;
    while (header_.data.empty()) {
      if (!lines_.next(line) || lines_.number() > kMostHeaderLines)
        fail("expected a PCD header that ends with a DATA line");
      if (line.empty() || line.front() == '#') continue;
      take(split_words(line));
    }
    header_.position = lines_.position();
    check();
    return header_;
  }

 private:
  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError(file_.name(), "line " + std::to_string(lines_.number()), expected);
  }

  void take(const std::vector<std::string_view>& words) {
    if (words.size() < 2) return;
    const std::string_view key = words[0];
    if (key == "FIELDS" || key == "COLUMNS") {
      if (words.size() - 1 > kMostFields) fail("expected at most 256 fields");
      for (std::size_t i = 1; i < words.size(); ++i)
        header_.fields.push_back({std::string(words[i])});
    } else if (key == "TYPE") {
      for_each(words, [&](PcdField& field, std::string_view word) { field.type = word[0]; });
    } else if (key == "SIZE") {
      for_each(words, [&](PcdField& field, std::string_view word) { field.size = count(word); });
    } else if (key == "COUNT") {
      for_each(words, [&](PcdField& field, std::string_view word) { field.count = count(word); });
    } else if (key == "WIDTH") {
      header_.width = count(words[1]);
    } else if (key == "HEIGHT") {
      header_.height = count(words[1]);
    } else if (key == "POINTS") {
      header_.points = count(words[1]);
    } else if (key == "DATA") {
      header_.data = words[1];
    }
  }

  template <typename Set>
  void for_each(const std::vector<std::string_view>& words, Set&& set) {
    if (words.size() - 1 != header_.fields.size())
      fail("expected one value for each of the FIELDS");
    for (std::size_t i = 0; i < header_.fields.size(); ++i)
      set(header_.fields[i], words[i + 1]);
  }

  std::uint64_t count(std::string_view word) const {
    const auto value = to_count(word);
    if (!value) fail("expected a whole number, found " + std::string(word.substr(0, 32)));
    return *value;
  }

  void check() const {
    std::uint64_t step = 0;
    for (const PcdField& field : header_.fields) {
      const bool known = field.type == 'F' ? field.size == 4 || field.size == 8
                                           : (field.type == 'I' || field.type == 'U') &&
                                                 (field.size == 1 || field.size == 2 ||
                                                  field.size == 4 || field.size == 8);
      if (!known || field.count > kLargestStep) fail("expected a PCD type for " + field.name);
      step += field.size * field.count;
    }
    if (header_.fields.empty() || step == 0 || step > kLargestStep)
      fail("expected FIELDS with their SIZE and TYPE");
    if (header_.data != "ascii" && header_.data != "binary" && header_.data != "binary_compressed")
      fail("expected DATA ascii, binary or binary_compressed");
    if (header_.points > kMostPoints || header_.width > kMostPoints || header_.height > kMostPoints)
      fail("expected fewer than 2^32 points");
  }

  ByteSource& file_;
  TextLines lines_;
  PcdHeader header_;
};

// 64-bit integers, which tables do not have, are read as doubles.
std::optional<FieldType> table_type(const PcdField& field) {
  if (field.type == 'F') return field.size == 4 ? FieldType::kFloat32 : FieldType::kFloat64;
  const bool is_signed = field.type == 'I';
  switch (field.size) {
    case 1:
      return is_signed ? FieldType::kInt8 : FieldType::kUint8;
    case 2:
      return is_signed ? FieldType::kInt16 : FieldType::kUint16;
    case 4:
      return is_signed ? FieldType::kInt32 : FieldType::kUint32;
    default:
      return std::nullopt;
  }
}

void add_fields(const PcdHeader& header, CloudTable& table) {
  for (const PcdField& field : header.fields) {
    table.add_field(field.name, table_type(field).value_or(FieldType::kFloat64),
                    static_cast<std::uint32_t>(field.count));
  }
}

void integers_to_doubles(const PcdHeader& header, CloudTable& table) {
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    const PcdField& field = header.fields[f];
    if (table_type(field)) continue;
    for (std::size_t i = 0; i < table.size(); ++i) {
      for (std::size_t k = 0; k < field.count; ++k) {
        std::uint8_t* raw =
            table.data.data() + i * table.point_step + table.fields[f].offset + 8 * k;
        std::int64_t value = 0;
        std::memcpy(&value, raw, 8);
        const double number = field.type == 'I'
                                  ? static_cast<double>(value)
                                  : static_cast<double>(static_cast<std::uint64_t>(value));
        std::memcpy(raw, &number, 8);
      }
    }
  }
}

void warn_short(const ByteSource& file, std::uint64_t position, std::uint64_t have,
                std::uint64_t stated, Log& log) {
  report_finding(log, Finding::kDamage,
                 file.name() + ": at byte " + std::to_string(position) + ": " +
                     std::to_string(have) + " of " + std::to_string(stated) + " points are there");
}

void read_binary(ByteSource& file, const PcdHeader& header, CloudTable& table, Log& log) {
  file.read(header.position, header.points * table.point_step, table.data);
  const std::size_t whole = table.size();
  table.data.resize(whole * table.point_step);
  warn_of_surplus(file, header.position + table.data.size(), table, log);
  if (whole < header.points) warn_short(file, file.size(), whole, header.points, log);
  integers_to_doubles(header, table);
}

// Field by field for all points, then compressed. What can be expanded of damaged data lacks the
// last fields, so that only whole x, y and z columns are of use.
void read_compressed(ByteSource& file, const PcdHeader& header, CloudTable& table, Log& log) {
  constexpr std::uint64_t kBestRatio = 133;  // 264 bytes from 2 or 3
  std::vector<std::uint8_t> sizes;
  file.read(header.position, 8, sizes);
  std::uint32_t compressed_size = 0;
  std::uint32_t size = 0;
  if (sizes.size() == 8) {
    std::memcpy(&compressed_size, sizes.data(), 4);
    std::memcpy(&size, sizes.data() + 4, 4);
  }
  std::vector<std::uint8_t> compressed;
  file.read(header.position + 8, compressed_size, compressed);
  if (size != header.points * table.point_step || size > compressed.size() * kBestRatio) {
    throw InputError(file.name(), "byte " + std::to_string(header.position),
                     "expected compressed points of the size that the header states");
  }
  std::vector<std::uint8_t> columns(size);
  std::size_t made = 0;
  if (!lzf_expand(compressed, columns, made)) {
    report_finding(log, Finding::kDamage,
                   file.name() + ": at byte " + std::to_string(header.position + 8) +
                       ": damaged compressed data; columns that are missing are 0");
  }
  table.data.assign(size, 0);
  std::size_t from = 0;
  for (std::size_t f = 0; f < header.fields.size(); ++f) {
    const std::size_t bytes = header.fields[f].size * header.fields[f].count;
    for (std::size_t i = 0; i < header.points; ++i, from += bytes) {
      if (from + bytes > made) break;
      std::memcpy(table.data.data() + i * table.point_step + table.fields[f].offset,
                  columns.data() + from, bytes);
    }
    from = std::min<std::size_t>(from, columns.size());
  }
  integers_to_doubles(header, table);
}

void read_ascii(ByteSource& file, const PcdHeader& header, CloudTable& table, Log& log) {
  std::size_t words_per_point = 0;
  for (const PcdField& field : header.fields)
    words_per_point += field.count;
  TextLines lines(file, header.position);
  std::string_view line;
  std::vector<std::string_view> words;
  std::uint64_t points = 0;
  while (points < header.points && lines.next(line)) {
    split_words(line, words);
    if (words.empty()) continue;
    ++points;
    const std::size_t begin = table.data.size();
    table.data.resize(begin + table.point_step);
    bool good = words.size() == words_per_point;
    std::size_t word = 0;
    for (std::size_t f = 0; good && f < table.fields.size(); ++f) {
      const CloudField& field = table.fields[f];
      for (std::uint32_t k = 0; good && k < field.count; ++k) {
        const auto value = to_number(words[word++]);
        good = value.has_value();
        if (good) {
          store_number(*value, field.type,
                       table.data.data() + begin + field.offset + k * field_size(field.type));
        }
      }
    }
    if (good) continue;
    table.data.resize(begin);
    report_finding(log, Finding::kDamage,
                   file.name() + ": point " + std::to_string(points) + ": expected " +
                       std::to_string(words_per_point) + " numbers, left out");
  }
  if (points < header.points) warn_short(file, file.size(), points, header.points, log);
  warn_of_surplus(file, lines, words_per_point, header.points, log);
}

}  // namespace

CloudTable read_pcd(ByteSource& file, Log& log) {
  PcdHeader header = HeaderReader(file).read();
  if (header.points == 0) header.points = std::min(header.width * header.height, kMostPoints);
  CloudTable table;
  table.format = "PCD " + header.data;
  add_fields(header, table);
  if (header.data == "ascii") {
    read_ascii(file, header, table, log);
  } else if (header.data == "binary") {
    read_binary(file, header, table, log);
  } else {
    read_compressed(file, header, table, log);
  }
  const bool organised =
      header.height > 1 && header.width * header.height == table.size() && table.size() > 0;
  table.width = static_cast<std::uint32_t>(organised ? header.width : table.size());
  table.height = static_cast<std::uint32_t>(organised ? header.height : 1);
  if (table.size() == 0 && header.points > 0)
    throw InputError(file.name(), "byte " + std::to_string(header.position), "expected points");
  return table;
}

}  // namespace understory
