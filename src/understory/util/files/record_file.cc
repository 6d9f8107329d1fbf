#include "understory/util/files/record_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/output_file.h"

namespace understory {
namespace {

struct Head {
  std::uint32_t length = 0;
  std::uint32_t checksum = 0;
};

// Of the place, the length and the bytes: a record that stands where another belongs is none.
class Checksum {
 public:
  Checksum(std::uint64_t record, std::uint32_t length) {
    const std::array<std::uint64_t, 2> place{record, length};
    add(bytes_of(place));
  }
  void add(RecordFile::Bytes bytes) { value_ = crc32_of(bytes, value_); }
  [[nodiscard]] std::uint32_t value() const { return value_; }

 private:
  std::uint32_t value_ = 0;
};

std::uint64_t next_digest(std::uint64_t digest, std::uint32_t checksum) {
  return crc32_of(bytes_of(checksum), static_cast<std::uint32_t>(digest));
}

[[noreturn]] void damaged(const std::filesystem::path& path, std::uint64_t offset,
                          std::uint64_t record) {
  throw InputError(path.string(), "at byte " + std::to_string(offset),
                   "record " + std::to_string(record) + " is missing or damaged");
}

[[noreturn]] void cannot_write(const std::filesystem::path& path, int code) {
  throw OutputError(path.string(), std::string("cannot be written: ") + std::strerror(code));
}

// The whole count, or less at the end of the file.
std::size_t read_at(int file, std::uint64_t offset, void* into, std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::pread(file, static_cast<char*>(into) + done, count - done,
                                static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

// One record of an open file, whose bytes end at `end`.
Head head_at(int file, const std::filesystem::path& path, std::uint64_t record,
             std::uint64_t offset, std::uint64_t end) {
  Head head;
  if (offset > end || end - offset < sizeof(head) ||
      read_at(file, offset, &head, sizeof(head)) != sizeof(head) ||
      head.length > end - offset - sizeof(head)) {
    damaged(path, offset, record);
  }
  return head;
}

void read_record(int file, const std::filesystem::path& path, std::uint64_t record,
                 std::uint64_t offset, const Head& head, std::vector<std::uint8_t>& bytes) {
  bytes.resize(head.length);
  Checksum checksum(record, head.length);
  if (read_at(file, offset + sizeof(head), bytes.data(), bytes.size()) != bytes.size())
    damaged(path, offset, record);
  checksum.add(bytes);
  if (checksum.value() != head.checksum) damaged(path, offset, record);
}

using VisitHead = std::function<void(std::uint64_t record, std::uint64_t offset, const Head& head)>;

// Walks over the heads of what is known.
void walk(int file, const std::filesystem::path& path, const RecordCount& known,
          const VisitHead& visit) {
  struct stat status {};
  if (::fstat(file, &status) != 0 || static_cast<std::uint64_t>(status.st_size) < known.bytes) {
    throw InputError(path.string(), "",
                     "is shorter than its checkpoint says (" + std::to_string(known.bytes) + ")");
  }
  std::uint64_t digest = 0;
  std::uint64_t offset = 0;
  for (std::uint64_t record = 0; record < known.records; ++record) {
    const Head head = head_at(file, path, record, offset, known.bytes);
    visit(record, offset, head);
    digest = next_digest(digest, head.checksum);
    offset += sizeof(head) + head.length;
  }
  if (offset != known.bytes || digest != known.digest)
    throw InputError(path.string(), "", "holds other records than its checkpoint says");
}

void walk_checked(int file, const std::filesystem::path& path, const RecordCount& known,
                  const RecordFile::Visit& visit) {
  std::vector<std::uint8_t> bytes;
  walk(file, path, known, [&](std::uint64_t record, std::uint64_t offset, const Head& head) {
    read_record(file, path, record, offset, head, bytes);
    visit(offset, bytes);
  });
}

class Descriptor {
 public:
  Descriptor(const std::filesystem::path& path, int flags)
      : value_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return value_; }
  [[nodiscard]] int release() { return std::exchange(value_, -1); }

 private:
  int value_;
};

}  // namespace

RecordFile::RecordFile(std::filesystem::path path) : path_(std::move(path)) {
  Descriptor file(path_, O_RDWR | O_CREAT | O_TRUNC);
  if (file.get() < 0) cannot_write(path_, errno);
  descriptor_ = file.release();
  synced_ = false;
}

RecordFile::RecordFile(std::filesystem::path path, const RecordCount& known,
                       std::vector<std::uint64_t>* offsets)
    : path_(std::move(path)), count_(known) {
  Descriptor file(path_, O_RDWR);
  if (file.get() < 0) throw InputError(path_.string(), "", std::strerror(errno));
  walk(file.get(), path_, known, [&](std::uint64_t, std::uint64_t offset, const Head&) {
    if (offsets != nullptr) offsets->push_back(offset);
  });
  if (::ftruncate(file.get(), static_cast<off_t>(known.bytes)) != 0) cannot_write(path_, errno);
  descriptor_ = file.release();
}

RecordFile::RecordFile(RecordFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      count_(other.count_),
      synced_(other.synced_),
      failed_(other.failed_) {}

RecordFile::~RecordFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::uint64_t RecordFile::append(std::initializer_list<Bytes> parts) {
  UNDERSTORY_CHECK(!failed_);
  std::uint64_t length = 0;
  for (const Bytes& part : parts)
    length += part.size();
  UNDERSTORY_CHECK(length <= UINT32_MAX);
  Checksum checksum(count_.records, static_cast<std::uint32_t>(length));
  for (const Bytes& part : parts)
    checksum.add(part);
  const Head head{static_cast<std::uint32_t>(length), checksum.value()};
  std::vector<Bytes> pieces{bytes_of(head)};
  pieces.insert(pieces.end(), parts.begin(), parts.end());
  std::uint64_t at = count_.bytes;
  failed_ = true;
  synced_ = false;
  for (Bytes piece : pieces) {
    while (!piece.empty()) {
      const ssize_t written =
          ::pwrite(descriptor_, piece.data(), piece.size(), static_cast<off_t>(at));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) cannot_write(path_, errno);
      at += static_cast<std::uint64_t>(written);
      piece = piece.subspan(static_cast<std::size_t>(written));
    }
  }
  failed_ = false;
  const std::uint64_t offset = count_.bytes;
  count_ = {count_.records + 1, at, next_digest(count_.digest, head.checksum)};
  return offset;
}

void RecordFile::sync() {
  if (synced_) return;
  // What one failed sync has dropped, a second one would not tell of.
  UNDERSTORY_CHECK(!failed_);
  failed_ = true;
  if (::fdatasync(descriptor_) != 0 && errno != EINVAL && errno != EROFS)
    cannot_write(path_, errno);
  failed_ = false;
  synced_ = true;
}

std::vector<std::uint8_t> RecordFile::read(std::uint64_t record, std::uint64_t offset) const {
  std::vector<std::uint8_t> bytes;
  read_record(descriptor_, path_, record, offset,
              head_at(descriptor_, path_, record, offset, count_.bytes), bytes);
  return bytes;
}

void RecordFile::for_each(const Visit& visit) const {
  walk_checked(descriptor_, path_, count_, visit);
}

void for_each_record(const std::filesystem::path& path, const RecordCount& known,
                     const RecordFile::Visit& visit) {
  const Descriptor file(path, O_RDONLY);
  if (file.get() < 0) throw InputError(path.string(), "", std::strerror(errno));
  walk_checked(file.get(), path, known, visit);
}

}  // namespace understory
