#include "understory/recording/bags/byte_source.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/read_error.h"

namespace understory {
namespace {

class FileSource : public ByteSource {
 public:
  FileSource(const std::string& path, std::string name) : path_(std::move(name)) {
    descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (descriptor_ < 0) throw InputError(path_, "", std::strerror(errno));
    struct stat status {};
    if (::fstat(descriptor_, &status) != 0 || !S_ISREG(status.st_mode)) {
      ::close(descriptor_);
      throw InputError(path_, "", "expected a plain file");
    }
    size_ = static_cast<std::uint64_t>(status.st_size);
  }
  ~FileSource() override { ::close(descriptor_); }
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;

  // Small reads are served from a window, so that walking from record to record costs few calls.
  std::size_t read(std::uint64_t offset, std::uint8_t* into, std::size_t count) override {
    if (count > kWindow / 4) return read_direct(offset, into, count, count);
    if (offset < window_offset_ || offset + count > window_offset_ + window_.size()) {
      std::vector<std::uint8_t> window = std::move(window_);  // none if it cannot be read
      window_ = {};
      window.resize(kWindow);
      window.resize(read_direct(offset, window.data(), kWindow, count));
      window_ = std::move(window);
      window_offset_ = offset;
    }
    const std::size_t there = window_.size() - static_cast<std::size_t>(offset - window_offset_);
    count = std::min(count, there);
    if (count > 0) std::memcpy(into, window_.data() + (offset - window_offset_), count);
    return count;
  }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  [[nodiscard]] const std::string& name() const override { return path_; }

 private:
  static constexpr std::size_t kWindow = 1U << 16;

  // What lies behind the `wanted` bytes may be unreadable.
  std::size_t read_direct(std::uint64_t offset, std::uint8_t* into, std::size_t count,
                          std::size_t wanted) const {
    std::size_t done = 0;
    while (done < count) {
      const ssize_t got =
          ::pread(descriptor_, into + done, count - done, static_cast<off_t>(offset + done));
      if (got < 0 && errno == EINTR) continue;
      if (got < 0 && done < wanted)
        throw ReadError(path_, "at byte " + std::to_string(offset + done), errno);
      if (got <= 0) break;
      done += static_cast<std::size_t>(got);
    }
    return done;
  }

  std::string path_;  // for messages
  int descriptor_ = -1;
  std::uint64_t size_ = 0;
  std::vector<std::uint8_t> window_;
  std::uint64_t window_offset_ = 0;
};

class MemorySource : public ByteSource {
 public:
  MemorySource(std::vector<std::uint8_t> bytes, std::string name)
      : bytes_(std::move(bytes)), name_(std::move(name)) {}
  std::size_t read(std::uint64_t offset, std::uint8_t* into, std::size_t count) override {
    if (offset >= bytes_.size()) return 0;
    count = std::min<std::size_t>(count, bytes_.size() - static_cast<std::size_t>(offset));
    if (count > 0) std::memcpy(into, bytes_.data() + offset, count);
    return count;
  }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  [[nodiscard]] const std::string& name() const override { return name_; }

 private:
  std::vector<std::uint8_t> bytes_;
  std::string name_;
};

}  // namespace

void ByteSource::read(std::uint64_t offset, std::uint64_t count, std::vector<std::uint8_t>& into) {
  const std::uint64_t there = offset < size() ? size() - offset : 0;
  into.resize(static_cast<std::size_t>(std::min(count, there)));
  into.resize(read(offset, into.data(), into.size()));
}

std::unique_ptr<ByteSource> open_file(const std::string& path) {
  return std::make_unique<FileSource>(path, path);
}

std::unique_ptr<ByteSource> open_file(const std::string& path, std::string name) {
  return std::make_unique<FileSource>(path, std::move(name));
}

std::unique_ptr<ByteSource> bytes_in_memory(std::vector<std::uint8_t> bytes, std::string name) {
  return std::make_unique<MemorySource>(std::move(bytes), std::move(name));
}

}  // namespace understory
