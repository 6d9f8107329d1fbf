#include "understory/simulation/scene/scan_cache.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "understory/recording/bags/compression.h"
#include "understory/util/error.h"

namespace understory {
namespace {

constexpr std::uint64_t kMagic = 0x3130534552494c55ULL;  // at the start of every record

struct RecordHead {
  std::uint64_t magic = kMagic;
  std::int64_t scan = 0;
  std::uint64_t checksum = 0;  // of the packed bytes
  std::uint32_t size = 0;      // of the packed bytes
  std::uint32_t reserved = 0;
};

std::uint64_t checksum_of(ByteSpan bytes) {
  std::uint64_t sum = bytes.size();
  for (std::size_t i = 0; i < bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, std::min<std::size_t>(8, bytes.size() - i));
    sum = (sum ^ word) * 0x9e3779b97f4a7c15ULL;
    sum ^= sum >> 29;
  }
  return sum;
}

template <typename T>
void append(std::vector<std::uint8_t>& bytes, const T& value) {
  const std::size_t at = bytes.size();
  bytes.resize(at + sizeof(T));
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

// Low bytes, high bytes and intensities apart, which packs better.
std::vector<std::uint8_t> flatten(const ScanReadings& readings, float step_m) {
  std::vector<std::uint8_t> bytes;
  const std::size_t count = readings.beams.size();
  append(bytes, static_cast<std::uint64_t>(count));
  append(bytes, static_cast<std::uint64_t>(readings.stems.size()));
  std::vector<std::uint8_t> planes(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto steps = static_cast<std::uint16_t>(std::lround(readings.beams[i].range_m / step_m));
    planes[i] = static_cast<std::uint8_t>(steps & 0xff);
    planes[count + i] = static_cast<std::uint8_t>(steps >> 8);
    planes[2 * count + i] = static_cast<std::uint8_t>(readings.beams[i].intensity);
  }
  bytes.insert(bytes.end(), planes.begin(), planes.end());
  for (const StemReturns& stem : readings.stems)
    append(bytes, stem);
  return bytes;
}

std::optional<ScanReadings> unflatten(ByteSpan bytes, float step_m) {
  ByteReader reader(bytes);
  const auto count = reader.get<std::uint64_t>();
  const auto stems = reader.get<std::uint64_t>();
  if (bytes.size() != 16 + 3 * count + stems * sizeof(StemReturns)) return std::nullopt;
  ScanReadings readings;
  readings.beams.resize(count);
  const std::uint8_t* planes = bytes.data() + 16;
  for (std::size_t i = 0; i < count; ++i) {
    const auto steps = static_cast<float>(planes[i] | planes[count + i] << 8);
    readings.beams[i] = {steps * step_m, static_cast<float>(planes[2 * count + i])};
  }
  readings.stems.resize(stems);
  if (stems > 0) {
    std::memcpy(readings.stems.data(), planes + 3 * count, stems * sizeof(StemReturns));
  }
  return readings;
}

// An empty file and one that breaks off within the first mark are.
bool begins_as_ours(int file, std::int64_t length) {
  std::uint64_t magic = 0;
  const auto size = static_cast<std::size_t>(std::clamp<std::int64_t>(length, 0, sizeof(magic)));
  return ::pread(file, &magic, size, 0) == static_cast<ssize_t>(size) &&
         std::memcmp(&magic, &kMagic, size) == 0;
}

}  // namespace

bool ScanCache::fits(const LidarConfig& config) {
  return config.returns == 1 && config.range_step_m > 0.0 &&
         config.max_range_m / config.range_step_m < 65535.0;
}

ScanCache::ScanCache(const std::string& folder, std::uint64_t key, double range_step_m)
    : path_(folder + fmt::format("/{:016x}.scans", key)),
      step_m_(static_cast<float>(range_step_m)) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw OutputError(folder, "cannot be made: " + error.message());
  file_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file_ < 0) {
    file_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  } else {
    writable_ = ::flock(file_, LOCK_EX | LOCK_NB) == 0;
  }
  read_index();
}

ScanCache::~ScanCache() {
  if (file_ >= 0) ::close(file_);
}

void ScanCache::read_index() {
  places_.clear();
  end_ = 0;
  if (file_ < 0) return;
  const std::int64_t length = ::lseek(file_, 0, SEEK_END);
  foreign_ = !begins_as_ours(file_, length);
  if (foreign_) {
    writable_ = false;
    return;
  }
  RecordHead head;
  while (::pread(file_, &head, sizeof(head), end_) == static_cast<ssize_t>(sizeof(head))) {
    const std::int64_t next = end_ + static_cast<std::int64_t>(sizeof(head)) + head.size;
    if (head.magic != kMagic || next > length) break;
    add(head.scan, end_ + static_cast<std::int64_t>(sizeof(head)), head.size, head.checksum);
    end_ = next;
  }
  if (writable_ && end_ < length && ::ftruncate(file_, end_) != 0) writable_ = false;
}

std::vector<ScanCache::Place>::const_iterator ScanCache::place_of(std::int64_t scan) const {
  return std::lower_bound(
      places_.begin(), places_.end(), scan,
      [](const Place& place, std::int64_t wanted) { return place.scan < wanted; });
}

// Of a scan that is there already the later one counts.
void ScanCache::add(std::int64_t scan, std::int64_t offset, std::uint32_t size,
                    std::uint64_t checksum) {
  const Place place{scan, offset, size, checksum};
  const auto at = places_.begin() + (place_of(scan) - places_.cbegin());
  if (at != places_.end() && at->scan == scan) {
    *at = place;
  } else {
    places_.insert(at, place);
  }
}

std::optional<ScanReadings> ScanCache::find(std::int64_t scan) const {
  const auto found = place_of(scan);
  if (found == places_.end() || found->scan != scan) return std::nullopt;
  const Place& place = *found;
  std::vector<std::uint8_t> packed(place.size);
  if (::pread(file_, packed.data(), packed.size(), place.offset) !=
      static_cast<ssize_t>(packed.size())) {
    return std::nullopt;
  }
  if (checksum_of(packed) != place.checksum) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  if (!decompress(packed, "zstd", kLongestBlock, bytes).empty()) return std::nullopt;
  return unflatten(bytes, step_m_);
}

void ScanCache::store(std::int64_t scan, const ScanReadings& readings) {
  if (!writable_) return;
  if (const auto kept = place_of(scan); kept != places_.end() && kept->scan == scan) return;
  const std::vector<std::uint8_t> packed = compress(flatten(readings, step_m_), "zstd", 1);
  RecordHead head;
  head.scan = scan;
  head.checksum = checksum_of(packed);
  head.size = static_cast<std::uint32_t>(packed.size());
  std::vector<std::uint8_t> record;
  append(record, head);
  record.insert(record.end(), packed.begin(), packed.end());
  if (::pwrite(file_, record.data(), record.size(), end_) != static_cast<ssize_t>(record.size())) {
    writable_ = false;  // full disk: what is torn lies behind the end and is cut off next time
    return;
  }
  add(scan, end_ + static_cast<std::int64_t>(sizeof(head)), head.size, head.checksum);
  end_ += static_cast<std::int64_t>(record.size());
}

std::optional<std::pair<std::int64_t, std::int64_t>> ScanCache::span() const {
  if (places_.empty()) return std::nullopt;
  return std::pair(places_.front().scan, places_.back().scan);
}

void ScanCache::clear() {
  places_.clear();
  end_ = 0;
  if (writable_ && ::ftruncate(file_, 0) != 0) writable_ = false;
}

}  // namespace understory
