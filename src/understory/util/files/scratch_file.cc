#include "understory/util/files/scratch_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <memory>
#include <vector>

#include "understory/util/error.h"

namespace understory {

struct ScratchFile::State {
  std::string name;
  int descriptor = -1;
  std::atomic<std::uint64_t> end{0};

  [[noreturn]] void fail(const char* what, int code) const {
    throw OutputError(name, std::string("a temporary file cannot be ") + what + ": " +
                                (code != 0 ? std::strerror(code) : "it ends early"));
  }
};

ScratchFile::ScratchFile(const std::filesystem::path& folder) {
  auto state = std::make_unique<State>();
  state->name = (folder / "scratch-XXXXXX").string();
  std::vector<char> name(state->name.begin(), state->name.end());
  name.push_back('\0');
  state->descriptor = ::mkostemp(name.data(), O_CLOEXEC);
  if (state->descriptor < 0) state->fail("made", errno);
  state->name = name.data();
  if (::unlink(name.data()) != 0) {
    const int code = errno;
    ::close(state->descriptor);
    state->fail("unlinked", code);
  }
  state_ = state.release();
}

ScratchFile::~ScratchFile() {
  ::close(state_->descriptor);
  delete state_;
}

ScratchFile::Part ScratchFile::append(const void* bytes, std::size_t size) {
  const Part part{state_->end.fetch_add(size), size};
  const auto* at = static_cast<const char*>(bytes);
  for (std::size_t done = 0; done < size;) {
    const ssize_t written =
        ::pwrite(state_->descriptor, at + done, size - done, static_cast<off_t>(part.begin + done));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) state_->fail("written", written < 0 ? errno : ENOSPC);
    done += static_cast<std::size_t>(written);
  }
  return part;
}

void ScratchFile::read(const Part& part, void* bytes) const {
  auto* at = static_cast<char*>(bytes);
  for (std::size_t done = 0; done < part.size;) {
    const ssize_t got =
        ::pread(state_->descriptor, at + done, static_cast<std::size_t>(part.size) - done,
                static_cast<off_t>(part.begin + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) state_->fail("read", got < 0 ? errno : 0);
    done += static_cast<std::size_t>(got);
  }
}

}  // namespace understory
