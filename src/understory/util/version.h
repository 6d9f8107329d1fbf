#pragma once

namespace understory {

// Version of the program, as in CHANGELOG.md; tests/packaging/installed_tree.py keeps it in step with CMakeLists.txt.
inline constexpr const char* kVersion = "0.1.0";

}  // namespace understory
