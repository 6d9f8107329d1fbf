#pragma once

#include <filesystem>
#include <string>

namespace understory {

// A file that was named by itself or by the folder that holds it under its usual name. InputError
// if the folder lacks it; whether a file named by itself is there is for its reader to say.
[[nodiscard]] std::filesystem::path file_in_folder(const std::string& given,
                                                   const std::string& name);

}  // namespace understory
