#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace understory {

// The layout of what a run keeps: checkpoint, journal, views. It grows by one with each change of
// any of them, and a run of another layout is not gone on with. checkpoint_format_test.cc notices a
// change.
inline constexpr int kCheckpointFormat = 19;

// A checkpoint that was found whole.
struct Checkpoint {
  std::filesystem::path file;
  std::uint64_t number = 0;  // grows by one with each that is written
  std::string bytes;
};

// The files of the two newest checkpoints of a work folder: even and odd numbers. The first is
// there from the beginning of a run to its end.
[[nodiscard]] std::filesystem::path checkpoint_file(const std::filesystem::path& work,
                                                    std::uint64_t number);

// Writes a checkpoint in the place of the one before the last, so that the last one is whole at any
// moment. A temporary file is synced and renamed, and the folder is synced before and after. What
// it counts on has to be on the disk already. Throws OutputError.
void write_checkpoint(const std::filesystem::path& work, std::uint64_t number,
                      const std::string& bytes);

// Those that are whole, newest first. `problems` takes what is wrong with the others. Throws
// InputError if there is none at all.
[[nodiscard]] std::vector<Checkpoint> read_checkpoints(const std::filesystem::path& work,
                                                       std::vector<std::string>& problems);

// The content of one; throws InputError where the bytes are no whole checkpoint.
[[nodiscard]] Checkpoint parse_checkpoint(const std::filesystem::path& file, std::string bytes);

}  // namespace understory
