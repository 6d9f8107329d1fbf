#pragma once

#include <filesystem>

namespace understory {

// Waits until what was made, renamed or removed in a folder is on the disk. After a power cut a
// file is found again only if both it and its folder were synced. Folders that cannot be synced
// (some network file systems) are passed over. Throws OutputError.
void sync_folder(const std::filesystem::path& folder);

// The folder that holds `path`, "." for a bare name.
[[nodiscard]] std::filesystem::path folder_of(const std::filesystem::path& path);

// Makes a folder and those above it that are missing, each of them on the disk in the end. Throws
// OutputError.
void make_durable_folder(const std::filesystem::path& folder);

}  // namespace understory
