#include "understory/util/shell_word.h"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace understory {
namespace {

bool stays(char letter) {
  constexpr std::string_view kHarmless = "./-_+,:=@%";
  const auto byte = static_cast<unsigned char>(letter);
  return std::isalnum(byte) != 0 || byte >= 0x80 || kHarmless.find(letter) != kHarmless.npos;
}

}  // namespace

std::string shell_word(const std::string& name) {
  if (!name.empty() && std::all_of(name.begin(), name.end(), stays)) return name;
  std::string word = "'";
  for (const char letter : name)
    word += letter == '\'' ? std::string("'\\''") : std::string(1, letter);
  return word + "'";
}

}  // namespace understory
