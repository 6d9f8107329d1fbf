#pragma once

#include <cstdint>
#include <istream>
#include <string>

namespace YAML {  // NOLINT(readability-identifier-naming): as yaml-cpp names it
class Node;
}

namespace understory {

// A whole small text file. Throws InputError if it cannot be opened or is larger than `max_bytes`,
// ReadError with the place where the system cannot read it.
[[nodiscard]] std::string read_text_file(const std::string& path,
                                         std::uint64_t max_bytes = 64ULL << 20);

// Throws ReadError if the system could not read the stream of that file any further; an end of the
// file is none. To be asked at once where reading stops.
void check_readable(const std::istream& stream, const std::string& file,
                    const std::string& position);

// std::getline that tells a failing disk from the end of the file: false at the end, ReadError
// otherwise. `number` is that of the line, for the message.
bool read_line(std::istream& stream, std::string& line, const std::string& file,
               std::uint64_t number);

// The document of a YAML text of at most 16 MiB, 64 levels and a million values, aliases counted as
// often as they are used. Throws ConfigError with `origin` and line; includers need yaml-cpp.
[[nodiscard]] YAML::Node load_yaml(const std::string& text, const std::string& origin);

}  // namespace understory
