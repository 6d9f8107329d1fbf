#include "understory/pipeline/mapping/dense/fix_file.h"

#include "understory/sensor/sensor_io.h"
#include "understory/util/files/binary_io.h"

namespace understory {

void FixFile::go_on(const RecordCount& known) {
  if (known.records > 0) file_ = std::make_unique<RecordFile>(path_, known);
}

void FixFile::append(const std::vector<GnssFix>& fixes) {
  if (fixes.empty()) return;
  if (!file_) file_ = std::make_unique<RecordFile>(path_);
  for (const GnssFix& fix : fixes) {
    BinaryWriter record;
    put_fix(record, fix);
    file_->append({bytes_of(record.bytes())});
  }
}

void FixFile::sync() {
  if (file_) file_->sync();
}

std::vector<GnssFix> FixFile::read() const {
  std::vector<GnssFix> fixes;
  if (!file_) return fixes;
  fixes.reserve(size());
  file_->for_each([&](std::uint64_t /*offset*/, RecordFile::Bytes bytes) {
    BinaryReader record({bytes.begin(), bytes.end()}, path_.string());
    fixes.push_back(get_fix(record));
  });
  return fixes;
}

}  // namespace understory
