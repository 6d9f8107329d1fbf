#pragma once

#include <span>
#include <string_view>

namespace understory {

// A text file of report/page/ as it was when the program was built.
struct PageFile {
  std::string_view name;  // without its ending
  std::string_view text;
};
[[nodiscard]] std::span<const PageFile> page_scripts();  // in the order in which they run
[[nodiscard]] std::span<const PageFile> page_styles();

}  // namespace understory
