#pragma once

#include <string>

namespace understory {

// A name as one word of a command that a message proposes: in single quotes where a shell would
// split or change it. Names of letters, digits and ./-_+,:=@% stay as they are.
[[nodiscard]] std::string shell_word(const std::string& name);

}  // namespace understory
