#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/clouds/text_lines.h"
#include "understory/recording/messages/message_decode.h"
#include "understory/util/log.h"

namespace understory {

// The points of a cloud file as they lie in it: fields by name and one row of bytes per point. The
// same thing as the body of a PointCloud2 message, so that fields and times are recognised by the
// same code.
struct CloudTable {
  std::vector<CloudField> fields;
  std::uint32_t point_step = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 1;
  bool big_endian = false;
  std::vector<std::uint8_t> data;
  std::string format;  // "PCD binary"

  // Appends a field behind those that are there.
  void add_field(const std::string& name, FieldType type, std::uint32_t count = 1);
  [[nodiscard]] std::size_t size() const { return point_step == 0 ? 0 : data.size() / point_step; }
  // A view: valid as long as the table.
  [[nodiscard]] PointCloud2Message message(TimeNs stamp) const;
};

// Warns of points behind those that the header states, "recording.damaged". The first looks at
// records of `point_step` bytes from `position` on; zeros there are padding. The second counts the
// lines with `least` words and more up to the end.
void warn_of_surplus(ByteSource& file, std::uint64_t position, const CloudTable& table, Log& log);
void warn_of_surplus(ByteSource& file, TextLines& lines, std::size_t least, std::uint64_t stated,
                     Log& log);

// Writes a number as the field's type; out of range values are clamped, NaN in an integer is 0.
void store_number(double value, FieldType type, std::uint8_t* into);

// Readers of one format each. They throw InputError if the header cannot be used or no point can be
// had. Where only a part of the points is there or readable, that part is given with a warning
// ("recording.damaged").
[[nodiscard]] CloudTable read_pcd(ByteSource& file, Log& log);
[[nodiscard]] CloudTable read_ply(ByteSource& file, Log& log);
// x, y, z, intensity as float32 without a header, as the KITTI data sets have it.
[[nodiscard]] CloudTable read_kitti(ByteSource& file, Log& log);

// Formats of files that hold one cloud.
enum class CloudFormat { kUnknown, kPcd, kPly, kLas, kE57, kKitti };
// By the first bytes; KITTI, which has no header, by the name's end (.bin).
[[nodiscard]] CloudFormat cloud_format(ByteSource& file);

// Expands LibLZF data, as PCD's binary_compressed has it. False if it is damaged or does not make
// exactly `into.size()` bytes; what was made until then stays in `into`, `made` bytes of it.
[[nodiscard]] bool lzf_expand(ByteSpan compressed, std::vector<std::uint8_t>& into,
                              std::size_t& made);

}  // namespace understory
