#include "understory/util/files/output_file.h"

#include <fcntl.h>
#include <libdeflate.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "understory/util/error.h"

namespace understory {

OutputFile::OutputFile(std::string path) : path_(std::move(path)) {
  descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (descriptor_ < 0) fail();
}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void OutputFile::fail() {
  if (error_ == 0) error_ = errno;
  throw OutputError(path_, std::string("cannot be written: ") + std::strerror(error_));
}

void OutputFile::write(std::span<const std::uint8_t> bytes) {
  if (error_ != 0) fail();  // nothing may follow a record that is there only in part
  crc_ = crc32_of(bytes, crc_);
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      fail();
    }
    size_ += static_cast<std::uint64_t>(written);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
}

void OutputFile::close() {
  if (error_ != 0) fail();
  // Some places (pipes, /dev/full) cannot be synced; what matters there was told by write.
  if (::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) fail();
  close_unsynced();
}

void OutputFile::close_unsynced() {
  if (error_ != 0) fail();
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) fail();
}

std::uint32_t crc32_of(std::span<const std::uint8_t> bytes, std::uint32_t start) {
  if (bytes.empty()) return start;  // libdeflate takes no bytes at no place for a beginning
  // It uses the processor's carry-less multiplication: ten times as fast as zlib 1.2.
  return ::libdeflate_crc32(start, bytes.data(), bytes.size());
}

}  // namespace understory
