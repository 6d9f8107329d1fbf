#include <algorithm>
#include <array>
#include <cstring>
#include <optional>

#include "understory/recording/clouds/cloud_table.h"
#include "understory/recording/clouds/text_lines.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"
#include "understory/util/files/csv.h"

namespace understory {
namespace {

constexpr std::uint64_t kMostPlyHeaderLines = 1024;
constexpr std::size_t kMostProperties = 1024;
constexpr std::uint64_t kMostPlyPoints = 0xFFFF'FFFF;

struct Property {
  std::string name;
  FieldType type = FieldType::kFloat32;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
  bool has_list = false;
  [[nodiscard]] std::uint64_t size() const {
    std::uint64_t bytes = 0;
    for (const Property& property : properties)
      bytes += field_size(property.type);
    return bytes;
  }
};

struct PlyHeader {
  std::string encoding;  // "ascii", "binary_little_endian", "binary_big_endian"
  std::vector<Element> elements;
  std::uint64_t position = 0;
};

std::optional<FieldType> type_of(std::string_view name) {
  struct Name {
    std::string_view name;
    FieldType type;
  };
  static constexpr std::array<Name, 16> kNames{{{"char", FieldType::kInt8},
                                                {"int8", FieldType::kInt8},
                                                {"uchar", FieldType::kUint8},
                                                {"uint8", FieldType::kUint8},
                                                {"short", FieldType::kInt16},
                                                {"int16", FieldType::kInt16},
                                                {"ushort", FieldType::kUint16},
                                                {"uint16", FieldType::kUint16},
                                                {"int", FieldType::kInt32},
                                                {"int32", FieldType::kInt32},
                                                {"uint", FieldType::kUint32},
                                                {"uint32", FieldType::kUint32},
                                                {"float", FieldType::kFloat32},
                                                {"float32", FieldType::kFloat32},
                                                {"double", FieldType::kFloat64},
                                                {"float64", FieldType::kFloat64}}};
  for (const Name& entry : kNames) {
    if (entry.name == name) return entry.type;
  }
  return std::nullopt;
}

// CloudCompare puts "scalar_" before the names of what is no coordinate.
std::string plain_name(std::string_view name) {
  constexpr std::string_view kPrefix = "scalar_";
  if (name.rfind(kPrefix, 0) == 0) name.remove_prefix(kPrefix.size());
  return std::string(name);
}

class PlyHeaderReader {
 public:
  explicit PlyHeaderReader(ByteSource& file) : file_(file), lines_(file) {}

  PlyHeader read() {
    std::string_view line;
    while (true) {
      if (!lines_.next(line) || lines_.number() > kMostPlyHeaderLines)
        fail("expected a PLY header that ends with end_header");
      const std::vector<std::string_view> words = split_words(line);
      if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
      if (words[0] == "end_header") break;
      take(words);
    }
    header_.position = lines_.position();
    if (header_.encoding.empty()) fail("expected a format line");
    return header_;
  }

 private:
  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError(file_.name(), "line " + std::to_string(lines_.number()), expected);
  }

  void take(const std::vector<std::string_view>& words) {
    if (words[0] == "format" && words.size() >= 2) {
      header_.encoding = words[1];
      if (header_.encoding != "ascii" && header_.encoding != "binary_little_endian" &&
          header_.encoding != "binary_big_endian")
        fail("expected the format ascii, binary_little_endian or binary_big_endian");
    } else if (words[0] == "element" && words.size() >= 3) {
      const auto count = to_count(words[2]);
      if (!count || *count > kMostPlyPoints) fail("expected a number of elements below 2^32");
      header_.elements.push_back({std::string(words[1]), *count, {}, false});
    } else if (words[0] == "property" && words.size() >= 3) {
      property(words);
    }
  }

  void property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) fail("expected an element before its properties");
    Element& element = header_.elements.back();
    if (words[1] == "list") {
      element.has_list = true;
      return;
    }
    const auto type = type_of(words[1]);
    if (!type || element.properties.size() >= kMostProperties)
      fail("expected a PLY type, found " + std::string(words[1].substr(0, 32)));
    element.properties.push_back({plain_name(words[2]), *type});
  }

  ByteSource& file_;
  TextLines lines_;
  PlyHeader header_;
};

