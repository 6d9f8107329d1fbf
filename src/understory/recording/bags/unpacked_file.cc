#include "understory/recording/bags/unpacked_file.h"

#include <fcntl.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "understory/recording/bags/byte_source.h"
#include "understory/recording/finding.h"
#include "understory/util/error.h"

namespace understory {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kUnpackStep = 1U << 20;
// Recordings shrink to a tenth; what grows by more than this is no recording.
constexpr std::uint64_t kMostGrowth = 1000;
constexpr std::uint64_t kAlwaysAllowed = 64ULL << 20;

std::string temporary_folder() {
  std::error_code error;
  const fs::path folder = fs::temp_directory_path(error);
  if (!error) return folder.string();
  const char* wanted = std::getenv("TMPDIR");
  throw OutputError(wanted != nullptr ? wanted : "/tmp",
                    "no folder for temporary files (TMPDIR): " + error.message());
}

int open_nameless(const std::string& folder) {
  int descriptor = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (descriptor >= 0) return descriptor;
  std::string pattern = folder + "/understory_bag_XXXXXX";  // the file system has no such files
  descriptor = ::mkostemp(pattern.data(), O_CLOEXEC);
  if (descriptor < 0)
    throw OutputError(folder,
                      std::string("no place for an unpacked copy: ") + std::strerror(errno));
  ::unlink(pattern.c_str());
  return descriptor;
}

void write_all(int descriptor, const std::uint8_t* data, std::size_t size,
               const std::string& place) {
  while (size > 0) {
    const ssize_t written = ::write(descriptor, data, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0)
      throw OutputError(place, std::string("no room for an unpacked copy (TMPDIR names another "
                                           "folder): ") +
                                   std::strerror(errno));
    data += written;
    size -= static_cast<std::size_t>(written);
  }
}

}  // namespace

UnpackedFile::UnpackedFile(const std::string& packed) : place_(temporary_folder()) {
  descriptor_ = open_nameless(place_);
  try {
    unpack(packed);
  } catch (...) {
    ::close(descriptor_);
    throw;
  }
}

UnpackedFile::~UnpackedFile() {
  ::close(descriptor_);
}

std::string UnpackedFile::path() const {
  return "/proc/self/fd/" + std::to_string(descriptor_);
}

void UnpackedFile::unpack(const std::string& packed) {
  const auto file = open_file(packed);
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(),
                                                                          &ZSTD_freeDStream);
  const std::uint64_t most = kAlwaysAllowed + kMostGrowth * file->size();
  std::vector<std::uint8_t> bytes;
  std::vector<std::uint8_t> piece(kUnpackStep);
  std::uint64_t written = 0;
  std::size_t state = 0;
  for (std::uint64_t at = 0; at < file->size(); at += bytes.size()) {
    file->ByteSource::read(at, kUnpackStep, bytes);
    if (bytes.empty()) break;
    ZSTD_inBuffer in{bytes.data(), bytes.size(), 0};
    bool full = false;  // the piece was, so that more may come without more input
    while (in.pos < in.size || full) {
      ZSTD_outBuffer out{piece.data(), piece.size(), 0};
      state = ZSTD_decompressStream(stream.get(), &out, &in);
      write_all(descriptor_, piece.data(), out.pos, place_);
      written += out.pos;
      full = out.pos == out.size && state != 0;
      if (ZSTD_isError(state) == 0 && written <= most) continue;
      damage_ = packed + ": at byte " + std::to_string(at + in.pos) +
                (written > most ? ": unpacks to more than a recording can"
                                : ": damaged zstd data; read as far as it goes");
      return;
    }
  }
  if (state != 0) damage_ = packed + ": the zstd data end too early; read as far as they go";
}

std::shared_ptr<const UnpackedFile> UnpackedParts::get(const std::string& packed, Log& log) {
  std::shared_ptr<const UnpackedFile>& file = kept_[packed];
  if (file == nullptr) {
    file = std::make_shared<const UnpackedFile>(packed);
    ++unpacked_;
  }
  if (!file->damage().empty()) report_finding(log, Finding::kDamage, file->damage());
  return file;
}

}  // namespace understory
