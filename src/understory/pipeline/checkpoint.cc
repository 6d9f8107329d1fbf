#include "understory/pipeline/checkpoint.h"

#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "understory/util/error.h"

namespace understory {
namespace {

constexpr char kMark[] = "UNDERSTORY CHECKPOINT 4\n";

std::string checksum(const std::string& bytes) {
  const uLong crc =
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size());
  char text[16];
  std::snprintf(text, sizeof(text), "%08lx\n", crc);
  return text;
}

void write_all(int file, const std::string& bytes, const std::string& path) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::write(file, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int code = errno;
      ::close(file);
      ::unlink(path.c_str());
      throw OutputError(path, std::string("cannot be written: ") + std::strerror(code));
    }
    done += static_cast<std::size_t>(n);
  }
}

}  // namespace

void write_checkpoint(const std::filesystem::path& path, const std::string& bytes) {
  const std::string temporary = path.string() + ".new";
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) throw OutputError(temporary, std::strerror(errno));
  write_all(file, kMark + checksum(bytes) + bytes, temporary);
  const bool synced = ::fsync(file) == 0;
  if (::close(file) != 0 || !synced || std::rename(temporary.c_str(), path.c_str()) != 0) {
    throw OutputError(path.string(), std::string("cannot be written: ") + std::strerror(errno));
  }
}

std::string read_checkpoint(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string(), "", "there is no checkpoint to go on from");
  std::ostringstream content;
  content << file.rdbuf();
  const std::string text = content.str();
  const std::size_t head = std::strlen(kMark);
  constexpr std::size_t kChecksum = 9;
  if (text.size() < head + kChecksum || text.compare(0, head, kMark) != 0) {
    throw InputError(path.string(), "", "expected a checkpoint of this program version");
  }
  std::string bytes = text.substr(head + kChecksum);
  if (text.compare(head, kChecksum, checksum(bytes)) != 0) {
    throw InputError(path.string(), "", "the checkpoint is damaged (checksum)");
  }
  return bytes;
}

}  // namespace understory