void warn_short(const ByteSource& file, std::uint64_t have, std::uint64_t stated, Log& log) {
  report_finding(log, Finding::kDamage,
                 file.name() + ": at byte " + std::to_string(file.size()) + ": " +
                     std::to_string(have) + " of " + std::to_string(stated) + " points are there");
}

// Lines of the elements behind the vertices.
std::uint64_t rows_behind(const PlyHeader& header, const Element& vertex) {
  std::uint64_t rows = 0;
  for (const Element* element = &vertex + 1; element <= &header.elements.back(); ++element)
    rows += element->count;
  return rows;
}

// Bytes of the elements behind the vertices; nothing where only their lists tell.
std::optional<std::uint64_t> bytes_behind(const PlyHeader& header, const Element& vertex) {
  std::uint64_t bytes = 0;
  for (const Element* element = &vertex + 1; element <= &header.elements.back(); ++element) {
    if (element->has_list && element->count > 0) return std::nullopt;
    bytes += element->count * element->size();
  }
  return bytes;
}

void read_ascii(ByteSource& file, const PlyHeader& header, std::uint64_t skip,
                const Element& vertex, CloudTable& table, Log& log) {
  TextLines lines(file, header.position);
  std::string_view line;
  std::vector<std::string_view> words;
  std::uint64_t points = 0;
  while (points < vertex.count && lines.next(line)) {
    if (skip > 0) {
      --skip;
      continue;
    }
    split_words(line, words);
    if (words.empty()) continue;
    ++points;
    const std::size_t begin = table.data.size();
    table.data.resize(begin + table.point_step);
    bool good = words.size() >= table.fields.size();
    for (std::size_t f = 0; good && f < table.fields.size(); ++f) {
      const auto value = to_number(words[f]);
      good = value.has_value();
      if (good) {
        store_number(*value, table.fields[f].type,
                     table.data.data() + begin + table.fields[f].offset);
      }
    }
    if (good) continue;
    table.data.resize(begin);
    report_finding(log, Finding::kDamage,
                   file.name() + ": point " + std::to_string(points) + ": expected " +
                       std::to_string(table.fields.size()) + " numbers, left out");
  }
  if (points < vertex.count) warn_short(file, points, vertex.count, log);
  std::uint64_t behind = rows_behind(header, vertex);
  while (behind > 0 && lines.next(line)) {
    split_words(line, words);
    if (!words.empty()) --behind;
  }
  warn_of_surplus(file, lines, table.fields.size(), vertex.count, log);
}

}  // namespace

CloudTable read_ply(ByteSource& file, Log& log) {
  const PlyHeader header = PlyHeaderReader(file).read();
  const auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                                   [](const Element& e) { return e.name == "vertex"; });
  if (vertex == header.elements.end() || vertex->has_list || vertex->properties.empty())
    throw InputError(file.name(), "header", "expected an element vertex without lists");
  const bool ascii = header.encoding == "ascii";
  std::uint64_t skip = 0;  // what stands before the vertices: lines or bytes
  for (auto element = header.elements.begin(); element != vertex; ++element) {
    if (!ascii && element->has_list)
      throw InputError(file.name(), "header", "expected the vertices before elements with lists");
    skip += ascii ? element->count : element->count * element->size();
  }
  CloudTable table;
  table.format = "PLY " + header.encoding;
  table.big_endian = header.encoding == "binary_big_endian";
  for (const Property& property : vertex->properties)
    table.add_field(property.name, property.type);
  if (ascii) {
    read_ascii(file, header, skip, *vertex, table, log);
  } else {
    file.read(header.position + skip, vertex->count * table.point_step, table.data);
    const std::size_t whole = table.size();
    table.data.resize(whole * table.point_step);
    if (whole < vertex->count) warn_short(file, whole, vertex->count, log);
    if (const auto behind = bytes_behind(header, *vertex))
      warn_of_surplus(file, header.position + skip + table.data.size() + *behind, table, log);
  }
  table.width = static_cast<std::uint32_t>(table.size());
  if (table.size() == 0 && vertex->count > 0)
    throw InputError(file.name(), "byte " + std::to_string(header.position), "expected points");
  return table;
}

}  // namespace understory
