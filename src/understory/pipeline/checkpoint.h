#pragma once

#include <filesystem>
#include <string>

namespace understory {

// Writes `bytes` to `path` so that at any moment, whatever happens, `path` holds either the old or
// the new content in full: temporary file, fsync, rename. Throws OutputError.
void write_checkpoint(const std::filesystem::path& path, const std::string& bytes);

// Reads what write_checkpoint wrote; throws InputError if it is missing or its checksum is wrong.
[[nodiscard]] std::string read_checkpoint(const std::filesystem::path& path);

}  // namespace understory
