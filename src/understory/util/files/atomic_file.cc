#include "understory/util/files/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <system_error>
#include <utility>

#include "understory/util/error.h"
#include "understory/util/files/durable.h"
#include "understory/util/files/output_file.h"

namespace understory {
namespace {

constexpr std::size_t kBuffer = 1U << 20;

// The message names the file that the user asked for, not the temporary one.
template <typename Work>
void with_name_of(const std::filesystem::path& path, const Work& work) {
  try {
    work();
  } catch (const OutputError& error) {
    const std::string text = error.what();
    const std::string file = error.file() + ": ";
    throw OutputError(path.string(),
                      text.rfind(file, 0) == 0 ? text.substr(file.size()) : std::string(text));
  }
}

}  // namespace

struct AtomicFile::Impl {
  explicit Impl(const std::string& path) : file(path) {}
  OutputFile file;
};

AtomicFile::AtomicFile(std::filesystem::path path) : path_(std::move(path)) {
  with_name_of(path_, [&] { impl_ = std::make_unique<Impl>(part_path(path_).string()); });
}

AtomicFile::~AtomicFile() {
  if (impl_ == nullptr) return;
  impl_.reset();
  std::error_code ignored;
  std::filesystem::remove(part_path(path_), ignored);
}

void AtomicFile::write(std::string_view bytes) {
  UNDERSTORY_CHECK(impl_ != nullptr);
  with_name_of(path_, [&] {
    impl_->file.write({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  });
}

void AtomicFile::commit() {
  UNDERSTORY_CHECK(impl_ != nullptr);
  with_name_of(path_, [&] { impl_->file.close(); });
  sync_and_rename(part_path(path_), path_);
  impl_.reset();
}

struct AtomicTextFile::Gzip {
  Gzip() {
    constexpr int kGzipWindow = 15 + 16;
    UNDERSTORY_CHECK(deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGzipWindow, 8,
                                  Z_DEFAULT_STRATEGY) == Z_OK);
  }
  ~Gzip() { deflateEnd(&stream); }
  Gzip(const Gzip&) = delete;
  Gzip& operator=(const Gzip&) = delete;
  z_stream stream{};
};

AtomicTextFile::AtomicTextFile(std::filesystem::path path) : file_(std::move(path)) {
  if (file_.path().extension() == ".gz") gzip_ = std::make_unique<Gzip>();
}

AtomicTextFile::~AtomicTextFile() = default;

void AtomicTextFile::write(std::string_view text) {
  buffer_ += text;
  if (buffer_.size() >= kBuffer) drain(false);
}

void AtomicTextFile::drain(bool finish) {
  if (gzip_ == nullptr) {
    file_.write(buffer_);
    buffer_.clear();
    return;
  }
  z_stream& stream = gzip_->stream;
  stream.next_in = reinterpret_cast<Bytef*>(buffer_.data());
  stream.avail_in = static_cast<uInt>(buffer_.size());
  std::array<char, 65'536> out{};
  int state = Z_OK;
  do {
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    state = deflate(&stream, finish ? Z_FINISH : Z_NO_FLUSH);
    UNDERSTORY_CHECK(state != Z_STREAM_ERROR);
    file_.write({out.data(), out.size() - stream.avail_out});
  } while (stream.avail_out == 0 || (finish && state != Z_STREAM_END));
  buffer_.clear();
}

void AtomicTextFile::commit() {
  drain(true);
  file_.commit();
}

std::filesystem::path part_path(const std::filesystem::path& path) {
  // The ending stays, because some programs choose the format by it. The name is one that nobody
  // else gives to a file.
  return path.parent_path() / (".part.understory." + path.filename().string());
}

void sync_and_rename(const std::filesystem::path& from, const std::filesystem::path& to) {
  const auto fail = [&](int code) {
    throw OutputError(to.string(), std::string("cannot be written: ") + std::strerror(code));
  };
  const int file = ::open(from.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) fail(errno);
  const bool synced = ::fsync(file) == 0 || errno == EINVAL || errno == EROFS;
  const int code = errno;
  ::close(file);
  if (!synced) fail(code);
  if (::rename(from.c_str(), to.c_str()) != 0) fail(errno);
  with_name_of(to, [&] { sync_folder(folder_of(to)); });
}

}  // namespace understory
