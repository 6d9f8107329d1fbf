#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

namespace understory {

// A temporary file that has no name once it is open, so that nothing is left behind however the
// program ends. Parts may be appended and read by several threads at once.
class ScratchFile {
 public:
  struct Part {
    std::uint64_t begin = 0;  // bytes
    std::uint64_t size = 0;
  };

  // `folder` exists. Throws OutputError.
  explicit ScratchFile(const std::filesystem::path& folder);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  // Throws OutputError, for instance where the disk is full.
  [[nodiscard]] Part append(const void* bytes, std::size_t size);
  // Reads a whole part that was appended. Throws OutputError.
  void read(const Part& part, void* bytes) const;

 private:
  struct State;
  State* state_;
};

}  // namespace understory
