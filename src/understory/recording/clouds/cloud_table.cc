#include "understory/recording/clouds/cloud_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "understory/recording/finding.h"
#include "understory/util/error.h"

namespace understory {
namespace {

template <typename T>
void store(double value, std::uint8_t* into) {
  T number{};
  if constexpr (std::is_floating_point_v<T>) {
    number = static_cast<T>(value);
  } else if (!std::isnan(value)) {
    constexpr auto kLow = static_cast<double>(std::numeric_limits<T>::lowest());
    constexpr auto kHigh = static_cast<double>(std::numeric_limits<T>::max());
    number = static_cast<T>(std::clamp(value, kLow, kHigh));
  }
  std::memcpy(into, &number, sizeof(T));
}

bool ends_with(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

void store_number(double value, FieldType type, std::uint8_t* into) {
  visit_field_type(type, [&](auto zero) { store<decltype(zero)>(value, into); });
}

void CloudTable::add_field(const std::string& name, FieldType type, std::uint32_t count) {
  fields.push_back({name, point_step, type, count});
  point_step += field_size(type) * count;
}

namespace {

void report_surplus(const ByteSource& file, std::uint64_t position, std::uint64_t surplus,
                    std::uint64_t stated, Log& log) {
  report_finding(log, Finding::kDamage,
                 file.name() + ": at byte " + std::to_string(position) + ": " +
                     std::to_string(surplus) + " more points than the " + std::to_string(stated) +
                     " of the header, left out");
}

}  // namespace

void warn_of_surplus(ByteSource& file, std::uint64_t position, const CloudTable& table, Log& log) {
  if (position >= file.size()) return;
  const std::uint64_t surplus = (file.size() - position) / table.point_step;
  if (surplus == 0) return;
  std::vector<std::uint8_t> first;
  file.read(position, table.point_step, first);
  if (std::any_of(first.begin(), first.end(), [](std::uint8_t byte) { return byte != 0; }))
    report_surplus(file, position, surplus, table.size(), log);
}

void warn_of_surplus(ByteSource& file, TextLines& lines, std::size_t least, std::uint64_t stated,
                     Log& log) {
  const std::uint64_t position = lines.position();
  std::uint64_t surplus = 0;
  std::string_view line;
  std::vector<std::string_view> words;
  while (lines.next(line)) {
    split_words(line, words);
    surplus += words.size() >= least ? 1 : 0;
  }
  if (surplus > 0) report_surplus(file, position, surplus, stated, log);
}

PointCloud2Message CloudTable::message(TimeNs stamp) const {
  PointCloud2Message message;
  message.header.stamp = stamp;
  message.height = height;
  message.width = width;
  message.fields = fields;
  message.big_endian = big_endian;
  message.point_step = point_step;
  message.row_step = point_step * width;
  message.data = ByteSpan(data.data(), data.size());
  return message;
}

namespace {

// Whether the fourth numbers cannot be intensities, which are never below zero. Coordinates are so
// half the time, as where points of three or five numbers are read as points of four.
bool shows_other_point_size(const CloudTable& table, std::size_t points) {
  constexpr std::size_t kFewestPoints = 100;
  std::size_t below = 0;
  for (std::size_t i = 0; i < points; ++i) {
    float intensity = 0.0F;
    std::memcpy(&intensity, table.data.data() + i * table.point_step + 3 * sizeof(float),
                sizeof(intensity));
    below += intensity < 0.0F ? 1 : 0;
  }
  return points >= kFewestPoints && 10 * below > points;
}

}  // namespace

CloudTable read_kitti(ByteSource& file, Log& log) {
  CloudTable table;
  table.format = "KITTI bin";
  for (const char* name : {"x", "y", "z", "intensity"})
    table.add_field(name, FieldType::kFloat32);
  file.read(0, file.size(), table.data);
  const std::size_t whole = table.data.size() / table.point_step;
  std::size_t plausible = 0;
  for (std::size_t i = 0; i < whole; ++i) {
    std::array<float, 3> xyz;
    std::memcpy(xyz.data(), table.data.data() + i * table.point_step, sizeof(xyz));
    plausible += std::all_of(xyz.begin(), xyz.end(), [](float v) { return std::abs(v) < 1e4F; });
  }
  if (2 * plausible <= whole) {
    throw InputError(file.name(), "byte 0",
                     "expected a KITTI cloud: x, y, z, intensity as 32-bit floats");
  }
  if (shows_other_point_size(table, whole)) {
    throw InputError(file.name(), "byte 0",
                     "expected a KITTI cloud: x, y, z, intensity as 32-bit floats. Over a tenth of "
                     "the intensities are negative: its points have another size or order");
  }
  if (table.data.size() % table.point_step != 0) {
    report_finding(log, Finding::kDamage,
                   file.name() + ": at byte " + std::to_string(whole * table.point_step) +
                       ": the last point is not whole");
  }
  table.data.resize(whole * table.point_step);
  table.width = static_cast<std::uint32_t>(whole);
  return table;
}

CloudFormat cloud_format(ByteSource& file) {
  std::array<char, 256> head{};
  const std::size_t got =
      file.read(0, reinterpret_cast<std::uint8_t*>(head.data()), head.size() - 1);
  const std::string_view text(head.data(), got);
  if (text.rfind("LASF", 0) == 0) return CloudFormat::kLas;
  if (text.rfind("ASTM-E57", 0) == 0) return CloudFormat::kE57;
  if (text.rfind("ply\n", 0) == 0 || text.rfind("ply\r", 0) == 0) return CloudFormat::kPly;
  if (text.rfind("# .PCD", 0) == 0 || text.rfind("VERSION", 0) == 0 ||
      text.find("\nVERSION") != std::string_view::npos)
    return CloudFormat::kPcd;
  return ends_with(file.name(), ".bin") ? CloudFormat::kKitti : CloudFormat::kUnknown;
}

bool lzf_expand(ByteSpan in, std::vector<std::uint8_t>& out, std::size_t& made) {
  constexpr std::size_t kLiteralRuns = 32;
  std::size_t at = 0;
  made = 0;
  while (at < in.size()) {
    const std::size_t control = in[at++];
    if (control < kLiteralRuns) {
      const std::size_t run = control + 1;
      if (run > in.size() - at || run > out.size() - made) return false;
      std::memcpy(out.data() + made, in.data() + at, run);
      at += run;
      made += run;
      continue;
    }
    std::size_t length = control >> 5;
    if (length == 7) {
      if (at >= in.size()) return false;
      length += in[at++];
    }
    length += 2;
    if (at >= in.size()) return false;
    const std::size_t back = ((control & 0x1F) << 8) + in[at++] + 1;
    if (back > made || length > out.size() - made) return false;
    for (std::size_t i = 0; i < length; ++i, ++made)  // source and target may overlap
      out[made] = out[made - back];
  }
  return made == out.size();
}

}  // namespace understory
