#pragma once

namespace understory {

// Version of the program, as in CMakeLists.txt; tests/packaging/installed_tree.py compares them.
inline constexpr const char* kVersion = "0.1.0";

}  // namespace understory
