#pragma once

namespace understory {

// Version of the program, as in CHANGELOG.md; kept in step with CMakeLists.txt by a test.
inline constexpr const char* kVersion = "0.1.0";

}  // namespace understory
